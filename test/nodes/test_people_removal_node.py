"""people_removal_node with a generated scan and tracks. Needs a master because of ROS time, tf2 and remapped topics.

Clouds, depth images and old tracks are in test/workspace/test_people_removal_without_master.py.
"""
import math

import pytest
import rospy
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import TrackedObjectArray
from support.planners import person
from support.ros import Recorder, header_at, publisher, wait_until

LATENCY_NS, BEAMS = NS // 10, 181


class Rig(object):
    """A tracker, and a laser at (1, 0) of the map that looks along its x; everything is 3 m away."""

    def __init__(self):
        self._tracks, self._tf = publisher('ros_3d_bb/tracks', TrackedObjectArray), publisher('/tf', TFMessage)
        self._scans, self.results = publisher('scan', LaserScan), Recorder('scan_static', LaserScan)

    def send_tracks(self, *positions):
        """Standing people at positions (x, y) of the map, in an image a tenth of a second ago."""
        header = header_at(rospy.get_rostime().to_nsec() - LATENCY_NS, 'map')
        self._tracks.publish(TrackedObjectArray(header=header, objects=[
            person(number, x, y, moving=False, speed=0.0) for number, (x, y) in enumerate(positions, 1)]))

    def scan_with_person(self):
        """The first scan and its result after tracks of a person arrived; scans, tracks and tf are not ordered."""
        def is_removed():
            self.send_tracks((4.0, 0.0))
            scans.append(self.scan())
            return scans[-1][1].ranges != tuple(scans[-1][0].ranges)
        scans = []
        wait_until(is_removed, 'a scan without the person')
        return scans[-1]

    def scan(self):
        """The sent scan, and the result."""
        stamp_ns = rospy.get_rostime().to_nsec()
        laser = TransformStamped(header=header_at(stamp_ns, 'map'), child_frame_id='laser')
        laser.transform.translation.x, laser.transform.translation.z, laser.transform.rotation.w = 1.0, 0.3, 1.0
        self._tf.publish(TFMessage([laser]))
        message = LaserScan(header=header_at(stamp_ns, 'laser'), angle_min=-math.pi / 2, range_max=10.0,
                            angle_increment=math.pi / (BEAMS - 1), ranges=[3.0] * BEAMS)
        self.results.emptied()
        self._scans.publish(message)
        return message, self.results.wait_for(1)[0]


@pytest.fixture(scope='module')
def rig():
    rospy.init_node('test_people_removal_node')
    return Rig()


def test_people_are_removed_from_the_scan_and_nothing_else(rig):
    """A person of 0.6 m at 3 m, with 0.2 m around: half of the angle is asin(0.5 / 3), about 10 beams."""
    sent, result = rig.scan_with_person()
    removed = [number for number, range_m in enumerate(result.ranges) if math.isnan(range_m)]
    assert removed == list(range(min(removed), max(removed) + 1)) and 17 <= len(removed) <= 21
    assert (min(removed) + max(removed)) / 2 == (BEAMS - 1) / 2
    assert [range_m for range_m in result.ranges if not math.isnan(range_m)] == [3.0] * (BEAMS - len(removed))
    assert result.header.stamp == sent.header.stamp and result.header.frame_id == 'laser'
