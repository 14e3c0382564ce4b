"""Body model: feet on the floor."""
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ros_3d_bb_lab.simulation.body import Body, Build
from ros_3d_bb_lab.simulation.gait import Posture

postures = st.tuples(st.floats(-3, 3), st.floats(0, 1), st.floats(0, 1)).map(lambda values: Posture(*values))


@pytest.fixture(scope='module')
def body():
    return Body(Build(), np.random.RandomState(0))


@given(postures)
@settings(max_examples=30)
def test_the_lowest_point_is_on_the_floor(body, posture):
    vertices = body.posed(posture).vertices
    assert vertices[:, 2].min() == 0
    assert vertices[:, 2].max() < body.build.height_m + .04  # walking on the toes raises the head by 3.7 cm
