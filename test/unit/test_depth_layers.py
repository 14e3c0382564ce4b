"""Depth layers: the nearest dominant one, and the edges of a body."""
import numpy as np
from hypothesis import given, strategies as st

from ros_3d_bb.estimation.depth_samples import UNKNOWN_MM, edges, nearest_dominant_layer


def even(distances_mm):
    return np.ones(len(distances_mm))


def test_edges_of_a_uniform_body():
    positions = np.random.RandomState(0).permutation(np.linspace(-0.3, 0.2, 1001)).astype(np.float32)
    np.testing.assert_allclose(edges(positions), [-0.3, 0.2, -0.05], atol=0.0005)


def test_the_nearest_dominant_layer_is_the_person():
    distances_mm = np.array([900] * 5 + [2000] * 30 + [4000] * 50, np.uint16)  # a few flying pixels, a person, a wall
    weights = even(distances_mm)
    assert nearest_dominant_layer(distances_mm, weights).trunk_mm == 2000
    weights[distances_mm == 2000] = 0.1
    assert nearest_dominant_layer(distances_mm, weights).trunk_mm == 4000


def test_a_wall_that_fills_the_outline_is_not_the_person():
    distances_mm = np.array([6000] * 100 + [2000] * 30, np.uint16)
    weights, outline = even(distances_mm), np.arange(40)
    assert nearest_dominant_layer(distances_mm, weights).trunk_mm == 6000
    assert nearest_dominant_layer(distances_mm, weights, outline).trunk_mm == 2000
    distances_mm[5:40] = UNKNOWN_MM  # masked: what surrounds the person is not known
    assert nearest_dominant_layer(distances_mm, weights, outline).trunk_mm == 6000


@given(st.integers(65, 99))
def test_a_person_who_fills_the_outline_is_not_the_background(share):
    distances_mm = np.array([2000] * share + [6000] * (100 - share), np.uint16)
    assert nearest_dominant_layer(distances_mm, even(distances_mm), np.arange(50)).trunk_mm == 2000
