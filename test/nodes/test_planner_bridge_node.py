"""planner_bridge_node with generated tracks. Needs a master because of ROS time and tf2.

Stamps are the clock's, as from a camera: a tenth of a second old. The outputs, and when they are emptied, are tested
without a master in test/workspace/test_planner_bridge.py and test_planner_msgs.py.
"""
import signal
import subprocess

import pytest
import rospy
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import PointCloud2
from tf2_msgs.msg import TFMessage

from ros_3d_bb.conversions.perception_msgs import time_from
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import TrackedObjectArray
from support.planners import person
from support.ros import Recorder, header_at, publisher, wait_until


class Rig(object):
    """A tracker, and a robot at (5, 1) of the map."""

    def __init__(self):
        self.tracks = publisher('ros_3d_bb/tracks', TrackedObjectArray)
        self.tf = publisher('/tf', TFMessage)

    def send(self):
        """A person in an image of now. Returns the stamp."""
        stamp_ns = rospy.get_rostime().to_nsec() - NS // 10
        robot = TransformStamped(header=header_at(stamp_ns, 'map'), child_frame_id='base_link')
        robot.transform.translation.x, robot.transform.translation.y, robot.transform.rotation.w = 5.0, 1.0, 1.0
        self.tf.publish(TFMessage([robot]))
        self.tracks.publish(TrackedObjectArray(header=header_at(stamp_ns, 'map'), objects=[person(1, 1.0, 2.0)]))
        return time_from(stamp_ns)


@pytest.fixture(scope='module')
def rig():
    rospy.init_node('test_planner_bridge_node')
    return Rig()


def test_points_carry_the_stamp_of_the_image(rig):
    with Recorder('planner_bridge_node/points', PointCloud2) as recorder:
        stamp = rig.send()
        message, = recorder.wait_for(1)
    assert message.header.frame_id == 'base_link' and message.header.stamp == stamp and message.width > 0


def test_a_node_that_ends_empties_its_outputs(rig):
    process = subprocess.Popen(['rosrun', 'ros_3d_bb', 'planner_bridge_node', '__name:=second_bridge'])
    try:
        with Recorder('second_bridge/points', PointCloud2) as recorder:
            wait_until(lambda: rig.tracks.get_num_connections() == 2, 'the second node')
            rig.send()
            wait_until(lambda: recorder.messages and recorder.messages[-1].width, 'points')
            process.send_signal(signal.SIGINT)
            wait_until(lambda: not recorder.messages[-1].width, 'an empty cloud')
    finally:
        process.kill()
        process.wait()
