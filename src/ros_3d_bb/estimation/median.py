"""The estimator of the thesis (3.4): medians of the depth samples on a grid. See `box3d` for the conventions."""
from typing import Any, Tuple, Union

import numpy as np

from ros_3d_bb.estimation.body import truncated_edges
from ros_3d_bb.estimation.box3d import NO_DEPTH, NO_RAY, Box3D, ImageGeometry, Rect, Rejected, without_distortion
from ros_3d_bb.estimation.depth_samples import BODY_HALF_DEPTH_MM


def centred_grid(rect_px: Rect, shape: Tuple[int, ...], stride_px: int) -> Tuple[slice, slice]:
    """Slices of rows and columns: every `stride_px` pixels, centred in a rectangle, and clipped to an image with a
    shape (h, w). They are empty in an empty or reversed rectangle.
    """
    (x1, y1, x2, y2), (height, width) = rect_px, shape
    return _ticks(y1, y2, height, stride_px), _ticks(x1, x2, width, stride_px)


def _ticks(low: int, high: int, limit: int, stride: int) -> slice:
    """Slice of positions `stride` apart, centred in low..high and clipped to 0..limit; exact for ints of any size."""
    count = -(-(high - low) // stride)
    first = low + (high - low - (count - 1) * stride - 1) // 2
    first += max(0, -(first // stride)) * stride
    return slice(first, max(first, min(high, limit)), stride) if first < limit else slice(0, 0)


def estimate_median(samples: Any, rect_px: Rect, geometry: ImageGeometry) -> Union[Box3D, Rejected]:
    """Estimate a box as in the thesis (3.4.2): per-axis median of the sampled points, size from the box at that depth.

    Returns a Box3D, or Rejected without a valid depth or if the rectangle cannot be undistorted. The tilt of the camera
    is ignored.
    """
    camera = geometry.camera
    across, down = camera.rays(samples.columns, samples.rows[:, np.newaxis])
    seen = samples.valid & ~np.isnan(across)  # the distortion model does not define a ray for every pixel
    (flat_px,) = without_distortion([rect_px], camera)
    if not np.isfinite(flat_px).all():
        return Rejected(NO_RAY)
    if not seen.any():
        return Rejected(NO_RAY if samples.valid.any() else NO_DEPTH)
    points = np.stack((across * samples.depth_m, down * samples.depth_m, samples.depth_m), axis=-1)[seen]
    x1, y1, x2, y2 = flat_px
    center_m = np.median(points, axis=0)
    width_m, height_m = (x2 - x1) / camera.fx * center_m[2], (y2 - y1) / camera.fy * center_m[2]
    on_body = np.abs(samples.depth_m[samples.valid] - center_m[2]) <= BODY_HALF_DEPTH_MM / 1000.0
    return Box3D(center_m, np.array([width_m, height_m, width_m]), tuple(rect_px), on_body.mean(),
                 truncated_edges(rect_px, geometry.area_px))
