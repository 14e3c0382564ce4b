"""From a rectangle in the depth image to a box in space.

Convention: a rectangle (x1, y1, x2, y2) holds the pixels x1 <= u < x2, y1 <= v < y2. Positions are in the camera
optical frame, metres.
"""
from typing import NamedTuple, Tuple

import numpy as np

# A box whose edge is this close to the image border is taken to be cut by it: detectors round to whole pixels and
# regress the edge of a cut person a pixel or two inside the image.
BORDER_PX = 2
# Depth of a person with stretched arms around its median depth; what lies further off is something else.
BODY_HALF_DEPTH_M = 0.35


class DepthImage(NamedTuple):
    """A depth image as the camera sent it: `values` (height, width) of any numeric type, times `scale_m` is metres.

    Zero, negative, nan and inf mean: no depth measured there.
    """

    values: np.ndarray
    scale_m: float

    def at(self, u, v):
        """Depth in metres at integer pixels (columns u, rows v), and whether it was measured; arrays of u's shape."""
        depth_m = self.values[v, u].astype(float) * self.scale_m
        return depth_m, np.isfinite(depth_m) & (depth_m > 0)


class Samples(NamedTuple):
    """Depth pixels looked at in one rectangle: columns u (n,), rows v (n,), depth_m (n,), valid (n,)."""

    u: np.ndarray
    v: np.ndarray
    depth_m: np.ndarray
    valid: np.ndarray


class Box3D(NamedTuple):
    """An upright cylinder in the camera optical frame, and how well it was seen.

    `center_m` (3,) and `size_m` (width, height, width), metres; `rect_px` the rectangle it came from; `support` the
    share 0..1 of the sampled pixels that carried its depth; `truncated` whether the rectangle touches the border.
    """

    center_m: np.ndarray
    size_m: np.ndarray
    rect_px: Tuple[int, int, int, int]
    support: float
    truncated: bool


def sample_median(depth, rect_px, stride_px=20):
    """Sample a rectangle on the thesis' grid: every `stride_px` pixels, centred, the part inside the image (3.4.2).

    Returns
    -------
    Samples

    Raises
    ------
    ValueError
        If the rectangle is empty or reversed.
    """
    x1, y1, x2, y2 = (int(edge) for edge in rect_px)
    if x1 >= x2 or y1 >= y2:
        raise ValueError('box (%d, %d, %d, %d) is empty or reversed: x1 < x2 and y1 < y2 expected' % (x1, y1, x2, y2))
    height, width = depth.values.shape
    u, v = (grid.ravel() for grid in np.meshgrid(_ticks(x1, x2, width, stride_px), _ticks(y1, y2, height, stride_px)))
    return Samples(u, v, *depth.at(u, v))


def estimate_median(samples, rect_px, camera):
    """The thesis' estimator (3.4.2): per-axis median of the sampled points, size from the box at the median depth.

    Returns
    -------
    Box3D or None
        None where no sample carries a depth.
    """
    if not samples.valid.any():
        return None
    depth_m = samples.depth_m[samples.valid]
    pixels = np.stack((samples.u, samples.v), axis=-1)[samples.valid]
    center_m = np.median(camera.deproject(pixels, depth_m), axis=0)
    x1, y1, x2, y2 = rect_px
    width_m, height_m = (x2 - x1) / camera.fx * center_m[2], (y2 - y1) / camera.fy * center_m[2]
    on_body = np.abs(depth_m - center_m[2]) <= BODY_HALF_DEPTH_M
    return Box3D(center_m, np.array([width_m, height_m, width_m]), tuple(rect_px),
                 np.count_nonzero(on_body) / float(samples.u.size), is_truncated(rect_px, camera))


def is_truncated(rect_px, camera):
    """Whether a rectangle touches the border of the image."""
    x1, y1, x2, y2 = rect_px
    return bool(min(x1, y1) <= BORDER_PX or x2 >= camera.width - BORDER_PX or y2 >= camera.height - BORDER_PX)


def _ticks(low, high, limit, stride):
    """Multiples of stride centred in low..high, those in 0..limit; exact for ints of any size, in O(limit)."""
    count = -(-(high - low) // stride)
    first = low + (high - low - (count - 1) * stride - 1) // 2
    first += max(0, -(first // stride)) * stride
    return np.arange(first, max(first, min(high, limit)), stride) if first < limit else np.arange(0)
