"""Which measurements of other sensors show tracked people. Metres."""
import functools

import numpy as np

from ros_3d_bb.camera.camera_model import transform_points
from ros_3d_bb.core.object_classes import PERSON, PERSON_CLASS
from ros_3d_bb.planning.planner_view import covariances_after, position_after

BEHIND_M = 0.05  # smallest depth that is projected
# Duration of a part of a scan that is taken at one time, chosen: at 1.5 rad/s, half of it is 0.015 rad; and longest
# duration of a scan: no laser is as slow.
PART_S, LONGEST_SCAN_S = 0.02, 1.0


def cylinders_of(tracks, ahead_s, margin_m):
    """Upright cylinders (n, 5) that contain people `ahead_s` seconds after their stamp: x, y, radius, lower and upper
    end.

    The radius is that of the body, a margin and the standard deviation of the predicted position. People reach the
    floor, also where furniture hides their legs from the camera: it is not further below their heads than the tallest
    person is tall.
    """
    rows = []
    for track in tracks:
        if track.label == PERSON:
            x, y, z = position_after(track, ahead_s)
            std_m = np.sqrt(np.maximum(np.linalg.eigvalsh(covariances_after(track, [ahead_s])[0, :2, :2]), 0)[-1])
            half_m = track.size_m[2] / 2
            low_m = z + half_m - max(PERSON_CLASS.largest_m[1], track.size_m[2])
            rows.append((x, y, track.size_m[0] / 2 + margin_m + std_m, low_m - margin_m, z + half_m + margin_m))
    return np.reshape(rows, (-1, 5))


def are_inside(points_m, cylinders):
    """Whether points (..., 3) lie in one of the cylinders, bool (...); not for nan."""
    found = np.zeros(points_m.shape[:-1], bool)
    with np.errstate(invalid='ignore'):
        for x, y, radius_m, low_m, high_m in cylinders:
            is_near = (points_m[..., 0] - x) ** 2 + (points_m[..., 1] - y) ** 2 < radius_m ** 2
            found |= is_near & (points_m[..., 2] > low_m) & (points_m[..., 2] < high_m)
    return found


def scan_points(ranges_m, first_angle, step):
    """Points (n, 3) of a planar scan in the frame of the laser; nan for beams without a range."""
    ranges_m = np.where(np.isfinite(ranges_m), ranges_m, np.nan)
    angles = first_angle + step * np.arange(len(ranges_m))
    return np.column_stack((ranges_m * np.cos(angles), ranges_m * np.sin(angles), 0 * ranges_m))


def scan_parts(count, increment_s):
    """Parts of a scan of `count` beams, `increment_s` apart, that are measured at about the same time: (slice, time
    after the first beam in seconds). A single one if the time between beams is not known, or implausible."""
    if not 0 < count * increment_s < LONGEST_SCAN_S:
        return [(slice(None), 0.0)]
    length = max(int(PART_S / increment_s), 1)
    return [(slice(first, first + length), (first + (min(length, count - first) - 1) / 2) * increment_s)
            for first in range(0, count, length)]


def pixels_inside(depth, camera, fixed_from_camera, cylinders):
    """Which pixels of a DepthImage of a Camera show points in the cylinders of the fixed frame, bool (h, w)."""
    found = np.zeros(depth.shape, bool)
    x, y = _rays_of(camera)
    for cylinder in cylinders:
        part = _image_part(camera, np.linalg.inv(fixed_from_camera), cylinder)
        depth_m = depth.values[part] * depth.scale_m
        points_m = np.stack((x[part] * depth_m, y[part] * depth_m, depth_m), axis=-1)
        found[part] |= are_inside(transform_points(fixed_from_camera, points_m), [cylinder]) & (depth_m > 0)
    return found


@functools.lru_cache(maxsize=4)
def _rays_of(camera):
    """`Camera.rays` of all pixels, (h, w) each. With lens distortion, they take much longer than the rest."""
    return np.broadcast_arrays(*camera.rays(np.arange(camera.width), np.arange(camera.height)[:, np.newaxis]))


def _image_part(camera, camera_from_fixed, cylinder):
    """Slices of the rows and columns that contain a cylinder; the whole image if it reaches behind the camera."""
    x, y, radius_m, low_m, high_m = cylinder
    corners_m = np.array([(x + dx, y + dy, z) for dx in (-radius_m, radius_m) for dy in (-radius_m, radius_m)
                          for z in (low_m, high_m)])
    corners_m = transform_points(camera_from_fixed, corners_m)
    if corners_m[:, 2].max() < BEHIND_M:
        return slice(0, 0), slice(0, 0)
    pixels = camera.project(corners_m)
    if corners_m[:, 2].min() < BEHIND_M or not np.isfinite(pixels).all():
        return slice(None), slice(None)
    (left, top), (right, bottom) = np.floor(pixels.min(axis=0)), np.ceil(pixels.max(axis=0)) + 1
    return (slice(int(np.clip(top, 0, camera.height)), int(np.clip(bottom, 0, camera.height))),
            slice(int(np.clip(left, 0, camera.width)), int(np.clip(right, 0, camera.width))))
