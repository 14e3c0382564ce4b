"""Messages, stamps and clock of simulator_node. Needs a master."""
import os
import time

import numpy as np
import pytest
import rospy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image
from tf2_msgs.msg import TFMessage

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import TrackedObjectArray
from support.ros import Recorder, started, wait_until

SCENE = """
duration: 1.0
rate: 10.0
people:
- {start: [3.0, 0.5], facing: 3.0, moves: [{to: [3.0, -0.5]}]}
"""
TOPICS = {'camera/color/image_raw': Image, 'camera/aligned_depth_to_color/image_raw': Image,
          'camera/color/camera_info': CameraInfo, 'camera/aligned_depth_to_color/camera_info': CameraInfo,
          '/tf': TFMessage, 'ground_truth': TrackedObjectArray}


@pytest.fixture(scope='module')
def path(tmp_path_factory):
    rospy.init_node('test_simulator_node')
    path = tmp_path_factory.mktemp('scenario') / 'scene.yaml'
    path.write_text(SCENE)
    return str(path)


@pytest.fixture(scope='module')
def round_of_scene(path):
    """{topic: messages} of one round with the clock of the node."""
    recorders = {topic: Recorder(topic, kind, publisher_expected=False) for topic, kind in TOPICS.items()}
    recorders['/clock'] = Recorder('/clock', Clock, publisher_expected=False)
    process = started('simulator_node', 'scenario:=' + path, 'publish_clock:=true', 'repeat:=false',
                      'wait_for_subscribers:=1')
    assert process.wait(timeout=60) == 0
    wait_until(lambda: len(recorders['ground_truth'].messages) == 10, 'ten images')
    return {topic: recorder.messages for topic, recorder in recorders.items()}


def test_all_messages_have_the_stamps_of_the_scene(round_of_scene):
    stamps = [message.header.stamp for message in round_of_scene['ground_truth']]
    assert [(stamp - stamps[0]).to_nsec() for stamp in stamps] == [number * NS // 10 for number in range(10)]
    for topic in set(TOPICS) - {'/tf'}:
        assert [message.header.stamp for message in round_of_scene[topic]] == stamps
    assert [message.transforms[0].header.stamp for message in round_of_scene['/tf']] == stamps
    assert set(stamps) <= set(message.clock for message in round_of_scene['/clock'])
    times = [message.clock for message in round_of_scene['/clock']]
    assert times == sorted(times)


def test_without_publish_clock_stamps_are_the_time_of_the_machine(path):
    began = time.time()
    with Recorder('ground_truth', TrackedObjectArray, publisher_expected=False) as truth:
        process = started('simulator_node', 'scenario:=' + path)
        wait_until(lambda: len(truth.messages) >= 12 and (
            truth.messages[-1].header.stamp - truth.messages[0].header.stamp).to_sec() > 3, 'a second round')
        process.terminate()
        process.wait()
    stamps = [message.header.stamp.to_sec() for message in truth.messages]
    assert began - 1 < stamps[0] < began + 15
    assert stamps == sorted(stamps)
    assert 3 < max(np.diff(stamps)) < 5
    assert stamps[-1] < time.time()


@pytest.mark.parametrize('params,reason', [
    ((), 'no scenario given'), (('scenario:=/nowhere.yaml',), '/nowhere.yaml'),
    (('scenario:=' + os.devnull, 'speed:=0'), '~speed is 0'), (('scenario:=x', 'speed:=2.0'), 'publish_clock'),
    (('scenario:=' + os.devnull, 'rate:=-5.0'), 'rate is -5')])
def test_invalid_parameters_are_rejected_at_the_start(path, params, reason):
    process = started('simulator_node', *params)
    output, _none = process.communicate(timeout=30)
    assert process.returncode == 1 and reason in output and 'Traceback' not in output
