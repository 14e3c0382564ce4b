"""navigation.launch among people in simulated time, with the real move_base, costmap_2d and social layers."""
import itertools
import os
import signal
import subprocess

import numpy as np
import pytest
import rospy
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import OccupancyGrid

from ros_3d_bb.camera.camera_model import transform_points
from support.driven_robot import DrivenRobot
from support.planner_definitions import message_class
from support.processes import end, pid_of
from support.real_planners import ROOT, planner_environment
from support.ros import Recorder, header_at, wait_until

LETHAL, STANDING_MPS = 100, 0.01
STOP_S = 1.0  # after a fault the robot must stand within this time
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
    environment = planner_environment()
    nodes = subprocess.Popen(['roslaunch', os.path.join(ROOT, 'test', 'support', 'navigation.launch'),
                              'local_planner:=' + getattr(request, 'param', 'dwa')], env=environment)
    driven = DrivenRobot()
    driven.social = Recorder('social_costmap/costmap/costmap', OccupancyGrid, publisher_expected=False)
    driven.goal = rospy.Publisher('move_base_simple/goal', PoseStamped, queue_size=1)
    try:
        def are_ready():
            driven.advance(0.1, is_driven=False)
            return (driven.costmap.messages and driven.social.messages and driven.tracks.messages
                    and driven.goal.get_num_connections())
        wait_until(are_ready, 'all nodes', 120.0)
        yield driven
    finally:
        end(nodes)


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


def test_people_are_in_the_proxemic_costmap_of_another_frame_without_a_gap(robot):
    """Tracks are in the map, the costmap is in odom, and tf is published at 10 Hz."""
    robot.people = two_people
    robot.advance(1.5, is_driven=False)
    robot.social.emptied()
    robot.advance(6.0, is_driven=False)
    costs = np.array([cost_at(robot, costmap, two_people(costmap.header.stamp.to_sec() - 1000), 0.3)
                      for costmap in robot.social.messages])
    assert len(costs) >= 15 and (costs > 0).all(), costs
    assert costs.max() < LETHAL  # a soft cost


def test_visible_people_are_lethal_in_the_local_costmap_and_leave_no_trail(robot):
    robot.people = two_people
    robot.advance(1.5, is_driven=False)
    robot.costmap.emptied()
    robot.advance(6.0, is_driven=False)
    costmaps = robot.costmap.messages
    costs = np.array([cost_at(robot, costmap, two_people(costmap.header.stamp.to_sec() - 1000)[1:])
                      for costmap in costmaps])
    assert len(costs) >= 15 and (costs == LETHAL).mean() >= 0.95, costs
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


@pytest.mark.parametrize('number', [signal.SIGKILL, signal.SIGTERM])
@pytest.mark.parametrize('node', ['tracker_node', 'planner_bridge_node'])
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
