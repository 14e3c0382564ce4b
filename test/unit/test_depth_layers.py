"""The layer of a person among depths: the same as by definition, whatever the depths."""
import numpy as np
from hypothesis import given, strategies as st
from hypothesis.extra import numpy as hnp

from ros_3d_bb.estimation.depth_layers import (EDGE_PERCENT, complete_truncated_extent, edges, nearest_dominant_layer,
                                               trimmed_mean, within)

METRES = st.floats(0.3, 9.0)
MILLIMETRES = hnp.arrays(int, st.integers(1, 60), elements=st.integers(300, 9000))


@given(hnp.arrays(float, st.integers(1, 50), elements=st.floats(-5, 5)))
def test_edges_are_where_percentiles_say(x_m):
    low_m, high_m = np.percentile(x_m, [EDGE_PERCENT, 100 - EDGE_PERCENT])
    beyond_m = (high_m - low_m) * EDGE_PERCENT / (100.0 - 2 * EDGE_PERCENT)
    np.testing.assert_allclose(edges(x_m), (low_m - beyond_m, high_m + beyond_m), atol=1e-9)


def test_edges_of_an_even_body_are_its_own():
    np.testing.assert_allclose(edges(np.random.RandomState(0).permutation(np.linspace(-0.3, 0.2, 1001))), (-0.3, 0.2),
                               atol=1e-9)


@given(MILLIMETRES, st.integers(0, 9000), st.integers(0, 500))
def test_within_holds_its_bounds_as_the_rounded_difference_does(depths_mm, middle_mm, half_mm):
    depths_m, middle_m, half_m = np.sort(depths_mm) * 0.001, middle_mm * 0.001, half_mm * 0.001
    expected_m = depths_m[np.abs(depths_m - middle_m) <= half_m]
    np.testing.assert_array_equal(within(depths_m, middle_m, half_m), expected_m)


@given(hnp.arrays(float, st.integers(1, 60), elements=METRES))
def test_the_trimmed_mean_looks_past_a_tenth_on_both_sides(depths_m):
    sorted_depths_m, tenth = np.sort(depths_m), len(depths_m) // 10
    spoilt_m = sorted_depths_m.copy()
    spoilt_m[:tenth], spoilt_m[len(spoilt_m) - tenth:] = 0, 100
    assert trimmed_mean(sorted_depths_m) == trimmed_mean(spoilt_m)
    assert sorted_depths_m[0] - 1e-9 <= trimmed_mean(sorted_depths_m) <= sorted_depths_m[-1] + 1e-9


@given(MILLIMETRES, st.integers(0, 100))
def test_the_layer_is_among_the_depths_in_whatever_order_they_come(depths_mm, seed):
    depths_m = depths_mm * 0.001
    sorted_depths_m, even = np.sort(depths_m), np.ones(len(depths_m))
    layer_m = nearest_dominant_layer(depths_m, even, sorted_depths_m)
    assert sorted_depths_m[0] <= layer_m <= sorted_depths_m[-1]
    assert layer_m == nearest_dominant_layer(np.random.RandomState(seed).permutation(depths_m), even, sorted_depths_m)


def test_the_nearest_strong_layer_is_the_person():
    depths_m = np.array([0.9] * 5 + [2.0] * 30 + [4.0] * 50)  # a few flying pixels, a person, a wall
    assert nearest_dominant_layer(depths_m, np.ones(85), depths_m) == 2.0
    assert nearest_dominant_layer(depths_m, np.where(depths_m == 2.0, 0.1, 1.0), depths_m) == 4.0


def test_a_cut_body_is_whole_on_the_side_that_is_cut():
    np.testing.assert_allclose(complete_truncated_extent(-0.1, 0.2, True, False, 0.5), (-0.3, 0.2))
    np.testing.assert_allclose(complete_truncated_extent(-0.1, 0.2, False, True, 0.5), (-0.1, 0.4))
    assert complete_truncated_extent(-0.1, 0.2, False, False, 0.5) == complete_truncated_extent(-0.1, 0.2, True, True,
                                                                                                0.5) == (-0.1, 0.2)
    assert complete_truncated_extent(-0.5, 0.5, True, False, 0.5) == (-0.5, 0.5)
