"""3D boxes of objects, and the geometry of the image they are estimated from.

Conventions: a rectangle (x1, y1, x2, y2) contains the pixels x1 <= u < x2, y1 <= v < y2. Positions are in the camera
optical frame, metres. The level frame of a camera has the same origin, x horizontally to the right, y down and z
horizontally ahead; `level_from_camera` (3, 3) rotates the optical frame to it.
"""
from typing import Any, NamedTuple, Optional, Sequence, Tuple, Union

import numpy as np

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.core.object_classes import MAX_COORDINATE_M, MAX_SIZE_M, PERSON

Rect = Tuple[int, ...]  # x1, y1, x2, y2
# Reasons why a rectangle gets no 3D box, each the event of its counter.
NO_DEPTH, NO_RAY = 'boxes without depth', 'boxes without a viewing ray'  # of the rectangle, or its lens model
NO_LAYER = 'boxes without a depth layer'  # what has depth is scattered, or is beside the object
UNKNOWN = 'boxes with depth around the object only'  # as of black clothes before a wall
HIDDEN = 'boxes behind others'  # objects with 3D boxes are in front of all depth
REPEATED = 'second boxes of an object'
REASONS = NO_DEPTH, NO_RAY, NO_LAYER, UNKNOWN, HIDDEN, REPEATED
LEVEL = np.eye(3)  # of a camera that is held level
LEVEL_AXES = tuple(map(tuple, LEVEL.tolist()))


class Edges(NamedTuple):
    """Whether the image border truncates an object at each edge of its rectangle."""

    left: bool
    top: bool
    right: bool
    bottom: bool


class ImageGeometry(NamedTuple):
    """Geometry of one image: its camera, the part of it with depth (see `DepthImage.measured_area`), and the axes of
    the level frame in the optical frame, the rows of `level_rotation`.
    """

    camera: Camera
    area_px: Rect
    level_axes: Tuple[Tuple[float, float, float], ...] = LEVEL_AXES


class Box3D(NamedTuple):
    """An upright cylinder, with quality measures.

    `center_m` (3,) in the camera optical frame and `size_m` (width, height, width) are in metres; `rect_px` is the
    source rectangle, and `truncated_edges` are its `Edges`; `support` is the share 0..1 of the samples with depth that
    belong to its depth layer; `covariance_m2` (3, 3) is that of the centre, None if unknown; `label` is the class name,
    and `score` is that of the rectangle, 0..1, 0 if unknown; `largest_m` are the upper bounds of width and height;
    `appearance` are the colours of the clothes (`appearance.appearance_of`), None if unknown.
    """

    center_m: np.ndarray
    size_m: np.ndarray
    rect_px: Rect
    support: float
    truncated_edges: Tuple[bool, ...]
    covariance_m2: Optional[Any] = None
    label: str = PERSON
    score: float = 0.0
    largest_m: Tuple[float, float] = (MAX_SIZE_M, MAX_SIZE_M)
    appearance: Optional[Tuple[float, ...]] = None

    @property
    def truncated(self) -> bool:
        """Whether the image border truncates the object."""
        return any(self.truncated_edges)

    @property
    def is_plausible(self) -> bool:
        """Whether the centre is nearer than `MAX_COORDINATE_M`, and width and height are between 0 and `largest_m`."""
        x_m, y_m, z_m = self.center_m.tolist()
        (width_m, height_m), (widest_m, tallest_m) = self.size_m[:2].tolist(), self.largest_m
        return (0 < width_m < widest_m and 0 < height_m < tallest_m
                and abs(x_m) < MAX_COORDINATE_M and abs(y_m) < MAX_COORDINATE_M and abs(z_m) < MAX_COORDINATE_M)


class Rejected(NamedTuple):
    """In place of the Box3D of a rectangle without an estimate: the reason, one of `REASONS`."""

    reason: str

    @property
    def is_plausible(self) -> bool:
        return False


def plausible(box: Union[Box3D, Rejected]) -> Optional[Box3D]:
    """The Box3D if it is plausible; otherwise, and if the rectangle is Rejected, None."""
    return box if isinstance(box, Box3D) and box.is_plausible else None


def without_distortion(rects_px: Sequence[Rect], camera: Camera) -> Sequence[Sequence[float]]:
    """Undistort rectangles (x1, y1, x2, y2) by the midpoints of their edges; nan if one has no undistorted position.

    Outside the image, where the distortion is unknown, the distortion at the image border is used.
    """
    if not camera.distortion_model:
        return rects_px
    x1, y1, x2, y2 = np.array(rects_px).T
    x, y = (x1 + x2) / 2.0, (y1 + y2) / 2.0
    middles = np.stack((x1, y, x, y1, x2, y, x, y2), axis=1).reshape(-1, 4, 2)
    inside = np.clip(middles, 0, (camera.width, camera.height))
    flat_px = middles + camera.undistort(inside) - inside
    return flat_px[:, (0, 1, 2, 3), (0, 1, 0, 1)].tolist()
