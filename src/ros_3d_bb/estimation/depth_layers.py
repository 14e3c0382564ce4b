"""Segmentation of the depths in a 2D box: the depth layer of the person and its edges.

Depths are in metres. In `sorted_depths_m` (nearest first), a layer is a slice and its median an element.
"""
import numpy as np

# Half the depth extent of a person with stretched arms; points farther from the median are not part of the person.
BODY_HALF_DEPTH_M = 0.35
TRUNK_HALF_DEPTH_M = 0.25  # without arms and legs: a wall close behind must not shift the median
BIN_M, LAYER_BINS = 0.05, 5  # bin width of the depth histogram, and thickness of a layer in bins
MEDIANS = 3  # maximum number of iterations of the median of the trunk
FIRST_LAYER_SHARE = 0.5  # the nearest layer with at least this share of the largest layer weight is the person
EDGE_PERCENT = 5  # percentage of the layer's pixels ignored at the left and at the right: arms, flying pixels


def nearest_dominant_layer(depths_m, weights, sorted_depths_m):
    """Depth of the trunk of the person: the median of the nearest dominant layer of the weighted depth histogram.

    Parameters
    ----------
    depths_m, weights : numpy.ndarray, (n,)
    sorted_depths_m : numpy.ndarray, (n,)
        The same depths, nearest first.

    Returns
    -------
    float
        Metres.
    """
    bins = ((depths_m - sorted_depths_m[0]) / BIN_M).astype(int)
    histogram = np.convolve(np.bincount(bins, weights), np.ones(LAYER_BINS), 'same')
    first = np.argmax(histogram >= FIRST_LAYER_SHARE * histogram.max())
    best = first + np.argmax(histogram[first:first + LAYER_BINS])
    nearest, farthest = ((sorted_depths_m - sorted_depths_m[0]) / BIN_M).searchsorted(
        (best - LAYER_BINS // 2, best + LAYER_BINS // 2 + 1))
    median_m = _median(sorted_depths_m[nearest:farthest])
    for _ in range(MEDIANS):
        before_m, median_m = median_m, _median(within(sorted_depths_m, median_m, TRUNK_HALF_DEPTH_M))
        if median_m == before_m:
            break
    return median_m


def within(sorted_depths_m, middle_m, half_m):
    """The slice of the sorted depths within `half_m` of `middle_m`."""
    offsets_m = sorted_depths_m - middle_m
    return sorted_depths_m[offsets_m.searchsorted(-half_m):offsets_m.searchsorted(half_m, 'right')]


def edges(x_m):
    """Left and right edge of a body with points at x (n,), metres, under the assumption of a uniform width."""
    last = len(x_m) - 1
    rank, part = divmod(last * EDGE_PERCENT, 100)
    after = min(rank + 1, last)
    in_place_m = np.partition(x_m, (rank, after, last - after, last - rank))
    low_m = in_place_m[rank] + (in_place_m[after] - in_place_m[rank]) * part / 100.0
    high_m = in_place_m[last - rank] - (in_place_m[last - rank] - in_place_m[last - after]) * part / 100.0
    beyond_m = (high_m - low_m) * EDGE_PERCENT / (100.0 - 2 * EDGE_PERCENT)
    return low_m - beyond_m, high_m + beyond_m


def trimmed_mean(sorted_depths_m):
    """Mean without the lowest and the highest tenth; finer than the median, which is limited to the depth resolution.
    """
    tenth = len(sorted_depths_m) // 10
    return sorted_depths_m[tenth:len(sorted_depths_m) - tenth].mean()


def complete_truncated_extent(low, high, cut_low, cut_high, usual):
    """Extend low..high of a body that the image border truncates at one end to at least the usual extent."""
    missing = max(0.0, usual - (high - low))
    if cut_low and not cut_high:
        return low - missing, high
    return low, high + (missing if cut_high and not cut_low else 0.0)


def _median(sorted_depths_m):
    last = len(sorted_depths_m) - 1
    return (sorted_depths_m[last // 2] + sorted_depths_m[last - last // 2]) / 2
