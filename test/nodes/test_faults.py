"""The whole pipeline while something fails. Needs a master, as it is about nodes, connections and the clock.

After each fault everybody who is there is followed again within 2 s, told in images; and of all tracks: nobody is there
who is not, no number is given to a second person, stamps are those of images and in order (`Stage.check`).
"""
import contextlib
import time

import pytest
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import Image, PointCloud2
from std_msgs.msg import Int32MultiArray
from visualization_msgs.msg import MarkerArray

from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, DEPTH_TOPIC, INFO_TOPICS
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import BoundingBox3DArray, TrackedObjectArray
from support.processes import hanging, killed_and_back, never_reading, starved
from support.ros import wait_until
from support.stage import PERIOD_NS, Stage

NODES = '/depth_detector_node', '/bbox3d_node', '/tracker_node', '/planner_bridge_node'
OUTPUTS = [('/depth_detector_node', '/yolo_bounding_box', Int32MultiArray),
           ('/depth_detector_node', '/yolo_result_out', Image), ('/depth_detector_node', '/rosout', Log),
           ('/bbox3d_node', '/ros_3d_bb/bb_3d', BoundingBox3DArray),
           ('/bbox3d_node', '/ros_3d_bb/color', Image), ('/bbox3d_node', '/ros_3d_bb/depth', Image),
           ('/tracker_node', '/ros_3d_bb/tracks', TrackedObjectArray),
           ('/tracker_node', '/visualization_marker_array', MarkerArray),
           ('/tracker_node', '/diagnostics', DiagnosticArray),
           ('/planner_bridge_node', '/planner_bridge_node/points', PointCloud2)]


@pytest.fixture(scope='module')
def whole():
    rospy.init_node('test_faults')
    stage = Stage()
    yield stage
    print('\n' + '\n'.join(stage.rows))


@pytest.fixture
def stage(whole):
    """All are followed; the camera sees the first scene."""
    whole.scene = 0
    whole.recovered('(before the fault)', 60)
    whole.rows.pop()
    return whole


@pytest.mark.parametrize('node', NODES)
def test_a_node_is_killed_and_started_again(stage, node):
    before = stage.ids()
    stage.scene = 1

    def image():
        stage.send()
        time.sleep(0.1)
    away_s = killed_and_back(node, image)
    after = stage.recovered('%s killed, back after %.1f s' % (node, away_s))
    if node == '/tracker_node':
        assert min(after.values()) > max(before.values())


@pytest.mark.parametrize('node', NODES)
def test_a_node_hangs_and_goes_on(stage, node):
    """4 s of images wait for it, as far as the connections hold them."""
    with hanging(node):
        stage.scene = 1
        for _image in range(40):
            stage.send()
            time.sleep(0.03)
    stage.recovered('%s hung for 4 s of images' % node)


def test_the_camera_pauses_for_10_s(stage):
    """Planners are told that nobody is known any more; who came meanwhile is not taken for who left."""
    count = len(stage.tracks.messages)
    stage.pause(10)
    stage.scene = 1
    wait_until(lambda: stage.points.messages[-1].width == 0, 'nobody for planners')
    assert len(stage.tracks.messages) == count
    stage.recovered('camera paused for 10 s')


def test_transforms_stop_for_1_s_and_nobody_loses_their_number(stage):
    before, count = stage.ids(), len(stage.tracks.messages)
    for _image in range(10):
        stage.send(without=['tf'])
        time.sleep(0.1)
    time.sleep(0.5)
    assert len(stage.tracks.messages) == count
    assert stage.recovered('transforms stopped for 1 s') == before


def test_transforms_stop_for_10_s(stage):
    count = len(stage.tracks.messages)
    for _image in range(100):
        stage.send(without=['tf'])
        time.sleep(0.03)
    stage.scene = 1
    time.sleep(0.5)
    assert len(stage.tracks.messages) == count
    stage.recovered('transforms stopped for 10 s')


@pytest.mark.parametrize('seconds', [-0.75, -30.05, -3600, 3600])
def test_time_jumps(stage, seconds):
    """A bag loops, or somebody seeks in it. Nobody is taken for anybody of the time before, if that is not just now."""
    for _image in range(10):
        stage.step()
    before = stage.ids()
    stage.scene = int(abs(seconds) > 1)
    stage.pass_time(int(seconds * NS))
    after = stage.recovered('time jumped by %g s' % seconds)
    assert min(after.values()) > max(before.values()) if abs(seconds) > 1 else after == before


@pytest.mark.parametrize('seconds', [-3600, 3600])
def test_the_clock_is_wrong_once(stage, seconds):
    """The images are not: only who asks for the time notices."""
    stage.publish_time(stage.now_ns + seconds * NS)
    stage.recovered('/clock wrong by %d s, once' % seconds)


def test_images_stop_on_one_topic(stage):
    """Without depth nobody can be said to be anywhere, nor to have left."""
    for topic in (DEPTH_TOPIC, COLOR_TOPIC, INFO_TOPICS[0]):
        for _image in range(10):
            stage.send(without=[topic])
            time.sleep(0.03)
        stage.recovered('nothing on %s for 1 s' % topic)


def test_subscribers_that_never_read_hold_up_nobody(stage):
    """100 images are answered, though the connections of the large outputs hold no more than three of them."""
    with contextlib.ExitStack() as deaf:
        for output in OUTPUTS:
            deaf.enter_context(never_reading(*output))
        for _image in range(100):
            stage.step()
        stage.recovered('nobody reads what is sent')
    stage.recovered('those who did not read are gone')


def test_the_processor_is_taken_and_given_back(stage):
    with starved(4):
        for _image in range(30):
            stage.send()
            time.sleep(PERIOD_NS / NS)
    stage.scene = 1
    stage.recovered('4 busy processes for each core, 3 s')
