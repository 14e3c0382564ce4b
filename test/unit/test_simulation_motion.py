"""Motion of people and of the robot: agreement with the moves, and smoothness."""
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ros_3d_bb_lab.simulation.motion import person_motion, robot_motion
from ros_3d_bb_lab.simulation.scenario import Follow, Move, Person, Robot

HEIGHT_M, LONG_S = 1.75, 60.0
TINY_S = 1e-5
points = st.tuples(st.floats(-4, 4), st.floats(-4, 4)).map(lambda point: (round(point[0], 2), round(point[1], 2)))
moves = st.lists(st.one_of(
    st.builds(lambda to, speed: Move(to=to, speed=speed), points, st.floats(.3, 2)),
    st.builds(lambda turn, rate: Move(turn=turn, rate=rate), st.floats(-6, 6), st.floats(.3, 2)),
    st.builds(lambda wait, facing, crouch: Move(wait=wait, facing=facing, crouch=crouch), st.floats(.1, 3),
              st.one_of(st.none(), st.floats(-6, 6)), st.floats(0, 1))), max_size=5).map(tuple)
times = st.floats(-1, 40)


def walker(*person_moves, **others):
    start = others.pop('start', (0.0, 0.0))
    return person_motion(Person(start, moves=person_moves, **others), HEIGHT_M, LONG_S)


def speed_of(state):
    return np.linalg.norm(state.velocity_mps)


def angle_between(a, b):
    return abs((a - b + np.pi) % (2 * np.pi) - np.pi)


@given(points, moves, times)
@settings(max_examples=100)
def test_velocity_is_the_derivative_of_position(start, person_moves, time_s):
    motion = walker(*person_moves, start=start)
    before, state, after = (motion.at(time_s + shift) for shift in (-TINY_S, 0, TINY_S))
    np.testing.assert_allclose((after.position_m - before.position_m) / (2 * TINY_S), state.velocity_mps, atol=1e-3)


def test_a_following_robot_faces_the_person_and_keeps_its_distance():
    person = walker(Move(to=(8.0, 0.0), speed=.8), Move(to=(8.0, 6.0), speed=.8), start=(2.0, 0.0))
    robot = Robot((-1.0, -1.0, 3.0), follow=Follow(1, distance=2.0, speed=1.2, rate=1.0))
    motion = robot_motion(robot, [person], LONG_S)
    times_s = np.arange(0, 25, .1)
    robots = [motion.at(time_s) for time_s in times_s]
    offsets_m = np.array([person.at(time_s).position_m for time_s in times_s]) - [robot.position_m for robot in robots]
    distances_m = np.linalg.norm(offsets_m, axis=1)
    assert distances_m.min() > 1.9 and distances_m[-1] == pytest.approx(2, abs=.01)
    assert distances_m[100:].max() < 2.4  # while the person walks: lag of some cm per m/s, and the bend

    headings = np.array([robot.heading_rad for robot in robots])
    angles = angle_between(headings, np.arctan2(offsets_m[:, 1], offsets_m[:, 0]))
    assert angles[0] > 1 and angles[40:].max() < .1 and angles[-1] < .01
    assert np.abs(np.diff(headings)).max() <= 1.0 * .1 + 1e-9

    speeds_mps = [speed_of(robot) for robot in robots]
    assert max(speeds_mps[:7]) == 0 < speeds_mps[20]  # it does not drive while it faces away
    assert max(speeds_mps) <= 1.2 + 1e-9
