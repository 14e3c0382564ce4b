"""speed_limit_node with generated tracks and commands. Needs a master because of ROS time and its deadline.

The speeds themselves are in test/unit/test_safe_speed.py.
"""
import time

import numpy as np
import pytest
import rospy
from geometry_msgs.msg import TransformStamped, Twist, Vector3
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Float32
from tf2_msgs.msg import TFMessage

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import TrackedObjectArray
from support.planners import person
from support.ros import Recorder, diagnostics_of, header_at, publisher, wait_until

LATENCY_NS, TIMEOUT_S = NS // 10, 0.5
COMMAND = Twist(linear=Vector3(x=1.2), angular=Vector3(z=0.6))
BEAMS = 181
OPEN_M = np.full(BEAMS, np.inf)
CORNER_M = np.where(np.arange(BEAMS) > 110, 1.5, np.inf)  # from 20 degrees on the left


class Rig(object):
    """A tracker, and a robot at (5, 1) of the map that looks along its x."""

    def __init__(self):
        self._tracks, self._tf = publisher('ros_3d_bb/tracks', TrackedObjectArray), publisher('/tf', TFMessage)
        self._commands, self._scans = publisher('cmd_vel_in', Twist), publisher('front/scan', LaserScan)
        self.limits = Recorder('speed_limit_node/speed_limit', Float32)
        self.velocities = Recorder('cmd_vel', Twist)

    def send(self, *positions, ranges_m=OPEN_M):
        """Standing people at positions (x, y) of the map, and a scan."""
        stamp_ns = rospy.get_rostime().to_nsec() - LATENCY_NS
        robot = TransformStamped(header=header_at(stamp_ns, 'map'), child_frame_id='base_link')
        robot.transform.translation.x, robot.transform.translation.y, robot.transform.rotation.w = 5.0, 1.0, 1.0
        self._tf.publish(TFMessage([robot]))
        if ranges_m is not None:
            self._scans.publish(LaserScan(header=header_at(stamp_ns, 'base_link'), angle_min=-np.pi / 2,
                                          angle_increment=np.pi / 180, range_max=10.0, ranges=ranges_m.tolist()))
        self._tracks.publish(TrackedObjectArray(header=header_at(stamp_ns, 'map'), objects=[
            person(number, x, y, moving=False, speed=0.0) for number, (x, y) in enumerate(positions, 1)]))

    def commanded(self, *positions, ranges_m=OPEN_M):
        """The last of a second of commands, among these people: linear, angular, and the last limit."""
        self.velocities.emptied()
        self.limits.emptied()
        for _command in range(10):
            self.send(*positions, ranges_m=ranges_m)
            self._commands.publish(COMMAND)
            time.sleep(0.1)
        velocities = self.velocities.wait_for(10)
        return velocities[-1].linear.x, velocities[-1].angular.z, self.limits.messages[-1].data

    def answer(self):
        """The command that follows from one without new tracks."""
        self.velocities.emptied()
        self._commands.publish(COMMAND)
        message, = self.velocities.wait_for(1)
        return message.linear.x, message.angular.z


@pytest.fixture(scope='module')
def rig():
    rospy.init_node('test_speed_limit_node')
    return Rig()


def test_without_tracks_the_robot_stands(rig):
    assert rig.answer() == (0.0, 0.0)
    assert rig.limits.emptied().wait_for(1)[0].data == 0.0


def test_commands_pass_without_people_near(rig):
    assert rig.commanded((5.0, -6.0)) == pytest.approx((1.2, 0.6, 2.0))


def test_commands_are_limited_before_a_person_and_keep_their_path(rig):
    linear, angular, limit = rig.commanded((6.6, 1.4))
    assert 0.4 < linear < 1.1 and linear == pytest.approx(limit, abs=0.05) and angular == pytest.approx(linear / 2)
    assert diagnostics_of('speed_limit_node')[2]['commands limited'] >= 10


def test_commands_are_limited_before_a_blind_corner_and_without_scans(rig):
    assert rig.commanded((5.0, -6.0), ranges_m=CORNER_M)[0] == pytest.approx(0.3)
    assert rig.commanded((5.0, -6.0), ranges_m=np.full(BEAMS, 1.5))[0] == pytest.approx(1.2)
    assert rig.commanded((5.0, -6.0), ranges_m=None)[0] == pytest.approx(0.3)
    assert diagnostics_of('speed_limit_node')[2]['no recent scan'] > 0


def test_the_limit_is_zero_half_a_second_after_the_last_image(rig):
    rig.commanded((5.0, -6.0))
    rig.send((5.0, -6.0))
    sent_s = time.monotonic()
    wait_until(lambda: rig.limits.messages[-1].data == 0.0, 'the limit 0')
    assert TIMEOUT_S - LATENCY_NS / NS - 0.15 < time.monotonic() - sent_s < TIMEOUT_S + 0.3
    assert rig.answer() == (0.0, 0.0)
    assert rig.commanded((5.0, -6.0))[0] == pytest.approx(1.2)


def test_the_node_is_silent_without_commands(rig):
    rig.velocities.emptied()
    rig.send()
    assert rig.velocities.stays_at(0)
