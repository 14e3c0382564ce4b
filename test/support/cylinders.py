"""Depth images of upright cylinders on a floor, by ray casting: an oracle apart from the package's renderer."""
from typing import NamedTuple

import numpy as np

from ros_3d_bb.camera.camera_model import OPTICAL_ROTATION, transform_from
from ros_3d_bb.camera.depth_image import DepthImage

FARTHEST_M = 12.0


class Cylinder(NamedTuple):
    """An upright cylinder on the floor of the map, metres. The default is about a person."""

    x_m: float
    y_m: float
    radius_m: float = 0.22
    height_m: float = 1.7


def mounted(height_m, pitch_deg=0.0, roll_deg=0.0, yaw_deg=0.0):
    """The transform of a camera above the origin, which looks along x, then turned left, pitched down and rolled."""
    transform = transform_from((0, 0, height_m), (0, 0, 0, 1))
    for axis, angle_deg in ((2, yaw_deg), (1, pitch_deg), (0, roll_deg)):
        half = np.radians(angle_deg) / 2
        quaternion = np.eye(4)[axis] * np.sin(half) + np.eye(4)[3] * np.cos(half)
        transform = transform.dot(transform_from((0, 0, 0), quaternion))
    return transform.dot(transform_from((0, 0, 0), OPTICAL_ROTATION))


def render(camera, map_from_camera, cylinders):
    """What a camera without distortion sees.

    Returns
    -------
    depth : DepthImage
    shown : numpy.ndarray of int, (height, width)
        The number of the cylinder that a pixel shows, -1 for none.
    """
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    rays = np.stack(((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)), axis=-1)
    origin_m, directions = map_from_camera[:3, 3], rays.dot(map_from_camera[:3, :3].T)
    depth_m, shown = np.full(u.shape, FARTHEST_M), np.full(u.shape, -1)
    with np.errstate(all='ignore'):  # rays that hit nothing
        _hit(depth_m, shown, -origin_m[2] / directions[..., 2], True, -1)
        for number, cylinder in enumerate(cylinders):
            for at_m, is_hit in _surfaces(cylinder, origin_m, directions):
                _hit(depth_m, shown, at_m, is_hit, number)
    return DepthImage(depth_m.astype(np.float32), 1.0), shown


def rect_of(shown, number):
    """The rectangle (x1, y1, x2, y2) around the pixels that show a cylinder."""
    v, u = np.nonzero(shown == number)
    return int(u.min()), int(v.min()), int(u.max()) + 1, int(v.max()) + 1


def _hit(depth_m, shown, at_m, is_hit, number):
    nearest = is_hit & (at_m > 0) & (at_m < depth_m)
    depth_m[nearest], shown[nearest] = at_m[nearest], number


def _surfaces(cylinder, origin_m, directions):
    """Depths at which rays meet the wall and the upper end of a cylinder, and whether they do."""
    offset_m = origin_m[:2] - cylinder[:2]
    squared = (directions[..., :2] ** 2).sum(axis=-1)
    half = directions[..., :2].dot(offset_m)
    discriminant = half ** 2 - squared * (offset_m.dot(offset_m) - cylinder.radius_m ** 2)
    wall_m = (-half - np.sqrt(discriminant)) / squared
    height_m = origin_m[2] + wall_m * directions[..., 2]
    yield wall_m, (discriminant > 0) & (height_m >= 0) & (height_m <= cylinder.height_m)
    top_m = (cylinder.height_m - origin_m[2]) / directions[..., 2]
    beside_m = np.linalg.norm(offset_m + top_m[..., None] * directions[..., :2], axis=-1)
    yield top_m, beside_m < cylinder.radius_m
