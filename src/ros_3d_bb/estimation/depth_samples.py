"""Depth samples in a rectangle of an image, and the depth layer of the object in it; see `box3d` for the conventions.

Depth layers are layers of z in the level frame, because people stand upright there. These distances are whole
millimetres in arrays of 16 bits, `UNKNOWN_MM` without depth, without a viewing ray and where masked. A rank is a
position among the sorted distances, nearest first.
"""
import functools
from bisect import bisect_left, bisect_right
from typing import Any, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.camera.images import FARTHEST_M, DepthImage
from ros_3d_bb.estimation.box3d import ImageGeometry, Rect

# "Views" is ./run bench ablation estimation --benchmarks views. Without a mechanism, more people are over 0.3 m from
# their boxes there; with all mechanisms, 5 of 294.
# Largest numbers of rows and columns; on average, two thirds of them are sampled. Measured: positions are as accurate
# as with 2000 to 8000 samples (./run bench accuracy).
GRID_ROWS, GRID_COLUMNS = 48, 32
# Weights of the rows: something may stand before the legs. Views: 6 more with equal weights.
UPPER_SHARE, LOWER_WEIGHT = 0.5, 0.2
UNKNOWN_MM = 65535  # the largest number of 16 bits
# Half the depth extents of a person with stretched arms, whose span is about the height, and of the trunk: a wall close
# behind must not shift the median. Views: 3 more with 200 mm.
BODY_HALF_DEPTH_MM, TRUNK_HALF_DEPTH_MM = 350, 250
BIN_MM, LAYER_BINS = 50, 5  # of the depth histogram: a layer is as thick as a trunk
# The nearest layer with at least this share of the largest layer weight is the object; flying pixels have less. Views:
# 2 more, and 4 more without a box, with 1; 4 more with 0.25.
FIRST_LAYER_SHARE = 0.5
# What fills the outline keeps this share of its weight: a rectangle may be smaller than its object. Views: 5 more with
# 1.
LEAST_INSIDE = 0.3
# Minimum share of a side of a rectangle that the background behind an object fills; test_difficult_views.py needs it.
FILLED = 0.4
# Percentage of the samples on a body at each end: the head, the feet, an arm or flying pixels. Measured by ./run bench
# accuracy: RMSE 0.034 m, with 5 % 0.036 m.
END_PERCENT = 4


class Layer(NamedTuple):
    """Depth layer of an object: the distance of its trunk, the first rank on its body and the one after the last, and
    all distances in order."""

    trunk_mm: int
    first: int
    end: int
    ordered_mm: np.ndarray

    def mean_m(self) -> float:
        """Mean distance of the body without its nearest and its farthest tenth, metres: it is finer than the median,
        which has the resolution of depth."""
        tenth = (self.end - self.first) // 10
        inner_mm = self.ordered_mm[self.first + tenth:self.end - tenth]
        return int(inner_mm.sum()) / (1000 * len(inner_mm))


class RectSamples(object):
    """Samples of the visible part of a rectangle in the level frame, each an element of flat arrays.

    `surrounded` states whether the left, the upper and the right edge show what surrounds the object. `shape` are the
    numbers of rows and columns, and `measured` is the number of samples with depth and a viewing ray, masked or not.
    """

    def __init__(self, depth: DepthImage, rect_px: Rect, geometry: ImageGeometry, surrounded: Sequence[bool]) -> None:
        self.rect_px, self._level_axes = rect_px, geometry.level_axes
        self._rows, self._columns = grid_in(rect_px, depth.shape)
        self._rays = _rays_of(geometry.camera, self._rows, self._columns)
        self._depth_m = _depths(depth.part(self._rows, self._columns), depth.scale_m)
        self.shape = self._depth_m.shape
        ahead_mm = self._along(2)
        ahead_mm *= 1000
        ahead_mm += 0.5  # astype rounds down
        # Half of the farthest body is behind its trunk.
        is_unknown = (ahead_mm < 1.5) | (ahead_mm >= UNKNOWN_MM - BODY_HALF_DEPTH_MM)
        ahead_mm[is_unknown] = UNKNOWN_MM
        self._ahead_mm = ahead_mm.astype(np.uint16)
        self.measured = ahead_mm.size - np.count_nonzero(is_unknown)
        self._weights, self._outline = _weights(self.shape), _outline(self.shape, tuple(surrounded))
        self._layer: Optional[Layer] = None  # not known, or all samples are masked

    def _along(self, axis: int) -> np.ndarray:
        x, y, z = self._rays
        to_x, to_y, to_z = self._level_axes[axis]
        return ((to_x * x + (to_y * y + to_z * z)) * self._depth_m).ravel()

    def layer(self) -> Optional[Layer]:
        """Nearest dominant Layer of the samples that are not masked; None if there are none."""
        if self._layer is None:
            self._layer = nearest_dominant_layer(self._ahead_mm, self._weights, self._outline)
        return self._layer

    def share_beside(self, rect_px: Rect, layer: Layer) -> float:
        """Share of the samples with depth beside another rectangle that are on the body of a Layer; 0.5 if there are
        none."""
        beside, known = (np.count_nonzero(each) - np.count_nonzero(self._part(each, rect_px))
                         for each in (self.on_body(layer), self._ahead_mm < UNKNOWN_MM))
        return beside / known if known else 0.5

    def mask(self, rect_px: Rect, limit_mm: float) -> bool:
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

    def on_body(self, layer: Layer) -> np.ndarray:
        nearest_mm = max(layer.trunk_mm - BODY_HALF_DEPTH_MM, 0)
        return self._ahead_mm - np.uint16(nearest_mm) <= layer.trunk_mm + BODY_HALF_DEPTH_MM - nearest_mm

    def columns_of(self, layer: Layer) -> List[int]:
        """The columns most of whose samples with depth are on the body of a Layer."""
        on_body = np.count_nonzero(self.on_body(layer).reshape(self.shape), axis=0)
        known = np.count_nonzero((self._ahead_mm < UNKNOWN_MM).reshape(self.shape), axis=0)
        return np.arange(self._columns.start, self._columns.stop, self._columns.step)[2 * on_body > known].tolist()

    def share(self, on_body: np.ndarray) -> float:
        """Share of the weight of all samples, with depth or not, that the given samples have."""
        return float(self._weights.dot(on_body))

    def surround_unknown(self, on_body: np.ndarray) -> bool:
        """Whether the given samples are around something without depth, which may be the object: they fill the outline
        of the rectangle more than its middle, most of which has no depth."""
        share, unknown_share = self.share(on_body), self.share(self._depth_m.ravel() <= 0)
        beside = np.count_nonzero(on_body[self._outline])
        return unknown_share > share and share * len(self._outline) < beside

    def fill_sides(self, on_body: np.ndarray) -> bool:
        """Whether the given samples fill both sides of the rectangle; one is enough if the other hardly has depth."""
        rows, columns = self.shape
        filled, known = (np.count_nonzero(each.reshape(self.shape)[:, ::max(columns - 1, 1)], axis=0) >= FILLED * rows
                         for each in (on_body, self._ahead_mm < UNKNOWN_MM))
        return bool(filled.any() and (filled | ~known).all())

    def edges(self, on_body: np.ndarray) -> Tuple[float, float, float]:
        """Left and right edge of the body whose samples are given, and their median, metres."""
        return edges(self._along(0).compress(on_body))

    def ends(self, on_body: np.ndarray) -> Tuple[float, float]:
        """Mean distances of the upper and of the lower end of the body whose samples are given, metres."""
        body_mm = self._ahead_mm.compress(on_body).data  # for a few numbers, faster than the array
        count = max(len(body_mm) * END_PERCENT // 100, 1)
        return sum(body_mm[:count]) / (1000 * count), sum(body_mm[-count:]) / (1000 * count)

    def _part(self, samples: np.ndarray, rect_px: Rect) -> np.ndarray:
        left, top, right, bottom = rect_px
        rows, columns = self._rows, self._columns
        return samples.reshape(self.shape)[_rank(rows, top):_rank(rows, bottom),
                                           _rank(columns, left):_rank(columns, right)]


def _rays_of(camera: Camera, rows: slice, columns: slice) -> Tuple[np.ndarray, np.ndarray, Any]:
    """x, y and z of the viewing rays of samples, which broadcast to their shape; 0 if the lens gives no ray."""
    x, y, has_ray = _camera_rays(camera)
    if camera.distortion_model:
        return x[rows, columns], y[rows, columns], has_ray[rows, columns]
    return x[:, columns], y[rows], 1.0


@functools.lru_cache(maxsize=8)
def _camera_rays(camera: Camera) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x / z and y / z of the viewing rays of all pixels, (1, w) and (h, 1), or both (h, w) if the lens distorts, and
    whether there is one."""
    x, y = camera.rays(np.arange(camera.width)[np.newaxis], np.arange(camera.height)[:, np.newaxis])
    return np.nan_to_num(x).astype(np.float32), np.nan_to_num(y).astype(np.float32), np.isfinite(x)


def grid_in(rect_px: Rect, shape: Sequence[int]) -> Tuple[slice, slice]:
    """Slices of rows and columns: a grid in the visible part of a rectangle of an image with a shape (h, w)."""
    (x1, y1, x2, y2), (height, width) = rect_px, shape
    return _line(y1, y2, height, GRID_ROWS), _line(x1, x2, width, GRID_COLUMNS)


def _line(low: int, high: int, limit: int, most: int) -> slice:
    """Slice of at most `most` evenly spaced positions, centred in the part of low..high in 0..limit."""
    low = min(max(low, 0), limit)
    extent = max(min(high, limit) - low, 0)
    stride = max(-(-extent // most), 1)
    count = -(-extent // stride)
    first = low + (extent - (count - 1) * stride - 1) // 2
    return slice(first, first + stride * count, stride)


def _rank(pixels: slice, limit: int) -> int:
    """Number of pixels before a limit; more than all if the limit is beyond the last one."""
    return max(0, -((pixels.start - limit) // pixels.step))


def _depths(values: np.ndarray, scale_m: float) -> np.ndarray:
    """Depths, metres, of the values of a depth image; 0 where none is measured."""
    depth_m = values.astype(np.float32)
    depth_m *= np.float32(scale_m)
    if values.dtype != np.uint16 or scale_m * UNKNOWN_MM > FARTHEST_M:  # otherwise no value is invalid
        with np.errstate(invalid='ignore'):  # nan
            depth_m[~((depth_m > 0) & (depth_m <= FARTHEST_M))] = 0
    return depth_m


@functools.lru_cache(maxsize=512)
def _weights(shape: Tuple[int, ...]) -> np.ndarray:
    """Weights of samples, whose sum is 1: those in the upper part count more, and those near the middle, by a Gaussian.
    """
    rows, columns = shape
    across = (np.arange(columns) + 0.5 - columns / 2.0) / (columns / 4.0)
    down = np.where(np.arange(rows) < UPPER_SHARE * rows, 1, LOWER_WEIGHT)
    weights = np.outer(down, np.exp(-0.5 * across ** 2)).ravel()
    return weights / weights.sum()


@functools.lru_cache(maxsize=512)
def _outline(shape: Tuple[int, ...], surrounded: Tuple[bool, ...]) -> np.ndarray:
    """Numbers of the outermost samples at those of the left, the upper and the right edge that are `surrounded`."""
    numbers = np.arange(shape[0] * shape[1]).reshape(shape)
    all_edges = numbers[:, :1].ravel(), numbers[:1].ravel(), numbers[:, -1:].ravel()
    return np.concatenate([edge for edge, is_shown in zip(all_edges, surrounded) if is_shown] or [np.arange(0)])


def nearest_dominant_layer(distances_mm: np.ndarray, weights: np.ndarray, outline: np.ndarray) -> Optional[Layer]:
    """The Layer of the object in a rectangle: the nearest dominant one in the weighted histogram of the distances (n,).

    What fills the outline of the rectangle, the distances with the numbers `outline`, surrounds the object: the weight
    that a layer would have if all distances were like those of the outline is subtracted from its own, up to
    1 - `LEAST_INSIDE` of it. Returns None if no distance is known.
    """
    ordered_mm = distances_mm.copy()
    ordered_mm.sort(kind='mergesort')  # a radix sort from numpy 1.17 on
    ranked = ordered_mm.data
    count = bisect_left(ranked, UNKNOWN_MM)
    if not count:
        return None
    start_mm = _start_of_layer(distances_mm, weights, ranked[0], ranked[count - 1], outline)
    trunk_mm = _median(ranked, start_mm, start_mm + BIN_MM * LAYER_BINS - 1)
    trunk_mm = _median(ranked, trunk_mm - TRUNK_HALF_DEPTH_MM, trunk_mm + TRUNK_HALF_DEPTH_MM)
    first = bisect_left(ranked, trunk_mm - BODY_HALF_DEPTH_MM)
    return Layer(trunk_mm, first, bisect_right(ranked, trunk_mm + BODY_HALF_DEPTH_MM), ordered_mm)


def _start_of_layer(distances_mm: np.ndarray, weights: np.ndarray, nearest_mm: int, farthest_mm: int,
                    outline: np.ndarray) -> int:
    """Least distance in the nearest dominant layer; it may be less than 0."""
    bins = (farthest_mm - nearest_mm) // BIN_MM + 1 + 2 * LAYER_BINS
    # Differences are modulo 2 ** 16: unknown distances are in the first bins, or after the last one.
    numbers = distances_mm - np.uint16((nearest_mm - BIN_MM * LAYER_BINS) % 2 ** 16)
    numbers //= np.uint16(BIN_MM)
    layers, total = _layer_sums(numbers, weights, bins)
    inside = layers
    if len(outline):
        around, known = _layer_sums(numbers[outline], None, bins)
        if known:
            inside = np.maximum(layers - around * (total / known), LEAST_INSIDE * layers)
    first = int((inside >= FIRST_LAYER_SHARE * inside[inside.argmax()]).argmax())  # faster than max
    best = first + int(layers[first:first + LAYER_BINS].argmax())
    return nearest_mm + BIN_MM * (best + 1 - LAYER_BINS)


def _layer_sums(numbers: np.ndarray, weights: Optional[np.ndarray], bins: int) -> Tuple[np.ndarray, float]:
    """Sums of the weights (None: 1 each) in the layers that begin at each bin, given the bins of samples; and of all.
    The first `LAYER_BINS` bins are before the nearest distance."""
    histogram = np.bincount(numbers, weights, bins)[:bins]
    histogram[:LAYER_BINS] = 0
    sums = histogram.cumsum()
    return sums[LAYER_BINS:] - sums[:-LAYER_BINS], sums[-1]


def _median(ranked: memoryview, nearest: int, farthest: int) -> int:
    """Median, rounded down, of those of the integers in order that are in nearest..farthest."""
    middle = bisect_left(ranked, nearest) + bisect_right(ranked, farthest)
    return (ranked[(middle - 1) // 2] + ranked[middle // 2]) // 2


def edges(positions: np.ndarray) -> Tuple[float, float, float]:
    """Lowest and highest value of a uniform distribution with these positions (n,), which are reordered: percentiles,
    extrapolated. Also their median.
    """
    last = len(positions) - 1
    rank, part = divmod(last * END_PERCENT, 100)
    after, middle = min(rank + 1, last), last // 2
    positions.partition((rank, after, middle, last - middle, last - after, last - rank))
    ordered = positions.data
    low, high = float(ordered[rank]), float(ordered[last - rank])
    low += (ordered[after] - low) * part / 100.0
    high -= (high - ordered[last - after]) * part / 100.0
    beyond = (high - low) * END_PERCENT / (100.0 - 2 * END_PERCENT)
    return low - beyond, high + beyond, (ordered[middle] + ordered[last - middle]) / 2
