"""ROS interface of the simulated robot, without a master: commands, odometry, transforms and collisions."""
import numpy as np
import pytest
from geometry_msgs.msg import Twist, Vector3

from ros_3d_bb.conversions.perception_msgs import time_from
from ros_3d_bb.core.event_counter import EventCounter
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb_lab.simulation.ros.driven_robot import DrivenRobot, robot_transforms
from ros_3d_bb_lab.simulation.scenario import scenario_from
from ros_3d_bb_lab.simulation.simulator import STEP_S, Simulator
from support.masterless import masterless

START_NS = 1600000000 * NS
SCENE = {'duration': 4.0, 'people': [{'start': [2.5, 0.0]}],
         'robot': {'pose': [0.0, 0.2, 0.0], 'drive': {'odometry_error': [0.05, 0.0]},
                   'cameras': [{'name': 'front'}, {'name': 'rear', 'yaw': 3.14}]}}


class Counter(EventCounter):
    """Diagnostics that keep the warnings."""

    def __init__(self):
        super(Counter, self).__init__()
        self.warnings = []

    def warn(self, event, sentence):
        self.count(event)
        self.warnings.append(sentence)


@pytest.fixture
def robot():
    """A DrivenRobot, its simulator, its diagnostics and its connections."""
    simulator, counter = Simulator(scenario_from(SCENE)), Counter()
    with masterless() as connections:
        yield DrivenRobot(simulator, counter), simulator, counter, connections


def played(robot, connections, until_s, linear_mps):
    """Newest odometry, clearance and number of collisions of a round in which a command is repeated every 0.1 s."""
    world = robot.restarted()
    for step in range(int(round(until_s / STEP_S)) + 1):
        if step % 10 == 0:
            connections.send('cmd_vel', Twist(linear=Vector3(x=linear_mps)))
        robot.publish(world.state_at(step * STEP_S), time_from(START_NS + int(round(step * STEP_S * NS))))
    return [connections.publishers[topic].newest for topic in ('odom', 'clearance', 'collisions')]


def test_odometry_has_the_time_frames_and_errors_of_the_robot(robot):
    driven, _simulator, _counter, connections = robot
    odometry, clearance, collisions = played(driven, connections, 2.0, 0.5)
    assert odometry.header.stamp == time_from(START_NS + 2 * NS)
    assert (odometry.header.frame_id, odometry.child_frame_id) == ('odom', 'base_link')
    true_m = 0.5 * 2 - 0.5 * 0.25 / 2 + 0.5 * STEP_S / 2  # it accelerates for 0.25 s, in steps
    position = odometry.pose.pose.position
    assert (position.x, position.y) == pytest.approx((1.05 * true_m, 0.2), abs=1e-3)
    assert odometry.twist.twist.linear.x == pytest.approx(0.525)
    assert (clearance.data > 1.0, collisions.data) == (True, 0)


def test_collisions_are_counted_from_the_start_of_each_round(robot):
    driven, _simulator, counter, connections = robot
    for _round in range(2):
        _odometry, clearance, collisions = played(driven, connections, 3.5, 1.0)
        assert collisions.data == 1 and clearance.data == pytest.approx(0, abs=0.02)
    assert counter.counts['collisions'] == 2
    assert connections.publishers['collisions'].count == 4


def test_commands_that_are_not_finite_are_ignored(robot):
    driven, _simulator, counter, connections = robot
    odometry, _clearance, _collisions = played(driven, connections, 1.0, float('nan'))
    assert odometry.twist.twist.linear.x == 0
    assert counter.counts['invalid commands'] == 11 and 'nan' in counter.warnings[0]


def test_transforms_lead_from_the_map_to_every_camera(robot):
    _driven, simulator, _counter, _connections = robot
    state = simulator.state_at(1.0)
    links = robot_transforms(simulator, state, time_from(START_NS)).transforms
    assert [(link.header.frame_id, link.child_frame_id) for link in links] == [
        ('map', 'odom'), ('odom', 'base_link'), ('base_link', 'front_color_optical_frame'),
        ('base_link', 'rear_color_optical_frame')]
    for index in range(2):
        translation = links[2 + index].transform.translation
        np.testing.assert_allclose((translation.x, translation.y, translation.z),
                                   simulator.poses(state, index).base_from_camera[:3, 3])


@pytest.mark.parametrize('duration, rate, count', [(1.0, 10.0, 101), (1.0, 15.0, 101 + 10), (0.055, 1.0, 6)])
def test_steps_are_every_10_ms_and_at_all_images(duration, rate, count):
    simulator = Simulator(scenario_from({'duration': duration, 'rate': rate}))
    times_s, numbers = zip(*simulator.steps())
    assert len(times_s) == count and list(times_s) == sorted(times_s)
    assert [number for number in numbers if number is not None] == list(range(simulator.frame_count))
    for time_s, number in simulator.steps():
        assert number is None or time_s == simulator.time_s(number)
    assert max(np.diff(times_s)) <= STEP_S + 1e-9
