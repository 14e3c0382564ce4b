"""The whole pipeline under faults of nodes, connections and the clock, which need a master.

After each fault, all people must be tracked again within 2 s of images. No track may be where no person is, no ID may
be assigned to a second person, and stamps must be those of images, in order (`Stage.check`).
"""
import contextlib
import os
import time

import pytest

from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, DEPTH_TOPIC, INFO_TOPICS
from ros_3d_bb.core.time_sync import NS
from support.processes import cpu_load, hanging, killed_and_back, never_reading
from support.ros import wait_until
from support.stage import PERIOD_NS, Stage

NODES = '/detector_node', '/bbox3d_node', '/tracker_node', '/planner_bridge_node'
OUTPUTS = {'/detector_node': ['/yolo_bounding_box', '/yolo_result_out', '/rosout'],
           '/bbox3d_node': ['/ros_3d_bb/bb_3d', '/ros_3d_bb/color', '/ros_3d_bb/depth'],
           '/tracker_node': ['/ros_3d_bb/tracks', '/visualization_marker_array', '/diagnostics'],
           '/planner_bridge_node': ['/planner_bridge_node/points']}


@pytest.fixture(scope='module')
def pipeline_stage():
    stage = Stage()
    yield stage
    print('\n' + '\n'.join(stage.rows))


@pytest.fixture
def stage(pipeline_stage):
    track_the_first_scene(pipeline_stage)
    return pipeline_stage


def track_the_first_scene(stage):
    stage.scene = 0
    stage.recovered('(before the fault)', 60)
    stage.rows.pop()


def send_images(stage, count, pause_s, without=()):
    for _image in range(count):
        stage.send(without)
        time.sleep(pause_s)


@pytest.mark.parametrize('node', NODES)
def test_a_node_is_killed_and_restarted(stage, node):
    before = stage.ids()
    stage.scene = 1
    away_s = killed_and_back(node, lambda: send_images(stage, 1, 0.1))
    after = stage.recovered('%s killed, back after %.1f s' % (node, away_s))
    if node == '/tracker_node':
        assert min(after.values()) > max(before.values())


@pytest.mark.parametrize('node', NODES)
def test_a_node_hangs_and_continues(stage, node):
    """4 s of images wait for it, as far as the connections hold them."""
    with hanging(node):
        stage.scene = 1
        send_images(stage, 40, 0.03)
    stage.recovered('%s hung for 4 s of images' % node)


def test_the_camera_pauses_for_10_s(stage):
    """Planners receive an empty output, and a person who arrives meanwhile gets a new ID."""
    count = len(stage.tracks.messages)
    stage.pause(10)
    stage.scene = 1
    wait_until(lambda: stage.points.messages[-1].width == 0, 'an empty output for planners')
    assert len(stage.tracks.messages) == count
    stage.recovered('camera paused for 10 s')


@pytest.mark.parametrize('seconds, pause_s, scene', [(1, 0.1, 0), (10, 0.03, 1)])
def test_transforms_stop(stage, seconds, pause_s, scene):
    """People keep their IDs after a second."""
    before, count = stage.ids(), len(stage.tracks.messages)
    send_images(stage, 10 * seconds, pause_s, without=['tf'])
    stage.scene = scene
    time.sleep(0.5)
    assert len(stage.tracks.messages) == count
    after = stage.recovered('transforms stopped for %d s' % seconds)
    assert after == before or seconds > 1


@pytest.mark.parametrize('seconds', [-0.75, -30.05, -3600, 3600])
def test_time_jumps(stage, seconds):
    """As when a bag loops or is rewound. IDs are kept only across a jump of less than a second."""
    for _image in range(10):
        stage.step()
    before = stage.ids()
    stage.scene = int(abs(seconds) > 1)
    stage.pass_time(int(seconds * NS))
    after = stage.recovered('time jumped by %g s' % seconds)
    assert min(after.values()) > max(before.values()) if abs(seconds) > 1 else after == before


@pytest.mark.parametrize('seconds', [-3600, 3600])
def test_the_clock_is_wrong_once(stage, seconds):
    """The stamps of the images are correct."""
    stage.publish_time(stage.now_ns + seconds * NS)
    stage.recovered('/clock wrong by %d s, once' % seconds)


@pytest.mark.parametrize('topic', [DEPTH_TOPIC, COLOR_TOPIC, INFO_TOPICS[0]])
def test_images_stop_on_one_topic(stage, topic):
    send_images(stage, 10, 0.03, without=[topic])
    stage.recovered('nothing on %s for 1 s' % topic)


def test_subscribers_that_never_read_do_not_block_the_others(stage):
    """100 images are processed, although the connections of the large outputs hold at most three of them."""
    with contextlib.ExitStack() as connections:
        for node, topic in [(node, topic) for node, topics in OUTPUTS.items() for topic in topics]:
            connections.enter_context(never_reading(node, topic))
        for _image in range(100):
            stage.step()
        stage.recovered('subscribers that never read')
    stage.recovered('these subscribers are gone')


def test_the_processor_is_busy(stage):
    with cpu_load(4 * os.cpu_count()):
        send_images(stage, 30, PERIOD_NS / NS)
    stage.scene = 1
    stage.recovered('4 busy processes for each core, 3 s')
