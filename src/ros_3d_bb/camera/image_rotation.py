"""Rotation of images by quarter turns, for cameras that are mounted in portrait orientation or upside down.

Convention: `turns` is the number of clockwise quarter turns after which an image is upright, 0..3; negative ones turn
it back. Edges of boxes are (x1, y1, x2, y2) in pixels, x2 and y2 exclusive.
"""
import functools

import numpy as np

from ros_3d_bb.camera.camera_model import OPTICAL_ROTATION, quarter_turns, transform_from
from ros_3d_bb.camera.depth_image import DepthImage
from ros_3d_bb.camera.distortion import EQUIDISTANT

AUTO = 'auto'
TURNED_FROM_CAMERA = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # optical frames, one turn


def turns_for(image_rotation, up):
    """Quarter turns that make the images of a camera upright: `image_rotation`, clockwise degrees as text, or for
    `AUTO` those of the unit vector `up` (3,) in the optical frame, 0 if it is unknown (None).
    """
    if image_rotation != AUTO:
        return int(image_rotation) // 90
    return 0 if up is None else quarter_turns(up)


def turned_image(values, turns):
    """A view of an image (height, width, ...) that is turned clockwise."""
    return np.rot90(values, -turns) if turns else values


def turned_depth(depth, turns):
    """A DepthImage or RegisteredDepth that is turned clockwise; of the latter, the whole image is registered."""
    if not turns:
        return depth
    area_px = turned_boxes(np.array([depth.measured_area()]), turns, *depth.shape[::-1])[0].tolist()
    return DepthImage(turned_image(depth.values, turns), depth.scale_m, tuple(area_px))


def turned_rotation(turns):
    """Rotation (3, 3) from the optical frame of an image to that of the turned image."""
    return np.linalg.matrix_power(TURNED_FROM_CAMERA, turns)


def mounted_camera(height_m, tilt_rad, turns, roll_rad=0.0):
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
def turned_camera(camera, turns):
    """The `camera_model.Camera` of the turned image, including its lens distortion."""
    for _turn in range(turns % 4):
        distortion = camera.distortion
        if distortion and camera.distortion_model != EQUIDISTANT:
            k1, k2, p1, p2 = distortion[:4]
            distortion = (k1, k2, p2, -p1) + distortion[4:]  # (p2, p1) is a vector in the image plane
        camera = camera._replace(width=camera.height, height=camera.width, fx=camera.fy, fy=camera.fx,
                                 cx=camera.height - 1 - camera.cy, cy=camera.cx, distortion=distortion)
    return camera


def turned_boxes(boxes, turns, width, height):
    """Boxes (n, 4) of an image of `width` x `height` pixels, in the turned image."""
    for _turn in range(turns % 4):
        x1, y1, x2, y2 = boxes.T
        boxes = np.stack((height - y2, x1, height - y1, x2), axis=1)
        width, height = height, width
    return boxes
