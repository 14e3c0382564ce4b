"""Body model: feet on the floor, and the way it faces."""
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


def shoe(body, side):
    """Indices of the vertices of a shoe; `side` 1 is the left one."""
    standing = body.posed()
    used = standing.faces[(standing.colors == body.build.shoes).all(axis=1)]
    return np.array([number for number in np.unique(used) if standing.vertices[number, 1] * side > 0])


@given(postures)
@settings(max_examples=30)
def test_the_lowest_point_is_on_the_floor(body, posture):
    vertices = body.posed(posture).vertices
    assert vertices[:, 2].min() == 0
    assert vertices[:, 2].max() < body.build.height_m + .04  # walking on the toes raises the head by 3.7 cm


def test_the_body_faces_x_and_its_left_is_y(body):
    standing, walking = body.posed(), body.posed(Posture(0, 1))
    np.testing.assert_allclose(standing.vertices[:, 1].min(), -standing.vertices[:, 1].max(), atol=1e-5)
    nose = standing.vertices[standing.vertices[:, 2] > 1.6]
    assert nose[:, 0].max() > .1 and nose[:, 0].max() > -nose[:, 0].min()
    for side, ahead in ((1, True), (-1, False)):  # the left heel strikes at phase 0
        assert (walking.vertices[shoe(body, side), 0].mean() > .2) == ahead
