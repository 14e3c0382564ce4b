"""planner_bridge_node with generated tracks. Needs a master because of ROS time and tf2.

Stamps are the clock's, as from a camera: a tenth of a second old. What the planners make of the messages is in
test/workspace/test_planner_msgs.py; here it is which message comes when, with which stamp and frame.
"""
import signal
import subprocess
import time

import pytest
import rospy
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import PointCloud2
from tf2_msgs.msg import TFMessage

from ros_3d_bb.conversions.perception_msgs import time_from
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import TrackedObjectArray
from support.planner_definitions import message_class
from support.planners import person
from support.ros import Recorder, header_at, publisher, wait_until

LATENCY_NS, TIMEOUT_S, SPEED_MPS = NS // 10, 1.0, 1.2
TOPICS = {'points': ('planner_bridge_node/points', PointCloud2, 'width'),
          'people': ('/people', message_class('people_msgs/People'), 'people'),
          'teb': ('planner_bridge_node/obstacles', message_class('costmap_converter/ObstacleArrayMsg'), 'obstacles'),
          'mpc': ('planner_bridge_node/objects', message_class('derived_object_msgs/ObjectArray'), 'objects'),
          'vision': ('planner_bridge_node/detections', message_class('vision_msgs/Detection3DArray'), 'detections')}


def now_ns():
    return rospy.get_rostime().to_nsec()


class Rig(object):
    """A tracker, and a localisation that knows odom_from_map: a quarter turn to the left, 10 m along x. The robot is at
    (5, 1) of odom and looks along its x.
    """

    def __init__(self):
        self.tracks = publisher('ros_3d_bb/tracks', TrackedObjectArray)
        self.tf = publisher('/tf', TFMessage)

    def send_tf(self, stamp_ns):
        transform = TransformStamped(header=header_at(stamp_ns, 'odom'), child_frame_id='map')
        transform.transform.translation.x = 10.0
        transform.transform.rotation.z = transform.transform.rotation.w = 0.5 ** 0.5
        robot = TransformStamped(header=header_at(stamp_ns, 'odom'), child_frame_id='base_link')
        robot.transform.translation.x, robot.transform.translation.y, robot.transform.rotation.w = 5.0, 1.0, 1.0
        self.tf.publish(TFMessage([transform, robot]))

    def send(self, stamp_ns, *positions):
        """People at positions (x, y) of the map who walk along its x; number 1 is the first."""
        self.send_tf(stamp_ns)
        self.tracks.publish(TrackedObjectArray(header=header_at(stamp_ns, 'map'), objects=[
            person(number, x, y, speed=SPEED_MPS) for number, (x, y) in enumerate(positions, 1)]))


@pytest.fixture(scope='module')
def rig():
    rospy.init_node('test_planner_bridge_node')
    return Rig()


@pytest.fixture(scope='module')
def all_recorders(rig):
    return {name: Recorder(topic, kind) for name, (topic, kind, _field) in TOPICS.items()}


@pytest.fixture
def recorders(all_recorders):
    """Of each output, once it is quiet: what the test before left has been emptied."""
    time.sleep(TIMEOUT_S + 0.5)
    return {name: recorder.emptied() for name, recorder in all_recorders.items()}


def people_in(name, message):
    """How much is in the message of an output: people, or points."""
    content = getattr(message, TOPICS[name][2])
    return content if isinstance(content, int) else len(content)


def test_outputs_of_the_image_carry_its_stamp(rig, recorders):
    stamp_ns = now_ns() - LATENCY_NS
    rig.send(stamp_ns, (1.0, 2.0))
    for name, frame_id in (('points', 'base_link'), ('vision', 'map')):
        message, = recorders[name].wait_for(1)
        assert message.header.frame_id == frame_id and message.header.stamp == time_from(stamp_ns)
        assert people_in(name, message) > 0
    place = recorders['vision'].messages[0].detections[0].bbox.center.position
    assert (place.x, place.y, place.z) == pytest.approx((1, 2, 0.85))


def test_a_node_that_ends_empties_its_outputs(rig):
    process = subprocess.Popen(['rosrun', 'ros_3d_bb', 'planner_bridge_node', '__name:=second_bridge', '_outputs:=teb'])
    try:
        with Recorder('second_bridge/obstacles', TOPICS['teb'][1]) as recorder:
            wait_until(lambda: rig.tracks.get_num_connections() == 2, 'the second node')
            rig.send(now_ns() - LATENCY_NS, (1.0, 2.0))
            wait_until(lambda: recorder.messages and people_in('teb', recorder.messages[-1]) == 1, 'an obstacle')
            process.send_signal(signal.SIGINT)
            wait_until(lambda: people_in('teb', recorder.messages[-1]) == 0, 'an empty array')
    finally:
        process.kill()
        process.wait()
