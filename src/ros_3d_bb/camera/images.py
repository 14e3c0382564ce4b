"""The images of an RGB-D camera: depth images, frames of depth and colour, and their rotation by quarter turns.

Convention: `turns` is the number of clockwise quarter turns after which an image is upright, 0..3; negative ones turn
it back: the camera may be mounted in portrait orientation or upside down. Edges of boxes are (x1, y1, x2, y2) in
pixels, x2 and y2 exclusive.
"""
import functools
from typing import Any, NamedTuple, Optional, Tuple

import numpy as np

from ros_3d_bb.camera.camera_model import OPTICAL_ROTATION, Camera, Vector, transform_from
from ros_3d_bb.camera.distortion import EQUIDISTANT

FARTHEST_M = 100.0  # beyond the range of any depth camera
WIDEST_BORDER, BORDER_STEP = 0.05, 12  # of images without depth: share of the image; pixels between samples
STEEP = 0.34  # sine of the angle between the optical axis and the vertical: 20 degrees
AUTO = 'auto'
TURNED_FROM_CAMERA = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # optical frames, one turn


class DepthImage(NamedTuple):
    """A depth image: raw `values` (height, width) of any numeric type; depth in metres is `values` times `scale_m`.

    Depths that are zero, negative, nan, inf or more than `FARTHEST_M` are invalid. `area_px`: measured area, if known.
    """

    values: np.ndarray
    scale_m: float
    area_px: Optional[Tuple[int, int, int, int]] = None

    @property
    def shape(self) -> Tuple[int, ...]:
        return self.values.shape

    def part(self, rows: slice, columns: slice) -> np.ndarray:
        return self.values[rows, columns]

    def at(self, u: np.ndarray, v: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return the depth, metres, at the pixels in columns u and rows v (arrays of int), and whether it is valid."""
        depth_m = self.values[v, u].astype(float) * self.scale_m
        with np.errstate(invalid='ignore'):  # nan, of which the numpy of Ubuntu 20.04 warns
            return depth_m, (depth_m > 0) & (depth_m <= FARTHEST_M)

    def measured_area(self) -> Tuple[int, int, int, int]:
        """Rectangle (x1, y1, x2, y2) of the image without its black border, where registration leaves no depth.

        A border of more than `WIDEST_BORDER` of the width or height is not due to registration: its background is far
        away.
        """
        if self.area_px is not None:
            return self.area_px
        columns, rows = self.values[::BORDER_STEP].T, self.values[:, ::BORDER_STEP]
        borders = []
        with np.errstate(invalid='ignore'):  # nan
            for lines in (columns, rows, columns[::-1], rows[::-1]):
                border = 0
                if not np.count_nonzero(lines[0] > 0):
                    has_depth = lines[:int(WIDEST_BORDER * len(lines)) + 1] > 0
                    border = int(has_depth.argmax()) // has_depth.shape[1]
                borders.append(border)
        left, top, right, bottom = borders
        return left, top, len(columns) - right, len(rows) - bottom


class RgbdFrame(NamedTuple):
    """A depth image with the pixels of the colour image, both upright.

    The optical frame of the upright image is that of the received image, turned about the optical axis.
    """

    stamp_ns: int  # of the colour image
    depth_stamp_ns: int
    frame_id: str  # optical frame of the received image
    camera: Camera  # of the upright image
    depth: Any  # DepthImage or RegisteredDepth
    depth_unit_m: float  # metres per unit of the received depth image
    color: Optional[np.ndarray] = None  # RGB (height, width, 3), uint8
    turns: int = 0  # clockwise quarter turns from the received to the upright image
    camera_from_floor: Optional[np.ndarray] = None  # (4, 4), optical frame of the upright image from one with z up
    is_floor_known: bool = True  # whether this is ~floor_frame, in which the height of the floor is known

    @property
    def up(self) -> Optional[Tuple[float, float, float]]:
        """Unit vector that points up, in the optical frame of the upright image, as a tuple; None if it is unknown."""
        return None if self.camera_from_floor is None else tuple(self.camera_from_floor[:3, 2].tolist())

    @property
    def received(self) -> 'RgbdFrame':
        return self.turned(-self.turns)

    def turned(self, turns: int) -> 'RgbdFrame':
        if not turns:
            return self
        camera_from_floor = self.camera_from_floor
        if camera_from_floor is not None:
            camera_from_floor = camera_from_floor.copy()
            camera_from_floor[:3] = turned_rotation(turns).dot(camera_from_floor[:3])
        return self._replace(camera=turned_camera(self.camera, turns), depth=turned_depth(self.depth, turns),
                             color=None if self.color is None else turned_image(self.color, turns),
                             turns=self.turns + turns, camera_from_floor=camera_from_floor)

    def upright_rects(self, rects_px: np.ndarray) -> np.ndarray:
        """Rectangles (n, 4) of the received image in the upright image. Inverse of `received_rects`."""
        return turned_boxes(rects_px, self.turns, *turned_camera(self.camera, -self.turns)[:2])

    def received_rects(self, rects_px: np.ndarray) -> np.ndarray:
        """Rectangles (n, 4) of the upright image in the received image."""
        return turned_boxes(rects_px, -self.turns, *self.camera[:2])


def turns_for(image_rotation: str, up: Optional[Vector]) -> int:
    """Quarter turns that make the images of a camera upright: `image_rotation`, clockwise degrees as text, or for
    `AUTO` those of the unit vector `up` (3,) in the optical frame, 0 if it is unknown (None).
    """
    if image_rotation != AUTO:
        return int(image_rotation) // 90
    return 0 if up is None else quarter_turns(up)


def quarter_turns(up: Vector) -> int:
    """Number of clockwise quarter turns after which the image is upright; `up` (3,) is in the optical frame.

    0 for an upright camera, 1 if the left edge of the image is up, 2 if the camera is upside down, 3 if the right edge
    is up. Also 0 for a camera that points up or down within `STEEP`: people have no upright direction in its image.
    """
    x_up, y_up = up[:2]
    if np.hypot(x_up, y_up) < STEEP:
        return 0
    if abs(x_up) > abs(y_up):
        return 3 if x_up > 0 else 1
    return 2 if y_up > 0 else 0


def turned_image(values: np.ndarray, turns: int) -> np.ndarray:
    """A view of an image (height, width, ...) that is turned clockwise."""
    return np.rot90(values, -turns) if turns else values


def turned_depth(depth: Any, turns: int) -> Any:
    """A DepthImage or RegisteredDepth that is turned clockwise; of the latter, the whole image is registered."""
    if not turns:
        return depth
    area_px = turned_boxes(np.array([depth.measured_area()]), turns, *depth.shape[::-1])[0].tolist()
    return DepthImage(turned_image(depth.values, turns), depth.scale_m, tuple(area_px))


def turned_rotation(turns: int) -> np.ndarray:
    """Rotation (3, 3) from the optical frame of an image to that of the turned image."""
    return np.linalg.matrix_power(TURNED_FROM_CAMERA, turns)


def mounted_camera(height_m: float, tilt_rad: float, turns: int, roll_rad: float = 0.0) -> np.ndarray:
    """Pose (4, 4) of the optical frame of a camera that looks along x, above the origin of a frame whose z points up.

    Angles are as in REP 103: with a positive `tilt_rad`, its pitch, the camera looks down, and with a positive
    `roll_rad` its right side is lower. It is also rolled so that `turns` quarter turns make its images upright.
    """
    pitched = transform_from((0, 0, height_m), (0, np.sin(tilt_rad / 2), 0, np.cos(tilt_rad / 2)))
    rolled = transform_from((0, 0, 0), (np.sin(roll_rad / 2), 0, 0, np.cos(roll_rad / 2)))
    pose = pitched.dot(rolled).dot(transform_from((0, 0, 0), OPTICAL_ROTATION))
    pose[:3, :3] = pose[:3, :3].dot(turned_rotation(turns))
    return pose


@functools.lru_cache(maxsize=16)
def turned_camera(camera: Camera, turns: int) -> Camera:
    """The `camera_model.Camera` of the turned image, including its lens distortion."""
    for _turn in range(turns % 4):
        distortion = camera.distortion
        if distortion and camera.distortion_model != EQUIDISTANT:
            k1, k2, p1, p2 = distortion[:4]
            distortion = (k1, k2, p2, -p1) + distortion[4:]  # (p2, p1) is a vector in the image plane
        camera = camera._replace(width=camera.height, height=camera.width, fx=camera.fy, fy=camera.fx,
                                 cx=camera.height - 1 - camera.cy, cy=camera.cx, distortion=distortion)
    return camera


def turned_boxes(boxes: np.ndarray, turns: int, width: int, height: int) -> np.ndarray:
    """Boxes (n, 4) of an image of `width` x `height` pixels, in the turned image."""
    for _turn in range(turns % 4):
        x1, y1, x2, y2 = boxes.T
        boxes = np.stack((height - y2, x1, height - y1, x2), axis=1)
        width, height = height, width
    return boxes
