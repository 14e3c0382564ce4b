"""Depth layers of people in the samples of all boxes of an image at once.

Convention: distances are whole millimetres in arrays (boxes, samples) of 16 bits, `UNKNOWN_MM` where there is none.
Sorting them takes a fraction of the time of sorting metres, as numpy sorts 16 bits by radix. A rank is a position among
the sorted distances of a box, nearest first.
"""
import numpy as np

UNKNOWN_MM = 65535
FARTHEST_LAYER_M = 65.0
# Half the depth extent of a person with stretched arms; points farther from the median are not part of the person.
BODY_HALF_DEPTH_MM = 350
TRUNK_HALF_DEPTH_MM = 250  # without arms and legs: a wall close behind must not shift the median
BIN_MM, LAYER_BINS = 50, 5  # bin width of the depth histogram, and thickness of a layer in bins
FIRST_LAYER_SHARE = 0.5  # the nearest layer with at least this share of the largest layer weight is the person
EDGE_PERCENT = 5  # percentage of the layer's pixels ignored at the left and at the right: arms, flying pixels


def millimetres(values_m, known):
    """Convert values, metres, to whole millimetres where they are known (bool); they must be in 0..65 m there."""
    return np.where(known, 1000 * values_m + 0.5, UNKNOWN_MM).astype(np.uint16)


class SortedDistances(object):
    """The distances (n, samples) of n boxes, sorted; `count` (n,) of them are known."""

    def __init__(self, distances_mm):
        boxes, samples = distances_mm.shape
        self._first = samples * np.arange(boxes)
        # All boxes in one increasing sequence, so that one search finds the ranks in all of them. Limits that are less
        # than 0 or more than `UNKNOWN_MM` are not in the range of another box.
        self._offsets_mm = 3 * UNKNOWN_MM * np.arange(boxes)
        self._keys = (np.sort(distances_mm, axis=1, kind='mergesort') + self._offsets_mm[:, None]).ravel()
        self.count = self.ranks(np.full(boxes, UNKNOWN_MM))

    def ranks(self, limits_mm):
        """Number (n,) of distances of each box that are less than its limit (n,), between +-`UNKNOWN_MM`."""
        return self._keys.searchsorted(limits_mm + self._offsets_mm) - self._first

    def at(self, ranks):
        """Distances at ranks (..., n), millimetres, with the shape of the ranks."""
        return self._keys[self._first + ranks] - self._offsets_mm

    def within(self, middles_mm, half_mm):
        """First rank of the distances within `half_mm` of `middles_mm` (n,), and the rank after the last one."""
        return self.ranks(middles_mm - half_mm), self.ranks(middles_mm + half_mm + 1)

    def medians(self, first, end):
        """Medians (n,) of the distances from the ranks `first` to before `end`, rounded down to millimetres."""
        return (self.at((first + end - 1) // 2) + self.at((first + end) // 2)) // 2

    def means(self, first, end):
        """Means (n,) of the distances from the ranks `first` to before `end`, millimetres."""
        limits = np.stack((first, end), axis=1) + self._first[:, None]
        sums = np.add.reduceat(np.append(self._keys, 0), limits.ravel())[::2]
        return sums / (end - first) - self._offsets_mm


def nearest_dominant_layers(distances_mm, weights, ordered):
    """Distance (n,) of the trunk of the person in each box, whole millimetres: the median of the nearest dominant layer
    of the weighted histogram of the distances.

    `distances_mm` and `weights` have the shape (n, samples); `ordered` are the SortedDistances, each with known ones.
    """
    nearest_mm, farthest_mm = ordered.at(0), ordered.at(ordered.count - 1)
    bins = int((farthest_mm - nearest_mm).max()) // BIN_MM + 1
    numbers = (distances_mm - nearest_mm.astype(np.uint16)[:, None]) // BIN_MM
    numbers[distances_mm == UNKNOWN_MM] = bins  # dropped below
    rows = np.arange(len(distances_mm))
    numbers = numbers + ((bins + 1) * rows)[:, None]
    histograms = np.bincount(numbers.ravel(), weights.ravel(), (bins + 1) * len(rows)).reshape(len(rows), -1)[:, :-1]
    layers = _moving_sums(histograms)
    first = np.argmax(layers >= FIRST_LAYER_SHARE * layers.max(axis=1)[:, None], axis=1)
    candidates = np.minimum(first[:, None] + np.arange(LAYER_BINS), bins - 1)
    best = first + np.argmax(layers[rows[:, None], candidates], axis=1)
    start_mm = nearest_mm + BIN_MM * (best - LAYER_BINS // 2)
    medians_mm = ordered.medians(ordered.ranks(start_mm), ordered.ranks(start_mm + BIN_MM * LAYER_BINS))
    return ordered.medians(*ordered.within(medians_mm, TRUNK_HALF_DEPTH_MM))


def _moving_sums(histograms):
    """Sums (n, bins) of `LAYER_BINS` bins around each bin of histograms (n, bins)."""
    sums = np.zeros((len(histograms), histograms.shape[1] + LAYER_BINS))
    np.cumsum(histograms, axis=1, out=sums[:, LAYER_BINS // 2 + 1:-(LAYER_BINS // 2)])
    sums[:, -(LAYER_BINS // 2):] = sums[:, -(LAYER_BINS // 2) - 1, None]
    return sums[:, LAYER_BINS:] - sums[:, :-LAYER_BINS]


def edges(ordered):
    """Lowest and highest value (2, n) of uniform distributions with these SortedDistances, millimetres: percentiles,
    extrapolated.
    """
    last = ordered.count - 1
    rank, part = np.divmod(last * EDGE_PERCENT, 100)
    after = np.minimum(rank + 1, last)
    low_mm, above_mm, below_mm, high_mm = ordered.at(np.stack((rank, after, last - after, last - rank)))
    low_mm = low_mm + (above_mm - low_mm) * part / 100.0
    high_mm = high_mm - (high_mm - below_mm) * part / 100.0
    beyond_mm = (high_mm - low_mm) * EDGE_PERCENT / (100.0 - 2 * EDGE_PERCENT)
    return low_mm - beyond_mm, high_mm + beyond_mm
