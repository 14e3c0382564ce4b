"""Depth layers: ranks, medians, means and edges of sorted distances, and the nearest dominant layer."""
import numpy as np
from hypothesis import given, strategies as st
from hypothesis.extra import numpy as hnp

from ros_3d_bb.estimation.depth_layers import (EDGE_PERCENT, UNKNOWN_MM, SortedDistances, edges, millimetres,
                                               nearest_dominant_layers)

ROWS = hnp.arrays(np.uint16, st.tuples(st.integers(1, 5), st.integers(1, 60)), elements=st.integers(0, 9000))


def known(row):
    return np.sort(row[row != UNKNOWN_MM]).astype(float)


@given(ROWS, st.integers(0, 9000), st.integers(0, 65535))
def test_ranks_medians_and_means_are_those_of_each_row(rows_mm, limit_mm, half_mm):
    ordered, limits_mm = SortedDistances(rows_mm), np.full(len(rows_mm), limit_mm)
    np.testing.assert_array_equal(ordered.ranks(limits_mm), (rows_mm < limit_mm).sum(axis=1))
    first, end = ordered.within(limits_mm, half_mm)
    for row, begin, after in zip(rows_mm, first, end):
        inside_mm = known(row)[np.abs(known(row) - limit_mm) <= half_mm]
        assert after - begin == len(inside_mm)
        np.testing.assert_array_equal(np.sort(row)[begin:after], inside_mm)
    count = ordered.count
    np.testing.assert_array_equal(ordered.medians(0 * count, count), np.floor(np.median(rows_mm, axis=1)))
    np.testing.assert_allclose(ordered.means(0 * count, count), rows_mm.mean(axis=1))


@given(ROWS)
def test_edges_are_extrapolated_percentiles(rows_mm):
    low_mm, high_mm = np.percentile(rows_mm, [EDGE_PERCENT, 100 - EDGE_PERCENT], axis=1)
    beyond_mm = (high_mm - low_mm) * EDGE_PERCENT / (100.0 - 2 * EDGE_PERCENT)
    np.testing.assert_allclose(edges(SortedDistances(rows_mm)), (low_mm - beyond_mm, high_mm + beyond_mm), atol=1e-6)


def test_edges_of_a_uniform_body():
    row_mm = np.random.RandomState(0).permutation(np.linspace(31700, 32200, 1001)).astype(np.uint16)
    np.testing.assert_allclose(edges(SortedDistances(row_mm[None])), [[31700], [32200]], atol=0.5)


def test_unknown_distances_are_not_counted():
    row_mm = millimetres(np.array([[2.0, np.nan, 1.9996, 3.0]]), np.array([[True, False, True, False]]))
    assert row_mm.tolist() == [[2000, UNKNOWN_MM, 2000, UNKNOWN_MM]]
    ordered = SortedDistances(row_mm)
    assert ordered.count.tolist() == [2]
    assert nearest_dominant_layers(row_mm, np.ones((1, 4)), ordered).tolist() == [2000]


def test_unknown_distances_are_no_layer_beside_a_box_with_a_larger_range():
    rows_mm = np.array([[500, 64000, 64000, 64000], [2000, UNKNOWN_MM, UNKNOWN_MM, UNKNOWN_MM]], np.uint16)
    layers_mm = nearest_dominant_layers(rows_mm, np.ones((2, 4)), SortedDistances(rows_mm))
    assert layers_mm.tolist() == [64000, 2000]


@given(ROWS, st.integers(0, 100))
def test_layers_are_in_the_range_of_the_distances_in_any_order(rows_mm, seed):
    even = np.ones(rows_mm.shape)
    layers_mm = nearest_dominant_layers(rows_mm, even, SortedDistances(rows_mm))
    assert (rows_mm.min(axis=1) <= layers_mm).all() and (layers_mm <= rows_mm.max(axis=1)).all()
    shuffled_mm = rows_mm[:, np.random.RandomState(seed).permutation(rows_mm.shape[1])]
    np.testing.assert_array_equal(nearest_dominant_layers(shuffled_mm, even, SortedDistances(shuffled_mm)), layers_mm)


def test_the_nearest_dominant_layer_is_the_person():
    rows_mm = np.array([[900] * 5 + [2000] * 30 + [4000] * 50] * 2, np.uint16)  # a few flying pixels, a person, a wall
    weights = np.ones(rows_mm.shape)
    weights[1, rows_mm[1] == 2000] = 0.1
    assert nearest_dominant_layers(rows_mm, weights, SortedDistances(rows_mm)).tolist() == [2000, 4000]
