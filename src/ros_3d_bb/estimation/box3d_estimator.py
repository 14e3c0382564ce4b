"""3D box estimators: from rectangles in the depth image to 3D boxes. See `box3d` for the conventions."""
import functools
from typing import Any, NamedTuple

import numpy as np

from ros_3d_bb.camera.depth_image import FARTHEST_M
from ros_3d_bb.core.labels import PERSON
from ros_3d_bb.core.object_classes import ObjectClasses
from ros_3d_bb.estimation.box3d import LEVEL, Box3D, ImageGeometry, truncated_edges, without_distortion
from ros_3d_bb.estimation.depth_samples import BODY_HALF_DEPTH_MM, grid_in
from ros_3d_bb.estimation.foreground import estimate_foreground

# A camera with more tilt or roll does not show people upright; chosen.
MAX_TILT_RAD, MAX_ROLL_RAD = np.radians(65), np.radians(45)


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
    """Samples of a DepthImage in a rectangle, on a centred grid of every `stride_px` pixels, clipped to the image
    (thesis 3.4.2). There are none in an empty or reversed rectangle.
    """
    height, width = depth.shape
    x1, y1, x2, y2 = map(int, rect_px)
    return _samples_at(depth, _ticks(y1, y2, height, stride_px), _ticks(x1, x2, width, stride_px))


def sample_grid(depth, rect_px):
    """Samples of a DepthImage in the visible part of a rectangle, on the grid of the foreground estimator."""
    return _samples_at(depth, *grid_in(tuple(map(int, rect_px)), depth.shape))


def _samples_at(depth, rows, columns):
    """Samples in rows and columns (slices)."""
    height, width = depth.shape
    depth_m = depth.part(rows, columns).astype(float) * depth.scale_m
    with np.errstate(invalid='ignore'):  # nan
        valid = (depth_m > 0) & (depth_m <= FARTHEST_M)
    return Samples(np.arange(width)[columns], np.arange(height)[rows], depth_m, valid)


def _ticks(low, high, limit, stride):
    """Slice of positions `stride` apart, centred in low..high and clipped to 0..limit; exact for ints of any size."""
    count = -(-(high - low) // stride)
    first = low + (high - low - (count - 1) * stride - 1) // 2
    first += max(0, -(first // stride)) * stride
    return slice(first, max(first, min(high, limit)), stride) if first < limit else slice(0, 0)


def estimate_median(samples, rect_px, geometry):
    """Estimate a box as in the thesis (3.4.2): per-axis median of the sampled points, size from the box at that depth.

    Returns a Box3D, or None without a valid depth or if the rectangle cannot be undistorted. The tilt of the camera is
    ignored.
    """
    camera = geometry.camera
    across, down = camera.rays(samples.columns, samples.rows[:, np.newaxis])
    seen = samples.valid & ~np.isnan(across)  # the distortion model does not define a ray for every pixel
    (flat_px,) = without_distortion([rect_px], camera)
    if not (np.isfinite(flat_px).all() and seen.any()):
        return None
    points = np.stack((across * samples.depth_m, down * samples.depth_m, samples.depth_m), axis=-1)[seen]
    x1, y1, x2, y2 = flat_px
    center_m = np.median(points, axis=0)
    width_m, height_m = (x2 - x1) / camera.fx * center_m[2], (y2 - y1) / camera.fy * center_m[2]
    on_body = np.abs(samples.depth_m[samples.valid] - center_m[2]) <= BODY_HALF_DEPTH_MM / 1000.0
    return Box3D(center_m, np.array([width_m, height_m, width_m]), tuple(rect_px), on_body.mean(),
                 truncated_edges(rect_px, geometry.area_px))


class Estimator(NamedTuple):
    """Pair of functions: `sample(depth, rect_px)` returns the Samples in a rectangle, and `estimate(depth, rects_px,
    geometry, kinds)` the Box3D or None of each rectangle, whose ObjectClass in `kinds` is that of `classes`.
    """

    sample: Any
    estimate: Any
    classes: ObjectClasses = ObjectClasses()


def estimator_named(name, stride_px=20, classes=ObjectClasses()):
    """Create the estimator foreground or median; `stride_px` is the grid spacing of the estimator median, `classes` the
    table of the classes of objects.

    Raises ValueError if the name is unknown or the stride is not positive.
    """
    if stride_px < 1:
        raise ValueError('stride is %d; at least 1 expected' % stride_px)
    if name == 'foreground':
        return Estimator(sample_grid, estimate_foreground, classes)
    if name == 'median':
        sample = functools.partial(sample_depth, stride_px=stride_px)

        def estimate(depth, rects_px, geometry, _kinds):
            return [estimate_median(sample(depth, rect_px), rect_px, geometry) for rect_px in rects_px]
        return Estimator(sample, estimate, classes)
    raise ValueError('estimator is %r; foreground or median expected' % name)


def estimate_boxes(depth, rects_px, camera, estimator, level_from_camera=LEVEL, labels=None):
    """Estimate the 3D boxes of all rectangles of one image.

    Parameters
    ----------
    depth : depth_image.DepthImage
    rects_px : list of (x1, y1, x2, y2)
    camera : camera_model.Camera
    estimator : Estimator
    level_from_camera : numpy.ndarray, (3, 3), optional
        Rotation to the level frame, see `level_rotation`. By default the camera is held level.
    labels : sequence of str, optional
        Class names of the rectangles, also as in other data sets (`ObjectClasses.standard_name`). By default they are
        those of people.

    Returns
    -------
    list of Box3D or None
        In the order of the rectangles; None without an estimate. Not all of them are plausible, see
        `Box3D.is_plausible`.
    """
    if len(rects_px) == 0:  # most images show no people
        return []
    labels = list(map(estimator.classes.standard_name, labels or [PERSON] * len(rects_px)))
    geometry = ImageGeometry(camera, depth.measured_area(), tuple(map(tuple, level_from_camera.tolist())))
    boxes = estimator.estimate(depth, rects_px, geometry, list(map(estimator.classes.of, labels)))
    return [box and (box if label == box.label else box._replace(label=label)) for box, label in zip(boxes, labels)]


def check_rect(rect_px):
    """Raise ValueError if a rectangle is empty or reversed."""
    x1, y1, x2, y2 = rect_px
    if x1 >= x2 or y1 >= y2:
        raise ValueError('box (%d, %d, %d, %d) is empty or reversed: x1 < x2 and y1 < y2 expected' % (x1, y1, x2, y2))


def level_rotation(up):
    """Rotation (3, 3) from the optical frame to the level frame, given the unit vector `up` (3,) in the optical frame.

    It is `LEVEL` if `up` is None, unknown, or the camera points so steeply up or down, or is rolled so far, that people
    do not stand upright in the image (`MAX_TILT_RAD`, `MAX_ROLL_RAD`).
    """
    if up is None:
        return LEVEL
    down = -np.asarray(up, float)
    if abs(down[2]) > np.sin(MAX_TILT_RAD) or down[1] < np.cos(MAX_ROLL_RAD) * np.hypot(down[0], down[1]):
        return LEVEL
    ahead = np.array([0.0, 0.0, 1.0]) - down[2] * down
    ahead /= np.linalg.norm(ahead)
    return np.stack((np.cross(down, ahead), down, ahead))
