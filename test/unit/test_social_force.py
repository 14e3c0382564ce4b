"""Social force model: forces are gradients of the potentials in the paper, and people pass each other."""
import numpy as np
import pytest

from ros_3d_bb_lab.simulation.social_force import driving_force, next_velocity, social_force

NO_OTHERS = np.zeros((0, 2))


def test_the_desired_velocity_is_reached_within_two_seconds():
    velocity, desired = np.zeros(2), np.array([1.0, -.5])
    for _step in range(200):
        velocity = next_velocity(velocity, driving_force(velocity, desired), .01)
    np.testing.assert_allclose(velocity, desired, rtol=.02)


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
