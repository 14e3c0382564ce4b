"""Depth samples in rectangles of an image; see `box3d` for the conventions."""
from typing import NamedTuple

import numpy as np

from ros_3d_bb.camera.depth_image import FARTHEST_M
from ros_3d_bb.estimation.depth_layers import (FARTHEST_LAYER_M, UNKNOWN_MM, SortedDistances, edges, millimetres,
                                               nearest_dominant_layers)

# Largest number of rows and columns that the foreground estimator samples; on average, it samples two thirds of them.
GRID_ROWS, GRID_COLUMNS = 48, 32
# Chosen so that no person behind the dog of config/scenarios/objects.yaml is taken for the dog.
UPPER_SHARE, LOWER_WEIGHT = 0.55, 0.35
MIDDLE_M = 32.0  # of the lateral positions that fit into 16 bits of millimetres
LOOKS_DOWN, FEET_M = np.sin(np.radians(10)), 0.3  # a camera with more tilt sees the floor beside the feet, this high


class Samples(NamedTuple):
    """Grid of depth samples in one rectangle: columns (w,), rows (h,), depth_m (h, w), metres, and valid (h, w),
    whether depth was measured.
    """

    columns: np.ndarray
    rows: np.ndarray
    depth_m: np.ndarray
    valid: np.ndarray

    @property
    def pixels(self):
        """Pixel coordinates (u, v) of the grid, (h, w, 2)."""
        return np.stack(np.meshgrid(self.columns, self.rows), axis=-1)


def sample_depth(depth, rect_px, stride_px):
    """Sample a rectangle on a centred grid of every `stride_px` pixels, clipped to the image (thesis 3.4.2).

    Parameters
    ----------
    depth : depth_image.DepthImage
    rect_px : (x1, y1, x2, y2)
        There are no samples in an empty or reversed rectangle.
    stride_px : int

    Returns
    -------
    Samples
    """
    height, width = depth.shape
    x1, y1, x2, y2 = map(int, rect_px)
    return _samples_at(depth, _ticks(y1, y2, height, stride_px), _ticks(x1, x2, width, stride_px))


def sample_grid(depth, rect_px):
    """Sample the visible part of a rectangle on the grid of the foreground estimator, as `sample_depth`."""
    (slices,) = grid_slices(*grids(np.array([rect_px], np.int64), depth.shape))
    return _samples_at(depth, *slices)


def _samples_at(depth, rows, columns):
    """Samples in rows and columns (slices)."""
    height, width = depth.shape
    depth_m = depth.part(rows, columns).astype(float) * depth.scale_m
    valid = (depth_m > 0) & (depth_m <= FARTHEST_M)
    return Samples(np.arange(width)[columns], np.arange(height)[rows], depth_m, valid)


class RectSamples(object):
    """Samples of all rectangles of an image in the level frame, on the grid of `sample_grid`; `numbers` (k,) are those
    of rectangles.

    Attributes
    ----------
    rects_px : numpy.ndarray, (n, 4)
    counts : numpy.ndarray, (n, 2)
        Numbers of rows and columns of the grids.
    ahead_mm : numpy.ndarray, (n, samples)
        Whole millimetres, `UNKNOWN_MM` without depth, without a viewing ray and where masked.
    measured : numpy.ndarray, (n,)
        Number of samples with depth and a viewing ray, masked or not.
    """

    def __init__(self, depth, rects_px, geometry):
        self.rects_px, self._rect_lists_px = rects_px, rects_px.tolist()
        first, stride, self.counts = grids(rects_px, depth.shape)
        self._slices = grid_slices(first, stride, self.counts)
        last = np.maximum(self.counts - 1, 0)[..., None]  # repeated to the grid's size: there may be no rays beyond
        rows, columns = (first[:, axis, None] + stride[:, axis, None] * np.minimum(np.arange(size), last[:, axis])
                         for axis, size in enumerate((GRID_ROWS, GRID_COLUMNS)))
        depth_m = grid_depths(depth, self._slices, self.counts)
        x, y = (along.astype(np.float32) for along in geometry.camera.rays(columns[:, None, :], rows[:, :, None]))

        def along_axis(axis):
            to_x, to_y, to_z = geometry.level_from_camera[axis].tolist()
            return ((to_x * x + (to_y * y + to_z)) * depth_m).reshape(len(depth_m), -1)
        ahead_m = along_axis(2)
        with np.errstate(invalid='ignore'):  # nan: the distortion model has no ray for every pixel
            known = (ahead_m > 0) & (ahead_m <= FARTHEST_LAYER_M)
        self.ahead_mm = millimetres(ahead_m, known)
        self._across_mm = millimetres(np.clip(along_axis(0) + MIDDLE_M, 0, 2 * MIDDLE_M), known)
        self._down_m = along_axis(1) if geometry.level_from_camera[1, 2] > LOOKS_DOWN else None
        self.measured = np.count_nonzero(known, axis=1)
        self._weights = _weights(columns, rects_px, self.counts[:, 0])

    def layers(self, numbers, ahead_mm=None, ordered=None):
        """Distance (k,) of the nearest dominant layer in rectangles, whole millimetres; by default in all samples that
        are not masked.
        """
        ahead_mm = self.ahead_mm[numbers] if ahead_mm is None else ahead_mm
        return nearest_dominant_layers(ahead_mm, self._weights[numbers], ordered or SortedDistances(ahead_mm))

    def edges(self, numbers, on_body, bottom_m):
        """Left and right edges (2, k) of the bodies whose samples are given (k, samples), metres."""
        if self._down_m is not None:
            # The floor beside the feet is as far away as the body.
            above_feet = on_body & (self._down_m[numbers] < bottom_m[:, None] - FEET_M)
            on_body = np.where(above_feet.any(axis=1)[:, None], above_feet, on_body)
        across_mm = np.where(on_body, self._across_mm[numbers], np.uint16(UNKNOWN_MM))
        return np.array(edges(SortedDistances(across_mm))) / 1000 - MIDDLE_M

    def mask(self, samples_mm, number, occluder, limit_mm):
        """Mask the samples of a rectangle that are in the rectangle of an occluder and not farther than `limit_mm`.

        Returns whether there are any.
        """
        left, top, right, bottom = self._rect_lists_px[occluder]
        rows, columns = self._slices[number]
        rows = slice(_rank(rows, top), _rank(rows, bottom))
        columns = slice(_rank(columns, left), _rank(columns, right))
        part = samples_mm.reshape(GRID_ROWS, GRID_COLUMNS)[rows, columns]
        masked = part <= limit_mm
        part[masked] = UNKNOWN_MM
        return masked.any()


def grids(rects_px, shape):
    """Grids of samples in the visible parts of rectangles (n, 4): first pixels, strides and numbers of pixels, each
    (n, 2) as (row, column).
    """
    low = np.minimum(np.maximum(rects_px[:, 1::-1], 0), shape)
    extent = np.maximum(np.minimum(np.maximum(rects_px[:, :1:-1], 0), shape) - low, 0)
    stride = np.maximum(-(-extent // (GRID_ROWS, GRID_COLUMNS)), 1)
    count = -(-extent // stride)
    return low + (extent - (count - 1) * stride - 1) // 2, stride, count


def grid_slices(first, stride, count):
    """Slices (rows, columns) of grids."""
    ends = first + stride * count
    return [(slice(top, bottom, down), slice(left, right, across)) for (top, left), (bottom, right), (down, across)
            in zip(first.tolist(), ends.tolist(), stride.tolist())]


def grid_depths(depth, slices, count):
    """Depths (n, GRID_ROWS, GRID_COLUMNS) at the pixels of grids, metres; 0 where none is measured."""
    values = np.zeros((len(slices), GRID_ROWS, GRID_COLUMNS), np.float32)
    for grid, (rows, columns), grid_slices in zip(values, count.tolist(), slices):
        grid[:rows, :columns] = depth.part(*grid_slices)
    values *= np.float32(depth.scale_m)
    values[~((values > 0) & (values <= FARTHEST_M))] = 0
    return values


def _weights(columns, rects_px, row_counts):
    """Weights (n, samples) of the samples in columns (n, GRID_COLUMNS) and the first `row_counts` (n,) rows: a Gaussian
    about the middle of a rectangle, and less in its lower part, where something may stand before the legs.
    """
    left, right = rects_px[:, 0, None], rects_px[:, 2, None]
    across = np.exp(-0.5 * ((columns - (left + right) / 2.0) / ((right - left) / 4.0)) ** 2)
    down = np.where(np.arange(GRID_ROWS) < UPPER_SHARE * row_counts[:, None], 1, LOWER_WEIGHT)
    return (across[:, None] * down[..., None]).reshape(len(columns), -1)


def _rank(pixels, limit):
    """Number of pixels (slice) before a limit; more than all if the limit is beyond the last one."""
    return max(0, -((pixels.start - limit) // pixels.step))


def _ticks(low, high, limit, stride):
    """Slice of positions `stride` apart, centred in low..high and clipped to 0..limit; exact for ints of any size."""
    count = -(-(high - low) // stride)
    first = low + (high - low - (count - 1) * stride - 1) // 2
    first += max(0, -(first // stride)) * stride
    return slice(first, max(first, min(high, limit)), stride) if first < limit else slice(0, 0)
