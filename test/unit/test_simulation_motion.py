"""Smooth motion of people."""
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from ros_3d_bb_lab.simulation.motion import person_motion
from ros_3d_bb_lab.simulation.scenario import Move, Person

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


@given(points, moves, times)
@settings(max_examples=100)
def test_velocity_is_the_derivative_of_position(start, person_moves, time_s):
    motion = walker(*person_moves, start=start)
    before, state, after = (motion.at(time_s + shift) for shift in (-TINY_S, 0, TINY_S))
    np.testing.assert_allclose((after.position_m - before.position_m) / (2 * TINY_S), state.velocity_mps, atol=1e-3)
