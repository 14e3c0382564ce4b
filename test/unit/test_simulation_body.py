"""Body model: connected joints, feet on the floor, and bodies of the requested size."""
from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ros_3d_bb_lab.simulation.body import Body, Build
from ros_3d_bb_lab.simulation.gait import BONES, JOINTS_M, PARENTS, Posture, bone_transforms
from ros_3d_bb_lab.simulation.mesh import volume

postures = st.tuples(st.floats(-3, 3), st.floats(0, 1), st.floats(0, 1)).map(lambda values: Posture(*values))
builds = st.tuples(st.floats(1.4, 2.1), st.floats(.9, 1.4), st.floats(0, 1), st.booleans(), st.booleans()).map(
    lambda values: Build(*values))


@pytest.fixture(scope='module')
def body():
    return Body(Build(), np.random.RandomState(0))


def joint(posture, bone, name):
    """Position of a joint that is attached to a bone, in a posture."""
    return bone_transforms(posture)[BONES.index(bone)].dot(np.append(JOINTS_M[name], 1))


def shoe(body, side):
    """Indices of the vertices of a shoe; `side` 1 is the left one."""
    standing = body.posed()
    used = standing.faces[(standing.colors == body.build.shoes).all(axis=1)]
    return np.array([number for number in np.unique(used) if standing.vertices[number, 1] * side > 0])


@given(postures)
@settings(max_examples=30)
def test_bones_are_connected_at_their_joints(posture):
    for bone, parent in PARENTS[1:]:
        np.testing.assert_allclose(joint(posture, bone, bone), joint(posture, parent, bone), atol=1e-12)


@given(postures)
@settings(max_examples=30)
def test_the_lowest_point_is_on_the_floor(body, posture):
    vertices = body.posed(posture).vertices
    assert vertices[:, 2].min() == 0
    assert vertices[:, 2].max() < body.build.height_m + .04  # walking on the toes raises the head by 3.7 cm


@given(builds)
@settings(max_examples=10)
def test_a_body_consists_of_closed_parts_and_has_a_realistic_volume(build):
    mesh = Body(build, np.random.RandomState(0)).posed()
    edges = Counter((a, b) for face in mesh.faces.tolist() for a, b in zip(face, face[1:] + face[:1]))
    assert set(edges.values()) == {1} and {(b, a) for a, b in edges} == set(edges)  # each belongs to two faces
    slim_litres = 85 * (build.height_m / 1.75) ** 3
    assert .8 < volume(mesh.vertices, mesh.faces) * 1000 / (slim_litres * build.girth ** 2) < 1.3


def test_the_body_faces_x_and_its_left_is_y(body):
    standing, walking = body.posed(), body.posed(Posture(0, 1))
    np.testing.assert_allclose(standing.vertices[:, 1].min(), -standing.vertices[:, 1].max(), atol=1e-5)
    nose = standing.vertices[standing.vertices[:, 2] > 1.6]
    assert nose[:, 0].max() > .1 and nose[:, 0].max() > -nose[:, 0].min()
    for side, ahead in ((1, True), (-1, False)):  # the left heel strikes at phase 0
        assert (walking.vertices[shoe(body, side), 0].mean() > .2) == ahead
