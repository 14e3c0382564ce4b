"""ROS node that limits the speed of a robot near people."""
from typing import NamedTuple

import rospy
from geometry_msgs.msg import Twist
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Float32

from ros_3d_bb.camera.camera_model import transform_points
from ros_3d_bb.conversions.perception_msgs import stamp_of
from ros_3d_bb.conversions.planner_msgs import velocity_from_msg, velocity_to_msg
from ros_3d_bb.core.params import CLASSES_FILE, ROBOT_FRAME, SET_BY_LAUNCH, TRACKS_TIMEOUT, Param, parameters
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.nodes.common.diagnostics import Diagnostics
from ros_3d_bb.nodes.common.latest_tracks import RobotTracks
from ros_3d_bb.nodes.common.reconfigure_server import ReconfigureServer
from ros_3d_bb.nodes.common.startup import read_params
from ros_3d_bb.nodes.common.subscribers import subscribe
from ros_3d_bb.planning.safe_speed import (CornerParams, SafeSpeedParams, blind_corners, highest_safe_speed,
                                           limited_velocity, speed_before_corners)

PERIOD_S = 0.05  # between two limits; chosen: that of move_base's controller, and a tenth of the default timeout
AHEAD = 0.0, 0.0, 0.0


@parameters()
class SpeedLimitParams(NamedTuple):
    """Parameters of speed_limit_node, beside those of the safe speed."""

    robot_frame: str = ROBOT_FRAME
    timeout: float = TRACKS_TIMEOUT
    classes_file: str = CLASSES_FILE
    use_scan: bool = Param(False, 'Whether the speed is limited before blind corners in the scan.',
                           section=SET_BY_LAUNCH)


class SpeedLimitNode(object):
    """Publish the highest safe speed among tracked people, and limit velocity commands to it.

    Each command on cmd_vel_in gives one on cmd_vel, with the same path. The speed is safe if the robot can stop before
    it reaches a person, wherever the person will be until then, see `highest_safe_speed`. Without tracks or a new pose
    of the robot for ~timeout, the limit is 0, and rotations in place end, too. People who are not tracked, such as
    those behind the camera, are unknown to the node. With ~use_scan, people who may come from behind a blind corner
    count, too, see `speed_before_corners`; without scans for ~timeout, the limit is ~corner_speed. The node does not
    publish by itself: the base must stop if it receives no commands. Parameters: config/speed_limit.yaml.

    Subscribes
    ----------
    cmd_vel_in : geometry_msgs/Twist
        Commands: velocity along x and y, and about z.
    scan : sensor_msgs/LaserScan
        Planar laser scan; only with ~use_scan.

    Publishes
    ---------
    cmd_vel : geometry_msgs/Twist
        Limited commands.
    ~speed_limit : std_msgs/Float32
        Highest safe speed on the path of the last command, straight ahead without one, m/s; 20 times per second.
    """

    def __init__(self):
        self._params, self._safety, self._corner_params = given = read_params(
            SpeedLimitParams, SafeSpeedParams, CornerParams)
        self._corners_m, self._scan_ns = (), 0
        self._diagnostics, self._velocity = Diagnostics(), AHEAD
        self._limit_pub = rospy.Publisher('~speed_limit', Float32, queue_size=1)
        self._velocity_pub = rospy.Publisher('cmd_vel', Twist, queue_size=1)
        self._tracks = RobotTracks(self._diagnostics, self._params)
        subscribe('cmd_vel_in', Twist, self._on_command, 1, is_irregular=True)
        if self._params.use_scan:
            subscribe('scan', LaserScan, self._on_scan, 1)
        ReconfigureServer(given, self._reconfigure)
        self._timer = rospy.Timer(rospy.Duration.from_sec(PERIOD_S), self._on_timer, reset=True)

    def _reconfigure(self, _params, safety, corner_params):
        self._safety, self._corner_params = safety, corner_params

    def _on_scan(self, message):
        with self._diagnostics.receiving('scans'):
            limits_m = message.range_min, message.range_max
            corners_m = blind_corners(message.ranges, limits_m, message.angle_min, message.angle_increment)
            robot_from_laser, _age_s = self._tracks.robot_from(message.header.frame_id)
            if robot_from_laser is not None:
                self._corners_m = transform_points(robot_from_laser, corners_m)[:, :2]
                self._scan_ns = stamp_of(message)

    def _on_command(self, message):
        with self._diagnostics.receiving('commands'):
            self._velocity = velocity = velocity_from_msg(message)
            limit = self._limit(velocity)
            limited = AHEAD if limit is None else limited_velocity(velocity, limit)
            self._velocity_pub.publish(velocity_to_msg(*limited))
            self._diagnostics.count('commands forwarded' if limited == velocity else 'commands limited')

    def _on_timer(self, _event):
        with self._diagnostics.rejecting('limits'):
            self._limit_pub.publish(Float32(self._limit(self._velocity) or 0.0))

    def _limit(self, velocity):
        around = self._tracks.around()
        if around is None:
            if self._tracks.newest() is None:  # otherwise, there is no transform
                self._tracks.report_missing('the robot stands until there are some')
            return None
        limit = highest_safe_speed(around.tracks, around.age_s, around.robot_from_tracks, velocity, self._safety,
                                   around.pose_age_s)
        return min(limit, self._limit_before_corners(velocity)) if self._params.use_scan else limit

    def _limit_before_corners(self, velocity):
        age_s = (rospy.get_rostime().to_nsec() - self._scan_ns) / NS
        if abs(age_s) > self._params.timeout:
            self._diagnostics.warn('no recent scan', 'no recent scan: the limit is ~corner_speed until there is one')
            return self._corner_params.corner_speed
        return speed_before_corners(self._corners_m, max(age_s, 0.0), velocity, self._safety, self._corner_params)
