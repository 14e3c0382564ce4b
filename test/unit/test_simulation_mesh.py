"""Meshes: closed, wound outwards, and of the right volume."""
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ros_3d_bb_lab.simulation.mesh import CELL_M, box, loft, vertex_normals, volume

metres = st.floats(.05, 3)
positions = st.tuples(*[st.floats(-5, 5)] * 3)
angles = st.floats(-7, 7)


def tube(length, depth, width, exponent=2.0, sides=64, rings=3):
    """Straight tube along z with half axes `depth` (x) and `width` (y)."""
    z, zero = np.linspace(0, length, rings), np.zeros(rings)
    return loft(np.c_[zero, zero, z], [(depth, width)] * rings, exponent, sides)


def crate(size=(1, 2, 3)):
    return box(size, (10, 20, 30), np.random.RandomState(0))


@given(metres, metres, metres)
@settings(max_examples=30)
def test_an_elliptic_tube_has_the_volume_of_its_inscribed_polygon(length, depth, width):
    vertices, faces = tube(length, depth, width)
    area = depth * width * 64 / 2 * np.sin(2 * np.pi / 64)
    assert volume(vertices, faces) == pytest.approx(area * length, rel=1e-9)
    assert area == pytest.approx(np.pi * depth * width, rel=.002)


def test_the_cross_section_approaches_a_rectangle_with_growing_exponent():
    volumes = [volume(*tube(1.0, .5, .5, exponent, 64)) for exponent in (2, 3, 6, 50)]
    assert (np.diff(volumes) > 0).all() and volumes[0] < np.pi / 4 and .9 < volumes[-1] <= 1


def test_normals_of_a_tube_point_away_from_its_axis():
    vertices, faces = tube(1.0, .4, .4, rings=5)
    normals = vertex_normals(vertices, faces)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-9)
    wall = (vertices[:, 2] > .1) & (vertices[:, 2] < .9)
    np.testing.assert_allclose(normals[wall], vertices[wall] * (2.5, 2.5, 0), atol=1e-9)


@given(st.tuples(metres, metres, metres))
@settings(max_examples=30)
def test_a_box_has_its_size_and_stands_on_the_floor(size):
    mesh = crate(size)
    np.testing.assert_allclose(mesh.vertices.min(axis=0), (-size[0] / 2, -size[1] / 2, 0), atol=1e-6)
    np.testing.assert_allclose(mesh.vertices.max(axis=0), (size[0] / 2, size[1] / 2, size[2]), atol=1e-6)
    assert volume(mesh.vertices.astype(float), mesh.faces) == pytest.approx(np.prod(size), rel=1e-5)


@given(st.tuples(metres, metres, metres))
@settings(max_examples=20)
def test_faces_of_a_box_are_small_and_agree_with_their_normals(size):
    mesh = crate(size)
    corners = mesh.vertices[mesh.faces]
    assert np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max() <= CELL_M + 1e-6
    across = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    normals = mesh.normals[mesh.faces[:, 0]]
    np.testing.assert_allclose(across / np.linalg.norm(across, axis=1, keepdims=True), normals, atol=1e-4)
    assert (((corners.mean(axis=1) - (0, 0, size[2] / 2)) * normals).sum(axis=1) > 0).all()


@given(positions, angles)
@settings(max_examples=30)
def test_moved_rotates_counter_clockwise_and_translates(position, heading):
    mesh = crate()
    moved = mesh.moved(position, heading)
    c, s = np.cos(heading), np.sin(heading)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    np.testing.assert_allclose(moved.vertices, mesh.vertices.dot(turn.T) + position, atol=1e-5)
    np.testing.assert_allclose(moved.normals, mesh.normals.dot(turn.T), atol=1e-6)
    assert moved.vertices.dtype == moved.normals.dtype == np.float32
