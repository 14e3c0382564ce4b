"""people_removal_node and speed_limit_node with generated tracks, scans and commands.

They need a master because of ROS time, tf2 and deadlines. Stamps are those of the clock, as from a camera: a tenth of a
second old. Their outputs are tested without a master in test/workspace, the speeds in test/unit/test_safe_speed.py.
"""
import time

import numpy as np
import pytest
import rospy
from geometry_msgs.msg import Twist, Vector3
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Float32
from tf2_msgs.msg import TFMessage

from ros_3d_bb.camera.camera_model import transform_from
from ros_3d_bb.conversions.camera_msgs import transform_messages
from ros_3d_bb.conversions.perception_msgs import time_from
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import TrackedObjectArray
from support.ros import Recorder, header_at, person, publisher, wait_until

LATENCY_NS = NS // 10
COMMAND = Twist(linear=Vector3(x=1.2), angular=Vector3(z=0.6))
BEAMS = 181
OPEN_M = np.full(BEAMS, np.inf)
BESIDE = 5.0, -6.0


class Rig(object):
    """A tracker, and a robot with a laser at (5, 1) of the map that looks along its x."""

    def __init__(self):
        self.tracks, self._tf = publisher('ros_3d_bb/tracks', TrackedObjectArray), publisher('/tf', TFMessage)
        self._commands, self._scans = publisher('cmd_vel_in', Twist), publisher('front/scan', LaserScan)
        self.limits = Recorder('speed_limit_node/speed_limit', Float32)
        self.velocities = Recorder('cmd_vel', Twist)
        self.static_scans = Recorder('people_removal_node/scan_static', LaserScan)

    def send(self, *positions, ranges_m=OPEN_M):
        """Standing people at positions (x, y) of the map, and a scan. Returns the stamp."""
        stamp_ns = rospy.get_rostime().to_nsec() - LATENCY_NS
        robot = 'map', 'base_link', transform_from((5, 1, 0), (0, 0, 0, 1))
        self._tf.publish(TFMessage(transform_messages(time_from(stamp_ns), [robot])))
        self.tracks.publish(TrackedObjectArray(header=header_at(stamp_ns, 'map'), objects=[
            person(number, x, y, moving=False, speed=0.0) for number, (x, y) in enumerate(positions, 1)]))
        if ranges_m is not None:
            self._scans.publish(LaserScan(header=header_at(stamp_ns, 'base_link'), angle_min=-np.pi / 2,
                                          angle_increment=np.pi / 180, range_max=10.0, ranges=ranges_m.tolist()))
        return time_from(stamp_ns)

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


@pytest.fixture(scope='module')
def rig():
    return Rig()


def test_commands_are_limited_before_a_person_and_keep_their_path(rig):
    assert rig.commanded(BESIDE) == pytest.approx((1.2, 0.6, 2.0))
    linear, angular, limit = rig.commanded((6.6, 1.4))
    assert 0.4 < linear < 1.1 and angular == pytest.approx(linear / 2)
    assert linear == pytest.approx(limit, abs=0.12)  # one of them is computed later, and the pose may be 0.1 s older


def test_people_are_removed_from_the_scan(rig):
    """A person of 0.6 m at 3 m, with 0.2 m around: half of the angle is asin(0.5 / 3), about 10 beams."""
    def is_removed():  # scans, tracks and tf are not ordered
        stamp = rig.send((8.0, 1.0), ranges_m=np.full(BEAMS, 3.0))
        wait_until(lambda: rig.static_scans.messages[-1].header.stamp == stamp, 'the scan')
        return 17 <= np.isnan(rig.static_scans.messages[-1].ranges).sum() <= 21
    wait_until(is_removed, 'a scan without the person')
