"""Differential drive and contact of the simulated robot: limits, and distances of rectangles."""
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ros_3d_bb_lab.simulation.collision import Rectangle
from ros_3d_bb_lab.simulation.driven_world import limited_velocity
from ros_3d_bb_lab.simulation.scenario import Drive

DRIVE = Drive(speed=1.0, rate=2.0, acceleration=0.5, angular_acceleration=4.0)
coordinates = st.floats(-3, 3)
rectangles = st.builds(lambda x, y, yaw, length, width: Rectangle((x, y), yaw, (length, width)), coordinates,
                       coordinates, st.floats(-4, 4), st.floats(.1, 2), st.floats(.1, 2))


@pytest.mark.parametrize('wanted, after_1_s, at_last', [
    ((.3, .5), (.3, .5), (.3, .5)), ((5, -9), (.5, -2), (1, -2)), ((-5, 9), (-.5, 2), (-1, 2))])
def test_velocity_approaches_the_wanted_one_within_the_limits(wanted, after_1_s, at_last):
    velocity, velocities = np.zeros(2), []
    for _step in range(400):
        velocities.append(velocity)
        velocity = limited_velocity(velocity, wanted, DRIVE, .01)
    velocities = np.array(velocities)
    np.testing.assert_allclose(velocities[100], after_1_s)
    np.testing.assert_allclose(velocity, at_last)
    assert (np.abs(np.diff(velocities, axis=0)) <= np.array([.5, 4]) * .01 + 1e-12).all()


@given(rectangles, coordinates, coordinates)
@settings(max_examples=100)
def test_the_distance_of_a_point_is_that_to_the_nearest_point(rectangle, x, y):
    distance_m, = rectangle.signed_distances_m(np.array([(x, y)]))
    nearest = rectangle.nearest_point((x, y))
    assert max(distance_m, 0) == pytest.approx(np.hypot(*(nearest - (x, y))), abs=1e-9)
    assert rectangle.signed_distances_m(nearest[None])[0] <= 1e-9
