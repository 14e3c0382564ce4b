"""Depth samples in a rectangle of an image, and the depth layer of the object in it; see `box3d` for the conventions.

Depth layers are layers of z in the level frame, because people stand upright there. These distances are whole
millimetres in arrays of 16 bits, `UNKNOWN_MM` without depth, without a viewing ray and where masked. A rank is a
position among the sorted distances, nearest first.
"""
import functools
from bisect import bisect_left, bisect_right
from typing import NamedTuple

import numpy as np

from ros_3d_bb.camera.images import FARTHEST_M

# Largest numbers of rows and columns; on average, two thirds of them are sampled. Measured: positions are as accurate
# as with 2000 to 8000 samples (./run bench accuracy).
GRID_ROWS, GRID_COLUMNS = 48, 32
ACROSS, AHEAD = 0, 2  # axes of the level frame
# Weights of the rows: something may stand before the legs.
UPPER_SHARE, LOWER_WEIGHT = 0.5, 0.2
UNKNOWN_MM, FARTHEST_LAYER_MM = 65535, 65000  # chosen: 16 bits hold the farthest layer and half a body behind it
LEAST_SIZE = 0.65  # of an object relative to its usual size; chosen: a hidden chair appears to have 0.6 of it
# Half the depth extents of a person with stretched arms, and of the trunk. Chosen: points farther from the trunk are
# not part of the person, and a wall close behind must not shift the median.
BODY_HALF_DEPTH_MM, TRUNK_HALF_DEPTH_MM = 350, 250
BIN_MM, LAYER_BINS = 50, 5  # of the depth histogram; chosen: a layer is as thick as a trunk
# The nearest layer with at least this share of the largest layer weight is the person. Chosen: flying pixels have less.
FIRST_LAYER_SHARE = 0.5
# What fills the outline keeps this share of its weight. Chosen: a rectangle may be smaller than its object.
LEAST_INSIDE = 0.3
FILLED = 0.4  # minimum share of a side of a rectangle that the background behind an object fills; chosen
END_PERCENT = 5  # of the samples on a body at its upper and at its lower end; chosen: the head, and the feet
EDGE_PERCENT = 5  # of the samples ignored at the left and at the right; chosen: arms, flying pixels
_EMPTY_BINS = LAYER_BINS // 2 + 1  # of the histogram before the nearest distance


class Layer(NamedTuple):
    """Depth layer of an object: the distance of its trunk, the first rank on its body and the one after the last, and
    all distances in order."""

    trunk_mm: int
    first: int
    end: int
    ordered_mm: np.ndarray


class RectSamples(object):
    """Samples of the visible part of a rectangle in the level frame, each an element of flat arrays.

    `rays` are the `level_rays`; `surrounded` states whether the left, the upper and the right edge show what surrounds
    the object. `shape` are the numbers of rows and columns, and `measured` is the number of samples with depth and a
    viewing ray, masked or not.
    """

    def __init__(self, depth, rect_px, rays, surrounded):
        self.rect_px, self._rays = rect_px, rays
        self._rows, self._columns = grid_in(rect_px, depth.shape)
        self._depth_m = _depths(depth.part(self._rows, self._columns), depth.scale_m)
        self.shape = self._depth_m.shape
        ahead_mm = self._along(AHEAD)
        ahead_mm *= 1000
        ahead_mm += 0.5  # astype rounds down
        is_unknown = (ahead_mm < 1.5) | (ahead_mm > FARTHEST_LAYER_MM)
        ahead_mm[is_unknown] = UNKNOWN_MM
        self._ahead_mm = ahead_mm.astype(np.uint16)
        self.measured = ahead_mm.size - np.count_nonzero(is_unknown)
        self._weights, self._outline = _weights(self.shape), _outline(self.shape, surrounded)
        self._layer = None  # not known, or all samples are masked

    def _along(self, axis):
        """Positions along an axis of the level frame, metres."""
        across, down = self._rays[axis]
        if down is None:  # the lens distorts
            return (across[self._rows, self._columns] * self._depth_m).ravel()
        return ((across[:, self._columns] + down[self._rows]) * self._depth_m).ravel()

    def layer(self):
        """Nearest dominant Layer of the samples that are not masked; None if there are none."""
        if self._layer is None:
            self._layer = nearest_dominant_layer(self._ahead_mm, self._weights, self._outline)
        return self._layer

    def share_beside(self, rect_px):
        """Share of the samples with depth beside another rectangle that are on the body; nan if there are none."""
        beside, known = (np.count_nonzero(each) - np.count_nonzero(self._part(each, rect_px))
                         for each in (self.on_body(self.layer()), self._ahead_mm < UNKNOWN_MM))
        return beside / known if known else 0.5

    def mask(self, rect_px, limit_mm):
        """Mask the samples that are in a rectangle and not farther than `limit_mm`. Returns whether this changes the
        layer: not if all of them are nearer than its body, because what is nearer was not dominant before."""
        part = self._part(self._ahead_mm, rect_px)
        masked = part <= limit_mm
        if not np.count_nonzero(masked):
            return False
        part[masked] = UNKNOWN_MM
        if self._layer is not None and limit_mm < self._layer.trunk_mm - BODY_HALF_DEPTH_MM:
            return False
        self._layer = None
        return True

    def on_body(self, layer):
        """Which samples are on the body of a Layer."""
        return _around(self._ahead_mm, layer.trunk_mm, BODY_HALF_DEPTH_MM)

    def columns_of(self, layer, left, right, gap_px):
        """First column, and the one after the last, of the body of a Layer that continues on both sides of the columns
        from `left` to before `right`, with gaps of at most `gap_px` pixels."""
        on_body = np.count_nonzero(self.on_body(layer).reshape(self.shape), axis=0)
        known = np.count_nonzero((self._ahead_mm < UNKNOWN_MM).reshape(self.shape), axis=0)
        step = self._columns.step
        columns = np.arange(self._columns.start, self._columns.stop, step)[2 * on_body > known].tolist()
        for column in reversed(columns):
            if left - gap_px <= column + step <= left + step:
                left = min(column, left)
        for column in columns:
            if right - step <= column <= right + gap_px:
                right = max(column + step, right)
        return left, right

    def share(self, on_body):
        """Share of the weight of all samples, with depth or not, that the given samples have."""
        return self._weights.dot(on_body)

    def surround_unknown(self, on_body):
        """Whether the given samples are around something without depth, which may be the object: they fill the outline
        of the rectangle more than its middle, most of which has no depth."""
        share, unknown_share = self.share(on_body), self.share(self._depth_m.ravel() <= 0)
        beside = np.count_nonzero(on_body[self._outline])
        return unknown_share > share and share * len(self._outline) < beside

    def fill_sides(self, on_body):
        """Whether the given samples fill both sides of the rectangle; one is enough if the other hardly has depth."""
        rows, columns = self.shape
        filled, known = (np.count_nonzero(each.reshape(self.shape)[:, ::max(columns - 1, 1)], axis=0) >= FILLED * rows
                         for each in (on_body, self._ahead_mm < UNKNOWN_MM))
        return filled.any() and (filled | ~known).all()

    def edges(self, on_body):
        """Left and right edge of the body whose samples are given, and their median, metres."""
        return edges(self._along(ACROSS).compress(on_body))

    def ends(self, on_body):
        """Mean distances of the upper and of the lower end of the body whose samples are given, metres."""
        body_mm = memoryview(self._ahead_mm.compress(on_body))  # for a few numbers, faster than the array
        count = max(len(body_mm) * END_PERCENT // 100, 1)
        return sum(body_mm[:count]) / (1000 * count), sum(body_mm[-count:]) / (1000 * count)

    def _part(self, samples, rect_px):
        """View of the part of samples that is in a rectangle."""
        left, top, right, bottom = rect_px
        rows, columns = self._rows, self._columns
        return samples.reshape(self.shape)[_rank(rows, top):_rank(rows, bottom),
                                           _rank(columns, left):_rank(columns, right)]


@functools.lru_cache(maxsize=8)
def _camera_rays(camera):
    """Viewing rays x / z and y / z of all pixels: (1, w) and (h, 1), or both (h, w) if the lens distorts."""
    x, y = camera.rays(np.arange(camera.width)[np.newaxis], np.arange(camera.height)[:, np.newaxis])
    return x.astype(np.float32), y.astype(np.float32)


@functools.lru_cache(maxsize=2)
def level_rays(camera, level_axes):
    """The viewing rays of all pixels along each axis of the level frame, where z is 1 in the optical frame: pairs of
    arrays, (1, w) and (h, 1), whose sum they are; if the lens distorts, (h, w), 0 without a ray, and None."""
    x, y = _camera_rays(camera)
    pairs = [(to_x * x, to_y * y + to_z) for to_x, to_y, to_z in level_axes]
    return [(np.nan_to_num(across + down), None) for across, down in pairs] if camera.distortion_model else pairs


def grid_in(rect_px, shape):
    """Slices of rows and columns: a grid in the visible part of a rectangle of an image with a shape (h, w)."""
    (x1, y1, x2, y2), (height, width) = rect_px, shape
    return _line(y1, y2, height, GRID_ROWS), _line(x1, x2, width, GRID_COLUMNS)


def _line(low, high, limit, most):
    """Slice of at most `most` evenly spaced positions, centred in the part of low..high in 0..limit."""
    low = min(max(low, 0), limit)
    extent = max(min(high, limit) - low, 0)
    stride = max(-(-extent // most), 1)
    count = -(-extent // stride)
    first = low + (extent - (count - 1) * stride - 1) // 2
    return slice(first, first + stride * count, stride)


def _rank(pixels, limit):
    """Number of pixels (slice) before a limit; more than all if the limit is beyond the last one."""
    return max(0, -((pixels.start - limit) // pixels.step))


def _depths(values, scale_m):
    """Depths, metres, of the values of a depth image; 0 where none is measured."""
    depth_m = values.astype(np.float32)
    depth_m *= np.float32(scale_m)
    if values.dtype != np.uint16 or scale_m * UNKNOWN_MM > FARTHEST_M:  # otherwise no value is invalid
        with np.errstate(invalid='ignore'):  # nan
            depth_m[~((depth_m > 0) & (depth_m <= FARTHEST_M))] = 0
    return depth_m


@functools.lru_cache(maxsize=512)
def _weights(shape):
    """Weights of samples, whose sum is 1: those in the upper part count more, and those near the middle, by a Gaussian.
    """
    rows, columns = shape
    across = (np.arange(columns) + 0.5 - columns / 2.0) / (columns / 4.0)
    down = np.where(np.arange(rows) < UPPER_SHARE * rows, 1, LOWER_WEIGHT)
    weights = np.outer(down, np.exp(-0.5 * across ** 2)).ravel()
    return weights / weights.sum()


@functools.lru_cache(maxsize=512)
def _outline(shape, surrounded):
    """Numbers of the outermost samples at those of the left, the upper and the right edge that are `surrounded`."""
    numbers = np.arange(shape[0] * shape[1]).reshape(shape)
    all_edges = numbers[:, :1].ravel(), numbers[:1].ravel(), numbers[:, -1:].ravel()
    return np.concatenate([edge for edge, is_shown in zip(all_edges, surrounded) if is_shown] or [np.arange(0)])


def _around(distances_mm, middle_mm, half_mm):
    """Which distances (n,) are at most `half_mm` from `middle_mm`."""
    nearest_mm = max(middle_mm - half_mm, 0)
    return distances_mm - np.uint16(nearest_mm) <= middle_mm + half_mm - nearest_mm


def nearest_dominant_layer(distances_mm, weights, outline=()):
    """The Layer of the object in a rectangle: the nearest dominant one in the weighted histogram of the distances (n,).

    What fills the outline of the rectangle, the distances with the numbers `outline`, surrounds the object: the weight
    that a layer would have if all distances were like those of the outline is subtracted from its own, up to
    1 - `LEAST_INSIDE` of it. Returns None if no distance is known.
    """
    ordered_mm = distances_mm.copy()
    ordered_mm.sort(kind='mergesort')  # a radix sort from numpy 1.17 on
    ranked = memoryview(ordered_mm)
    count = bisect_left(ranked, UNKNOWN_MM)
    if not count:
        return None
    start_mm = _start_of_layer(distances_mm, weights, ranked[0], ranked[count - 1], outline)
    trunk_mm = _median(ranked, start_mm, start_mm + BIN_MM * LAYER_BINS - 1)
    trunk_mm = _median(ranked, trunk_mm - TRUNK_HALF_DEPTH_MM, trunk_mm + TRUNK_HALF_DEPTH_MM)
    first = bisect_left(ranked, trunk_mm - BODY_HALF_DEPTH_MM)
    return Layer(trunk_mm, first, bisect_right(ranked, trunk_mm + BODY_HALF_DEPTH_MM), ordered_mm)


def _start_of_layer(distances_mm, weights, nearest_mm, farthest_mm, outline):
    """Least distance in the nearest dominant layer; it may be less than 0."""
    bins = (farthest_mm - nearest_mm) // BIN_MM + 1 + LAYER_BINS
    # Differences are modulo 2 ** 16: unknown distances are in the first bins, or after the last one.
    numbers = distances_mm - np.uint16((nearest_mm - BIN_MM * _EMPTY_BINS) % 2 ** 16)
    numbers //= np.uint16(BIN_MM)
    layers, total = _layer_sums(numbers, weights, bins)
    inside = layers
    if len(outline):
        around, known = _layer_sums(numbers[outline], None, bins)
        if known:
            inside = np.maximum(layers - around * (total / known), LEAST_INSIDE * layers)
    first = int((inside >= FIRST_LAYER_SHARE * inside[inside.argmax()]).argmax())  # faster than max
    best = first + int(layers[first:first + LAYER_BINS].argmax())
    return nearest_mm + BIN_MM * (best - LAYER_BINS // 2)


def _layer_sums(numbers, weights, bins):
    """Sums of the weights (None: 1 each) in the layers that begin at each bin, given the bins of samples; and of all.
    """
    histogram = np.bincount(numbers, weights, bins)[:bins]
    histogram[:_EMPTY_BINS] = 0
    sums = histogram.cumsum()
    return sums[LAYER_BINS:] - sums[:-LAYER_BINS], sums[-1]


def _median(ranked, nearest, farthest):
    """Median, rounded down, of those of the integers in order that are in nearest..farthest."""
    middle = bisect_left(ranked, nearest) + bisect_right(ranked, farthest)
    return (ranked[(middle - 1) // 2] + ranked[middle // 2]) // 2


def edges(positions):
    """Lowest and highest value of a uniform distribution with these positions (n,), which are reordered: percentiles,
    extrapolated. Also their median.
    """
    last = len(positions) - 1
    rank, part = divmod(last * EDGE_PERCENT, 100)
    after, middle = min(rank + 1, last), last // 2
    positions.partition((rank, after, middle, last - middle, last - after, last - rank))
    ordered = memoryview(positions)
    low, high = ordered[rank], ordered[last - rank]
    low += (ordered[after] - low) * part / 100.0
    high -= (high - ordered[last - after]) * part / 100.0
    beyond = (high - low) * EDGE_PERCENT / (100.0 - 2 * EDGE_PERCENT)
    return low - beyond, high + beyond, (ordered[middle] + ordered[last - middle]) / 2
