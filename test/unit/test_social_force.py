"""Social force model: forces are gradients of the potentials in the paper, and people pass each other."""
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ros_3d_bb_lab.simulation.social_force import (BORDER_POTENTIAL, BORDER_RANGE_M, MAX_SPEED_MPS,
                                                   PEDESTRIAN_POTENTIAL, PEDESTRIAN_RANGE_M, STEP_S, border_forces,
                                                   driving_force, next_velocity, pedestrian_forces, sight_weights,
                                                   social_force)

TINY_M = 1e-6
NO_OTHERS = np.zeros((0, 2))
distances = st.floats(.2, 3)
angles = st.floats(-3.2, 3.2)
speeds = st.floats(-2, 2)


def pedestrian_potential(offset, velocity):
    """Equations 4 and 5 of the paper."""
    step = velocity * STEP_S
    b = np.sqrt((np.hypot(*offset) + np.hypot(*(offset - step))) ** 2 - np.hypot(*step) ** 2) / 2
    return PEDESTRIAN_POTENTIAL * np.exp(-b / PEDESTRIAN_RANGE_M)


def border_potential(offset):
    return BORDER_POTENTIAL * np.exp(-np.hypot(*offset) / BORDER_RANGE_M)


def gradient(function, offset):
    return np.array([(function(offset + step) - function(offset - step)) / (2 * TINY_M) for step in np.eye(2) * TINY_M])


def polar(length, angle):
    return length * np.array([np.cos(angle), np.sin(angle)])


@given(distances, angles, speeds, angles)
@settings(max_examples=100)
def test_forces_are_the_negative_gradients_of_the_potentials(distance_m, angle, speed, direction):
    offset, velocity = polar(distance_m, angle), polar(speed, direction)
    step = velocity * STEP_S
    if np.hypot(*offset) + np.hypot(*(offset - step)) > np.hypot(*step) + .01:  # not between the foci
        expected = -gradient(lambda place: pedestrian_potential(place, velocity), offset)
        np.testing.assert_allclose(pedestrian_forces(offset[None], velocity[None])[0], expected, rtol=1e-3, atol=1e-6)
    np.testing.assert_allclose(border_forces(offset[None])[0], -gradient(border_potential, offset), rtol=1e-3,
                               atol=1e-6)


def test_approaching_people_repel_from_farther_away():
    standing, approaching, leaving = (np.hypot(*pedestrian_forces(np.array([[1.5, .3]]), np.array([[speed, 0.0]]))[0])
                                      for speed in (0, 1, -1))
    assert approaching > 3 * standing and leaving < approaching


def test_forces_are_finite_at_the_same_place():
    same = np.zeros((1, 2))
    for forces in (pedestrian_forces(same, same), pedestrian_forces(same, same + 1), border_forces(same)):
        assert np.isfinite(forces).all()


def test_people_behind_count_half():
    forces = np.array([[-1.0, 0], [0, -2.0], [1.0, 0], [1.0, 1.0]])  # of causes ahead, beside, behind, behind
    np.testing.assert_array_equal(sight_weights(np.array([1.0, 0]), forces), [[1], [1], [.5], [.5]])


def test_the_desired_velocity_is_reached_within_two_seconds():
    velocity, desired = np.zeros(2), np.array([1.0, -.5])
    for _step in range(200):
        velocity = next_velocity(velocity, driving_force(velocity, desired), .01)
    np.testing.assert_allclose(velocity, desired, rtol=.02)


def test_the_speed_is_limited():
    velocity = next_velocity(np.zeros(2), np.array([300.0, 400.0]), 1.0)
    np.testing.assert_allclose(velocity, np.array([.6, .8]) * MAX_SPEED_MPS)


@pytest.mark.parametrize('side', [1, -1])
def test_two_people_who_meet_pass_each_other(side):
    """Each aims at the start of the other, 8 m away; the lines are 0.1 m apart."""
    positions = np.array([[0.0, .05 * side], [8.0, -.05 * side]])
    goals, velocities, nearest_m = positions[::-1].copy(), np.array([[1.3, 0], [-1.3, 0]]), 9.0
    for _step in range(900):
        offset = positions[0] - positions[1]
        nearest_m = min(nearest_m, np.hypot(*offset))
        desired = [1.3 * (goal - place) / max(np.hypot(*(goal - place)), .5) for goal, place in zip(goals, positions)]
        forces = [social_force(velocities[one], desired[one], offset[None] * sign, velocities[[1 - one]], NO_OTHERS)
                  for one, sign in ((0, 1), (1, -1))]
        velocities = np.array([next_velocity(velocity, force, .01) for velocity, force in zip(velocities, forces)])
        positions = positions + velocities * .01
    assert nearest_m > .5
    np.testing.assert_allclose(positions, goals, atol=.2)
