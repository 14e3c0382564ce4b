"""Messages, stamps and clock of simulator_node. Needs a master."""
import contextlib
import os

import pytest
import rospy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image
from tf2_msgs.msg import TFMessage

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import TrackedObjectArray
from support.ros import Recorder, started, wait_until

RATE = 15
SCENE = """
duration: 1.0
rate: 15.0
people:
- {start: [3.0, 0.5], facing: 3.0, moves: [{to: [3.0, -0.5]}]}
"""
COLOR = 'camera/color/image_raw'
TOPICS = {'camera/aligned_depth_to_color/image_raw': Image, 'camera/color/camera_info': CameraInfo,
          'camera/aligned_depth_to_color/camera_info': CameraInfo, '/tf': TFMessage, '/clock': Clock,
          'ground_truth': TrackedObjectArray}
IMAGE_TOPICS = {COLOR} | set(TOPICS) - {'/tf', '/clock'}


@pytest.fixture(scope='module')
def path(tmp_path_factory):
    rospy.init_node('test_simulator_node')
    path = tmp_path_factory.mktemp('scenario') / 'scene.yaml'
    path.write_text(SCENE)
    return str(path)


@contextlib.contextmanager
def recorded(kinds, *params):
    """({topic: recorder}, process) of a simulator_node whose scene starts once all recorders are connected."""
    with contextlib.ExitStack() as stack:
        recorders = {topic: stack.enter_context(Recorder(topic, kind, publisher_expected=False))
                     for topic, kind in kinds.items()}
        process = started('simulator_node', 'publish_clock:=true', 'repeat:=false', 'wait_for_subscribers:=1', *params)
        wait_until(lambda: all(recorder.is_connected for recorder in recorders.values()), 'all connections')
        recorders[COLOR] = stack.enter_context(Recorder(COLOR, Image))  # the subscriber that the node waits for
        yield recorders, process


@pytest.fixture(scope='module')
def round_of_scene(path):
    """{topic: messages} of one round with the clock of the node."""
    with recorded(TOPICS, 'scenario:=' + path) as (recorders, process):
        assert process.wait(timeout=60) == 0
        wait_until(lambda: all(len(recorders[topic].messages) == RATE for topic in IMAGE_TOPICS), 'all images')
    return {topic: recorder.messages for topic, recorder in recorders.items()}


def test_all_messages_have_the_stamps_of_the_scene(round_of_scene):
    stamps = [message.header.stamp for message in round_of_scene['ground_truth']]
    assert [(stamp - stamps[0]).to_nsec() for stamp in stamps] == [
        int(round(number / RATE * NS)) for number in range(RATE)]
    for topic in IMAGE_TOPICS:
        assert [message.header.stamp for message in round_of_scene[topic]] == stamps
    times = [message.clock for message in round_of_scene['/clock']]
    assert times == sorted(times)


def test_time_and_tf_are_published_every_20_ms_and_at_the_images(round_of_scene):
    start = round_of_scene['ground_truth'][0].header.stamp
    transforms = [message.transforms for message in round_of_scene['/tf']]
    assert [[link.child_frame_id for link in links] for links in transforms] == [
        ['odom', 'base_link', 'camera_color_optical_frame']] * len(transforms)
    times_ns = [(links[0].header.stamp - start).to_nsec() for links in transforms]
    images_ns = [int(round(number / RATE * NS)) for number in range(RATE)]
    assert times_ns == sorted(set(range(0, NS + 1, NS // 50)) | set(images_ns))
    clock_ns = [(message.clock - start).to_nsec() for message in round_of_scene['/clock']]
    assert clock_ns[-len(times_ns):] == times_ns


@pytest.mark.parametrize('params,reason', [
    ((), 'no scenario given'), (('scenario:=/nowhere.yaml',), '/nowhere.yaml'),
    (('scenario:=' + os.devnull, 'seed:=-2'), '~seed is -2'), (('scenario:=x', 'supervised:=true'), 'publish_clock'),
    (('scenario:=' + os.devnull, 'rate:=-5.0'), 'rate is -5')])
def test_invalid_parameters_are_rejected_at_the_start(path, params, reason):
    process = started('simulator_node', *params)
    output, _none = process.communicate(timeout=30)
    assert process.returncode == 1 and reason in output and 'Traceback' not in output
