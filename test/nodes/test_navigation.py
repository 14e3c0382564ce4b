"""navigation.launch among people in simulated time, with the real move_base, costmap_2d and social layers."""
import itertools
import os
import signal
import time

import numpy as np
import pytest
import rospy
from geometry_msgs.msg import PoseStamped, Twist
from nav_msgs.msg import OccupancyGrid, Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2
from tf2_msgs.msg import TFMessage

from ros_3d_bb.camera.camera_model import OPTICAL_ROTATION, transform_from, transform_points
from ros_3d_bb.conversions.camera_msgs import transform_messages
from ros_3d_bb.conversions.perception_msgs import time_from
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import BoundingBox3DArray, TrackedObjectArray
from ros_3d_bb_lab.evaluation.launching import running
from ros_3d_bb_lab.evaluation.latency.latency_probe_node import pid_of
from ros_3d_bb_lab.simulation.driven_world import moved
from ros_3d_bb_lab.simulation.simulator import upright
from support.planner_definitions import message_class
from support.real_planners import ROOT, planner_environment
from support.ros import Recorder, happens, header_at, wait_until
from support.two_cameras import boxes

TICK_NS, PERIOD_NS = NS // 100, NS // 10
CAMERA, BASE_FROM_CAMERA = 'camera_color_optical_frame', transform_from((0.17, 0, 0.2), OPTICAL_ROTATION)
DRIFT = 0.03, -0.02, 0.02  # of odom in the map: x, y (m/s) and yaw (rad/s)
PATIENCE_S = 1.0  # real time, for an answer
COSTMAP_NS = 4 * NS // 10  # longest time between costmaps
FAULTY_SPEED = 4.0


def level(x, y, yaw):
    return upright(x, y, 0, yaw)


class DrivenRobot(object):
    """The robot starts at the origin of the map and looks along x. Its localisation and odometry publish tf at 10 Hz.

    `people` is a function from seconds to positions (n, 2) in the map. `velocity` is that of the last cmd_vel. Time
    waits for the answers of the bridge and of move_base, so that a busy machine does not look like a fault. While
    `is_faulty`, time does not wait for the bridge and runs faster than real time, so that a killed node is missing for
    long enough.
    """

    def __init__(self):
        self.now_ns, self.people, self.sees = 1000 * NS, lambda _time_s: np.zeros((0, 2)), True
        self.is_faulty = False
        self.velocity, self.commands, self._pose, self._cmd = 0.0, 0, np.zeros(3), np.zeros(2)
        self._sent_ns, self._answered, self._commands = None, True, 0
        self._clock_pub = rospy.Publisher('/clock', Clock, queue_size=10)
        self._tf_pub = rospy.Publisher('/tf', TFMessage, queue_size=10)
        self._odom_pub = rospy.Publisher('odometry/filtered', Odometry, queue_size=10)
        self._boxes_pub = rospy.Publisher('ros_3d_bb/bb_3d', BoundingBox3DArray, queue_size=10)
        self._map_pub = rospy.Publisher('map', OccupancyGrid, queue_size=1, latch=True)
        self._map_pub.publish(self._empty_map())
        rospy.Subscriber('cmd_vel', Twist, self._on_cmd_vel, queue_size=1)
        self.tracks = Recorder('ros_3d_bb/tracks', TrackedObjectArray, publisher_expected=False)
        self.ring = Recorder('planner_bridge_node/clearing_points', PointCloud2, publisher_expected=False)
        self.costmap = Recorder('move_base/local_costmap/costmap', OccupancyGrid, publisher_expected=False)

    @staticmethod
    def _empty_map():
        message = OccupancyGrid(header=header_at(0, 'map'), data=[0] * 400 * 400)
        message.info.width = message.info.height = 400
        message.info.resolution, message.info.origin.orientation.w = 0.1, 1.0
        message.info.origin.position.x = message.info.origin.position.y = -20.0
        return message

    @property
    def seconds(self):
        return (self.now_ns - 1000 * NS) / NS

    @property
    def place_m(self):
        return np.linalg.inv(self.odom_from_map(self.seconds)).dot(level(*self._pose))[:2, 3]

    def _on_cmd_vel(self, message):
        self._cmd = np.array([message.linear.x, message.angular.z])
        self.velocity, self.commands = abs(self._cmd).max(), self.commands + 1

    def odom_from_map(self, seconds):
        """Drift of the odometry at a time."""
        return np.linalg.inv(level(*np.multiply(DRIFT, seconds)))

    def advance(self, seconds, is_driven=True):
        """Let time pass, with 10 images a second if the camera sees; `is_driven`: move_base has a goal."""
        for _step in range(int(round(10 * seconds))):
            self._send_tf()  # first: the tracker needs it for the boxes before
            if self.costmap.messages:
                happens(lambda: (self.commands > self._commands or not is_driven)
                        and self.now_ns - _newest_ns(self.costmap) < COSTMAP_NS, PATIENCE_S)
            self._commands = self.commands
            for tick in range(PERIOD_NS // TICK_NS):
                self.now_ns += TICK_NS
                self._clock_pub.publish(Clock(time_from(self.now_ns)))
                self._pose = moved(self._pose, self._cmd, TICK_NS / NS)
                time.sleep(TICK_NS / NS / (FAULTY_SPEED if self.is_faulty else 1))
                if tick == 2 and self.sees:
                    self._send_boxes()

    def _send_tf(self):
        stamp_ns = self.now_ns
        map_from_odom, odom_from_base = np.linalg.inv(self.odom_from_map(self.seconds)), level(*self._pose)
        links = transform_messages(time_from(stamp_ns), [('map', 'odom', map_from_odom), (
            'odom', 'base_link', odom_from_base), ('base_link', CAMERA, BASE_FROM_CAMERA)])
        self._tf_pub.publish(TFMessage(links))
        odometry = Odometry(header=header_at(stamp_ns, 'odom'), child_frame_id='base_link')
        odometry.pose.pose.position.x, odometry.pose.pose.position.y = self._pose[:2]
        odometry.pose.pose.orientation = links[1].transform.rotation
        odometry.twist.twist.linear.x, odometry.twist.twist.angular.z = self._cmd
        self._odom_pub.publish(odometry)

    def _send_boxes(self):
        """The boxes of the people in front of the camera, once the bridge has answered the last ones."""
        if self._sent_ns and self._answered and not self.is_faulty:
            self._answered = happens(lambda: _newest_ns(self.ring) >= self._sent_ns, PATIENCE_S)
        self._answered |= bool(self._sent_ns) and _newest_ns(self.ring) >= self._sent_ns
        map_from_camera = np.linalg.inv(self.odom_from_map(self.seconds)).dot(level(*self._pose)).dot(BASE_FROM_CAMERA)
        people_m = np.asarray(self.people(self.seconds)).reshape(-1, 2)
        centers_m = transform_points(np.linalg.inv(map_from_camera), np.c_[people_m, np.full(len(people_m), 0.85)])
        self._boxes_pub.publish(boxes(self.now_ns, CAMERA, [tuple(center_m) for center_m in centers_m
                                                            if center_m[2] > 0.5]))
        self._sent_ns = self.now_ns


def _newest_ns(recorder):
    messages = recorder.messages
    return messages[-1].header.stamp.to_nsec() if messages else 0


LETHAL, STANDING_MPS = 100, 0.01
STOP_S = 1.2  # after a fault the robot must stand: 0.5 s until move_base notices it, braking, and steps of 0.1 s
STARTING_S = 30.0  # for a killed node to be back
STANDING = np.array([[6.0, 1.8], [5.0, -2.0]])
CORNERS = np.array([[9.0, 0.0], [9.0, 9.0], [0.0, 9.0], [0.0, 0.0]])
NEAR_M = 2.5  # from a corner, at which the robot gets the next one as its goal
UNDISTURBED_S = float(os.environ.get('ROS_3D_BB_DRIVE_S', 5))


def two_people(seconds):
    """One stands; the other walks to and fro across the view, at up to 1.2 m/s."""
    return np.array([[6.0, 3.0], [4.0, 2.0 * np.sin(0.6 * seconds)]])


@pytest.fixture(scope='module')
def robot(request):
    """The robot without people around it; the nodes run. The parameter is the local planner, by default dwa."""
    def are_ready():
        driven.advance(0.1, is_driven=False)
        return (driven.costmap.messages and driven.social.messages and driven.tracks.messages
                and driven.goal.get_num_connections())
    with running(['roslaunch', os.path.join(ROOT, 'test', 'support', 'social_costmap.launch'),
                  'local_planner:=' + getattr(request, 'param', 'dwa')], env=planner_environment()):
        driven = DrivenRobot()
        driven.social = Recorder('social_costmap/costmap/costmap', OccupancyGrid, publisher_expected=False)
        driven.goal = rospy.Publisher('move_base_simple/goal', PoseStamped, queue_size=1)
        wait_until(are_ready, 'all nodes', 120.0)
        yield driven


@pytest.fixture
def drives(robot):
    """The robot drives towards a goal far ahead, beside two people."""
    robot.people, robot.sees = lambda _seconds: STANDING + [robot.place_m[0], 0], True
    robot.is_faulty = False
    send_goal(robot, [robot.place_m[0] + 9.0, 0.0])
    until(robot, lambda: robot.velocity > 0.2, 20.0)
    return robot


def send_goal(robot, place_m):
    goal = PoseStamped(header=header_at(robot.now_ns, 'map'))
    goal.pose.position.x, goal.pose.position.y = place_m
    goal.pose.orientation.w = 1.0
    robot.goal.publish(goal)


def until(robot, condition, limit_s):
    """Let time pass until a condition is true; returns how long it took."""
    started_s = robot.seconds
    while not condition():
        robot.advance(0.1)
        assert robot.seconds - started_s < limit_s, 'not after %g s' % limit_s
    return robot.seconds - started_s


def cost_at(robot, costmap, people_m, radius_m=0.0):
    """Largest costs within a radius of places of the map, in a costmap of odom."""
    seconds = costmap.header.stamp.to_sec() - 1000
    inside_m = transform_points(robot.odom_from_map(seconds), np.c_[people_m, np.zeros(len(people_m))])[:, :2]
    origin = costmap.info.origin.position
    grid = np.array(costmap.data).reshape(costmap.info.height, costmap.info.width)
    cells = np.floor((inside_m - [origin.x, origin.y]) / costmap.info.resolution).astype(int)
    around = int(radius_m / costmap.info.resolution)
    return [int(grid[max(row - around, 0):row + around + 1, max(column - around, 0):column + around + 1].max())
            for column, row in cells]


def test_people_are_in_both_costmaps_without_a_gap_and_leave_no_trail(robot):
    """As a soft cost of the social layer, and lethal in the local one where the camera sees them. Tracks are in the
    map, costmaps in odom, and tf is published at 10 Hz."""
    robot.people = two_people
    robot.advance(3.0, is_driven=False)
    robot.social.emptied()
    robot.costmap.emptied()
    robot.advance(6.0, is_driven=False)
    soft, lethal = (np.array([cost_at(robot, costmap, two_people(costmap.header.stamp.to_sec() - 1000)[shown], radius_m)
                              for costmap in recorder.messages])
                    for recorder, shown, radius_m in ((robot.social, [0, 1], 0.3), (robot.costmap, [1], 0.0)))
    assert len(soft) >= 15 and (soft > 0).all() and soft.max() < LETHAL, soft
    assert len(lethal) >= 15 and (lethal == LETHAL).mean() >= 0.95, lethal
    robot.people = lambda _seconds: np.zeros((0, 2))
    robot.advance(1.5, is_driven=False)  # as long as a missed person is published, and a cycle
    assert max(robot.costmap.messages[-1].data) < LETHAL


@pytest.mark.parametrize('people_m', [np.zeros((0, 2)), STANDING])
def test_the_robot_does_not_stop_without_a_fault(drives, people_m):
    """It drives around a square for ROS_3D_BB_DRIVE_S seconds."""
    origin_m = np.array([drives.place_m[0], 0.0])
    corners = itertools.cycle(origin_m + CORNERS)
    corner_m = next(corners)
    drives.people = lambda _seconds: people_m + origin_m
    for _step in range(int(10 * UNDISTURBED_S)):
        drives.advance(0.1)
        assert drives.velocity > STANDING_MPS
        if np.linalg.norm(drives.place_m - corner_m) < NEAR_M:
            corner_m = next(corners)
            send_goal(drives, corner_m)


def test_the_robot_stops_when_the_camera_stops_and_drives_on(drives):
    drives.sees = False
    assert until(drives, lambda: drives.velocity < STANDING_MPS, 5.0) <= STOP_S
    for _step in range(25):  # also when the outputs have been emptied
        drives.advance(0.1)
        assert drives.velocity < STANDING_MPS
    drives.sees = True
    until(drives, lambda: drives.velocity > 0.1, STARTING_S)


@pytest.mark.parametrize('node, number', [('tracker_node', signal.SIGKILL), ('planner_bridge_node', signal.SIGTERM),
                                          ('planner_bridge_node', signal.SIGKILL)])
def test_the_robot_stops_when_a_node_ends_and_drives_on_when_it_is_back(drives, node, number):
    pid = pid_of(node)
    drives.is_faulty = True
    os.kill(pid, number)
    assert until(drives, lambda: drives.velocity < STANDING_MPS, 5.0) <= STOP_S
    drives.is_faulty = False
    until(drives, lambda: pid_of(node) not in (None, pid), STARTING_S)
    until(drives, lambda: drives.velocity > 0.1, STARTING_S)


@pytest.mark.parametrize('robot', ['teb'], indirect=True)
def test_teb_drives_past_people_and_stops_when_the_camera_stops(drives):
    obstacles = Recorder('planner_bridge_node/obstacles', message_class('costmap_converter/ObstacleArrayMsg'))
    person_m, nearest_m = drives.place_m + [4.0, 0.1], 10.0  # in the way
    drives.people = lambda _seconds: person_m[None]

    def has_passed():
        nonlocal nearest_m
        nearest_m = min(nearest_m, float(np.linalg.norm(person_m - drives.place_m)))
        return drives.place_m[0] > person_m[0] + 0.5

    until(drives, has_passed, 20.0)
    assert any(len(message.obstacles) == 1 for message in obstacles.messages) and 0.5 < nearest_m < 1.5
    drives.sees = False
    assert until(drives, lambda: drives.velocity < STANDING_MPS, 5.0) <= STOP_S
