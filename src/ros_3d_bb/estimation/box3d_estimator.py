"""3D box estimators: from rectangles in the depth image to 3D boxes. See `box3d` for the conventions."""
import functools
from typing import Callable, List, NamedTuple, Optional, Sequence, Tuple, Union

import numpy as np

from ros_3d_bb.camera.camera_model import Camera, Vector
from ros_3d_bb.camera.images import FARTHEST_M, STEEP, DepthImage
from ros_3d_bb.core.object_classes import PERSON, ObjectClass, ObjectClasses
from ros_3d_bb.estimation.box3d import LEVEL, Box3D, ImageGeometry, Rect, Rejected
from ros_3d_bb.estimation.depth_samples import grid_in
from ros_3d_bb.estimation.foreground import estimate_foreground
from ros_3d_bb.estimation.median import centred_grid, estimate_median

Grid = Callable[[Rect, Tuple[int, ...]], Tuple[slice, slice]]
Boxes = List[Union[Box3D, Rejected]]


class Samples(NamedTuple):
    """Grid of depth samples in one rectangle: columns (w,), rows (h,), depth_m (h, w), metres, and valid (h, w),
    whether depth was measured.
    """

    columns: np.ndarray
    rows: np.ndarray
    depth_m: np.ndarray
    valid: np.ndarray

    @property
    def pixels(self) -> np.ndarray:
        """Pixel coordinates (u, v) of the grid, (h, w, 2)."""
        return np.stack(np.meshgrid(self.columns, self.rows), axis=-1)


def sample_depth(depth: DepthImage, rect_px: Rect, grid: Grid) -> Samples:
    """Samples of a DepthImage in a rectangle, at the rows and columns (slices) of `grid(rect_px, shape)`."""
    height, width = depth.shape
    rows, columns = grid(rect_px, (height, width))
    depth_m = depth.part(rows, columns).astype(float) * depth.scale_m
    with np.errstate(invalid='ignore'):  # nan
        valid = (depth_m > 0) & (depth_m <= FARTHEST_M)
    return Samples(np.arange(width)[columns], np.arange(height)[rows], depth_m, valid)


class Estimator(NamedTuple):
    """Pair of functions: `sample(depth, rect_px)` returns the Samples in a rectangle, and `estimate(depth, rects_px,
    geometry, kinds)` the Box3D or Rejected of each rectangle, whose ObjectClass in `kinds` is that of `classes`.
    """

    sample: Callable[[DepthImage, Rect], Samples]
    estimate: Callable[[DepthImage, Sequence[Rect], ImageGeometry, Sequence[ObjectClass]], Boxes]
    classes: ObjectClasses = ObjectClasses()


def estimator_named(name: str, stride_px: int = 20, classes: ObjectClasses = ObjectClasses()) -> Estimator:
    """Create the estimator foreground or median; `stride_px` is the grid spacing of the estimator median, `classes` the
    table of the classes of objects.

    Raises ValueError if the name is unknown or the stride is not positive.
    """
    if stride_px < 1:
        raise ValueError('stride is %d; at least 1 expected' % stride_px)
    if name == 'foreground':
        return Estimator(functools.partial(sample_depth, grid=grid_in), estimate_foreground, classes)
    if name == 'median':
        sample = functools.partial(sample_depth, grid=functools.partial(centred_grid, stride_px=stride_px))

        def estimate(depth: DepthImage, rects_px: Sequence[Rect], geometry: ImageGeometry,
                     _kinds: Sequence[ObjectClass]) -> Boxes:
            return [estimate_median(sample(depth, rect_px), rect_px, geometry) for rect_px in rects_px]
        return Estimator(sample, estimate, classes)
    raise ValueError('estimator is %r; foreground or median expected' % name)


def estimate_boxes(depth: DepthImage, rects_px: Sequence[Rect], camera: Camera, estimator: Estimator,
                   level_from_camera: np.ndarray = LEVEL, labels: Optional[Sequence[str]] = None) -> Boxes:
    """Estimate the 3D boxes of all rectangles of one image, in their order. Not all are plausible, see `box3d`.

    `level_from_camera` is the rotation to the level frame, see `level_rotation`; by default the camera is held level.
    `labels` are the class names of the rectangles, also as in other data sets (`ObjectClasses.standard_name`), by
    default those of people. A person 3 m before the camera and 2 m before a wall, and a rectangle without depth:

    >>> depth = DepthImage(np.full((480, 640), 5000, np.uint16), 0.001)
    >>> depth.values[100:440, 280:360], depth.values[:90, :90] = 3000, 0
    >>> camera = Camera(640, 480, 600.0, 600.0, 319.5, 239.5)
    >>> person, nothing = estimate_boxes(depth, [(276, 100, 364, 440), (20, 20, 60, 80)], camera,
    ...                                  estimator_named('foreground'))
    >>> person.center_m.round(2).tolist(), person.size_m.round(2).tolist()
    ([0.0, 0.15, 3.09], [0.38, 1.7, 0.38])
    >>> nothing
    Rejected(reason='boxes without depth')
    """
    if len(rects_px) == 0:  # most images show no people
        return []
    labels = list(map(estimator.classes.standard_name, labels or [PERSON] * len(rects_px)))
    geometry = ImageGeometry(camera, depth.measured_area(), tuple(map(tuple, level_from_camera.tolist())))
    boxes = estimator.estimate(depth, rects_px, geometry, list(map(estimator.classes.of, labels)))
    return [box._replace(label=label) if isinstance(box, Box3D) and label != box.label else box
            for box, label in zip(boxes, labels)]


def level_rotation(up: Optional[Vector]) -> np.ndarray:
    """Rotation (3, 3) from the optical frame to the level frame, given the unit vector `up` (3,) in the optical frame.

    It is `LEVEL` if `up` is None, unknown, or so far from the upper edge of the image that people do not stand upright
    in it (`images.STEEP`).
    """
    if up is None:
        return LEVEL
    down = -np.asarray(up, float)
    if down[1] < STEEP:
        return LEVEL
    ahead = np.array([0.0, 0.0, 1.0]) - down[2] * down
    ahead /= np.linalg.norm(ahead)
    return np.stack((np.cross(down, ahead), down, ahead))
