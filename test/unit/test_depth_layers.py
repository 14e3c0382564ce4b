"""Depth layers: the nearest dominant one and its ranks and means, and the edges of a body."""
import numpy as np
from hypothesis import given, strategies as st
from hypothesis.extra import numpy as hnp

from ros_3d_bb.estimation.depth_samples import (BODY_HALF_DEPTH_MM, EDGE_PERCENT, UNKNOWN_MM, edges,
                                                nearest_dominant_layer)

DISTANCES = hnp.arrays(np.uint16, st.integers(1, 60), elements=st.integers(0, 9000))
NEAR_OR_FAR = hnp.arrays(np.uint16, st.integers(1, 60), elements=st.one_of(
    st.integers(0, 400), st.integers(64000, 65000), st.just(UNKNOWN_MM)))


def even(distances_mm):
    return np.ones(len(distances_mm))


@given(st.one_of(DISTANCES, NEAR_OR_FAR))
def test_ranks_and_means_of_a_layer_are_those_of_the_sorted_distances(distances_mm):
    layer = nearest_dominant_layer(distances_mm, even(distances_mm))
    if layer is None:
        assert (distances_mm == UNKNOWN_MM).all()
        return
    known_mm = distances_mm[distances_mm != UNKNOWN_MM].astype(int)
    body_mm = np.sort(known_mm[np.abs(known_mm - layer.trunk_mm) <= BODY_HALF_DEPTH_MM])
    assert layer.end - layer.first == len(body_mm)
    for rank in range(len(body_mm)):
        assert layer.mean_mm(layer.first + rank, layer.first + rank + 1) == body_mm[rank]
    np.testing.assert_allclose(layer.mean_mm(layer.first, layer.end), body_mm.mean())


@given(hnp.arrays(np.float32, st.integers(1, 60), elements=st.floats(-9, 9, width=32)))
def test_edges_are_extrapolated_percentiles(positions):
    low, high = np.percentile(positions.astype(float), [EDGE_PERCENT, 100 - EDGE_PERCENT])
    median = np.sort(positions)[(len(positions) - 1) // 2]
    beyond = (high - low) * EDGE_PERCENT / (100.0 - 2 * EDGE_PERCENT)
    np.testing.assert_allclose(edges(positions), (low - beyond, high + beyond, median), atol=1e-6)


def test_edges_of_a_uniform_body():
    positions = np.random.RandomState(0).permutation(np.linspace(-0.3, 0.2, 1001)).astype(np.float32)
    np.testing.assert_allclose(edges(positions), [-0.3, 0.2, -0.05], atol=0.0005)


@given(DISTANCES, st.integers(0, 100))
def test_layers_are_in_the_range_of_the_distances_in_any_order(distances_mm, seed):
    layer_mm = nearest_dominant_layer(distances_mm, even(distances_mm)).trunk_mm
    assert distances_mm.min() <= layer_mm <= distances_mm.max()
    shuffled_mm = np.random.RandomState(seed).permutation(distances_mm)
    assert nearest_dominant_layer(shuffled_mm, even(shuffled_mm)).trunk_mm == layer_mm


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
