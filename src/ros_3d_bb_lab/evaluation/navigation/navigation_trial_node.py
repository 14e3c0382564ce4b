"""ROS node that supervises one trial of the navigation benchmark."""
import json
import threading
import time
from typing import NamedTuple

import rospy
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, Twist
from nav_msgs.msg import MapMetaData, OccupancyGrid, Odometry
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Float32, Header, Time, UInt32
from tf2_msgs.msg import TFMessage

from ros_3d_bb.conversions.camera_msgs import topic_of
from ros_3d_bb.conversions.perception_msgs import BOXES3D_TOPIC, TRACKS_TOPIC, time_from, transform_from_msg
from ros_3d_bb.core.params import SET_BY_LAUNCH, Param, parameters
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import BoundingBox3DArray, TrackedObjectArray
from ros_3d_bb.nodes.common.startup import read_params
from ros_3d_bb_lab.evaluation.navigation.trial_result import (CELL_M, SHINS_M, Pace, VisiblePeople, distance_m,
                                                              occupancy, stops, was_driving)
from ros_3d_bb_lab.simulation.laser import FIELD_OF_VIEW, planar_pose, scan_ranges
from ros_3d_bb_lab.simulation.ros.driven_robot import scan_to_msg
from ros_3d_bb_lab.simulation.ros.scenario_to_bag import BASE_FRAME, MAP_FRAME, ODOM_FRAME, TRUTH_TOPIC
from ros_3d_bb_lab.simulation.scenario import read_scenario

REACHED_M = 0.4  # the goal tolerance of move_base is 0.3 m
POLL_S = 0.002
START_TIMEOUT_S, TRIAL_TIMEOUT_S = 180.0, 600.0  # of the machine's time
WARM_UP_S, LONGEST_S = 1.0, 30.0  # of the published time: with standing people before a trial, and of a trial


@parameters()
class NavigationTrialParams(NamedTuple):
    scenario: str = Param('')
    record: str = Param('')
    goal_x: float = Param(0.0, limits=(-1000, 1000))
    goal_y: float = Param(0.0, limits=(-1000, 1000))
    tracks: bool = Param(False, 'Whether the time waits for tracks.', section=SET_BY_LAUNCH)
    boxes: bool = Param(False, 'Whether the time waits for the 3D boxes of each camera.', section=SET_BY_LAUNCH)
    visible: bool = Param(False, 'Whether the true tracks of visible people are published.', section=SET_BY_LAUNCH)
    scan: bool = Param(False, 'Whether the scan of a planar laser is published.', section=SET_BY_LAUNCH)


class NavigationTrialNode(object):
    """Send a goal to move_base, measure how the simulated robot gets there, write the record and exit.

    The node controls the time of the simulator: it is at most 0.2 s ahead of the newest inputs that tracker and planner
    have processed, so that they keep up on a slow machine, too. Parameters: see
    `NavigationTrialParams`; launch/navigation_benchmark.launch.
    """

    def __init__(self):
        self._params, = read_params(NavigationTrialParams)
        self._scenario = read_scenario(self._params.scenario)
        self._pace = Pace()
        self._sources = []  # names of the inputs of move_base for which the time waits
        self._pose, self._speeds_mps, self._clearances_m = None, [], []
        self._collisions, self._driving_collisions = 0, 0
        self._map_pub = rospy.Publisher('map', OccupancyGrid, queue_size=1, latch=True)
        self._goal_pub = rospy.Publisher('move_base_simple/goal', PoseStamped, queue_size=1)
        self._limit_pub = rospy.Publisher('simulator_node/time_limit', Time, queue_size=1)
        rospy.Subscriber('/tf', TFMessage, self._on_tf, queue_size=100)
        rospy.Subscriber('odom', Odometry, lambda message: self._speeds_mps.append(message.twist.twist.linear.x))
        rospy.Subscriber('clearance', Float32, lambda message: self._clearances_m.append(message.data))
        rospy.Subscriber('collisions', UInt32, self._on_collisions)
        rospy.Subscriber('cmd_vel', Twist, lambda _message: self._pace.heard('commands', self._now_ns()))
        rospy.Subscriber('move_base/local_costmap/costmap', OccupancyGrid,
                         lambda _message: self._pace.heard('costmap', self._now_ns()))
        if self._params.tracks:
            self._wait_for('tracks', TRACKS_TOPIC, TrackedObjectArray)
        if self._params.boxes:
            for mount in self._scenario.robot.mounts:
                self._wait_for('boxes ' + mount.name, topic_of(mount.name, BOXES3D_TOPIC), BoundingBox3DArray)
        if self._params.visible:
            self._visible = VisiblePeople(len(self._scenario.robot.mounts))
            self._tracks_pub = rospy.Publisher(TRACKS_TOPIC, TrackedObjectArray, queue_size=10)
            rospy.Subscriber(TRUTH_TOPIC, TrackedObjectArray, self._publish_visible)
        if self._params.scan:
            self._sources.append('scan')
            self._scan_pub = rospy.Publisher('scan', LaserScan, queue_size=10)
            rospy.Subscriber(TRUTH_TOPIC, TrackedObjectArray, self._publish_scan)

    def _wait_for(self, source, topic, kind):
        self._sources.append(source)
        rospy.Subscriber(topic, kind, lambda message: self._pace.heard(source, message.header.stamp.to_nsec()))

    def run(self):
        self._map_pub.publish(map_message(self._scenario.room))
        worker = threading.Thread(target=self._run, daemon=True)  # publishing in the main thread can block on SIGINT
        worker.start()
        while worker.is_alive() and not rospy.is_shutdown():
            worker.join(0.1)

    def _run(self):
        if not self._started():
            rospy.logfatal('move_base, tracker or camera did not start within %.0f s; there is no result',
                           START_TIMEOUT_S)
            return
        start_ns = self._now_ns()
        self._speeds_mps, self._clearances_m = [], []
        self._goal_pub.publish(goal_message(self._params, time_from(start_ns)))
        self._pace.start(start_ns, ['commands'] + self._sources)
        time_to_goal_s = self._drive(start_ns)
        if rospy.is_shutdown():
            return  # interrupted: there is no result
        result = {'time_to_goal_s': time_to_goal_s, 'collisions': self._collisions,
                  'collisions_driving': self._driving_collisions, 'min_distance_m': min(self._clearances_m),
                  'stops': stops(self._speeds_mps), 'late': self._pace.late}
        with open(self._params.record, 'w') as stream:
            json.dump(result, stream)

    def _started(self):
        deadline_s, ready_ns = time.monotonic() + START_TIMEOUT_S, None
        wanted = {'costmap', *self._sources}
        while time.monotonic() < deadline_s and not rospy.is_shutdown():
            is_ready = (wanted <= self._pace.sources and self._pose is not None
                        and self._goal_pub.get_num_connections() and self._limit_pub.get_num_connections())
            ready_ns = (ready_ns or self._now_ns()) if is_ready else None
            if is_ready and self._now_ns() > ready_ns + WARM_UP_S * NS:
                return True
            time.sleep(0.05)
        return False

    def _drive(self, start_ns):
        """Let time pass until the robot is at the goal. Returns the time that it took, seconds, or None."""
        deadline_s = time.monotonic() + TRIAL_TIMEOUT_S
        while time.monotonic() < deadline_s and not rospy.is_shutdown():
            limit_ns = self._pace.new_limit(time.monotonic())
            if limit_ns is not None:
                self._limit_pub.publish(Time(time_from(limit_ns)))
            elapsed_s = (self._now_ns() - start_ns) / NS
            if distance_m(self._pose[:2], (self._params.goal_x, self._params.goal_y)) < REACHED_M:
                return elapsed_s
            if elapsed_s > LONGEST_S:
                return None
            time.sleep(POLL_S)
        return None

    def _now_ns(self):
        return rospy.get_rostime().to_nsec()

    def _on_tf(self, message):
        links = {link.child_frame_id: transform_from_msg(link) for link in message.transforms}
        if ODOM_FRAME in links and BASE_FRAME in links:
            self._pose = planar_pose(links[ODOM_FRAME].dot(links[BASE_FRAME]))

    def _on_collisions(self, message):
        if message.data > self._collisions:
            self._driving_collisions += was_driving(self._speeds_mps)
        self._collisions = message.data

    def _publish_visible(self, message):
        message.objects = self._visible.of(message.objects)
        self._tracks_pub.publish(message)

    def _publish_scan(self, message):
        """The robot moves less than a beam between the image and the newest transform."""
        if self._pose is None:
            return
        people = [(track.pose.pose.position.x, track.pose.pose.position.y) for track in message.objects]
        ranges_m = scan_ranges(self._pose, self._scenario.room, people, [SHINS_M] * len(people))
        self._scan_pub.publish(scan_to_msg(ranges_m, FIELD_OF_VIEW, message.header.stamp))
        self._pace.heard('scan', message.header.stamp.to_nsec())


def map_message(room):
    cells = occupancy(room)
    origin = Pose(Point(room.bounds[0], room.bounds[2], 0), Quaternion(0, 0, 0, 1))
    return OccupancyGrid(Header(frame_id=MAP_FRAME), MapMetaData(
        resolution=CELL_M, width=cells.shape[1], height=cells.shape[0], origin=origin), cells.ravel().tolist())


def goal_message(params, stamp):
    """Goal of a trial in the map, facing along x."""
    pose = Pose(Point(params.goal_x, params.goal_y, 0), Quaternion(0, 0, 0, 1))
    return PoseStamped(Header(stamp=stamp, frame_id=MAP_FRAME), pose)
