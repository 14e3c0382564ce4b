"""The floor that a depth camera sees: a plane in the camera optical frame.

Convention: the normal points up, so height above the floor of a point p is normal . p + offset_m, and the offset is the
height of the camera.
"""
from typing import NamedTuple

import numpy as np

STEP_PX = 10  # the floor is fitted to every so many pixels: about 3000 points of a 640x480 image
HYPOTHESES = 300  # enough for a floor that fills a quarter of the image: 300 / 4**3 triples lie on it
SCORING_POINTS = 600
FAR_M = 6.0
MAX_TILT_RAD = np.radians(27)  # of a floor that is looked for
MOST_TILT_RAD = np.radians(50)  # of one that is known
CAMERA_HEIGHT_M = (0.12, 2.2)
MIN_POINTS, MIN_SHARE = 60, 0.04  # of the points with depth, for a plane to be credible
MAX_BELOW = 0.05  # share of the points


class Floor(NamedTuple):
    """A plane in the camera optical frame: unit `normal` (3,), upwards; `offset_m`, the camera's height above it."""

    normal: np.ndarray
    offset_m: float

    def height(self, points):
        """Height above the floor, metres, of points (..., 3) in the camera optical frame."""
        return np.dot(points, self.normal) + self.offset_m

    def row(self, camera, column, depth_m):
        """The row of the image, pixels, in which a column shows the floor at a depth; also outside the image."""
        x = (column - camera.cx) / camera.fx
        y = -(self.offset_m / depth_m + self.normal[0] * x + self.normal[2]) / self.normal[1]
        return y * camera.fy + camera.cy


def floor_from_transform(camera_from_floor):
    """The z = 0 plane of a frame as a Floor.

    Parameters
    ----------
    camera_from_floor : numpy.ndarray, (4, 4)
        Takes points of a frame whose z axis points up and whose z = 0 is the floor to the camera optical frame.
    """
    normal = camera_from_floor[:3, 2]
    return Floor(normal, -float(np.dot(normal, camera_from_floor[:3, 3])))


def check_upright(floor):
    """Raise ValueError where the floor is not below the camera and more or less level in its image."""
    if not (-floor.normal[1] > np.cos(MOST_TILT_RAD) and floor.offset_m > 0):
        raise ValueError('the floor has the normal (%.2f, %.2f, %.2f) in the camera\'s optical frame, and the camera '
                         'is %.2f m above it; about (0, -1, 0) and more than 0 expected: is that frame an optical one, '
                         'and does the z axis of the floor point up?' % (tuple(floor.normal) + (floor.offset_m,)))


def fit_floor(depth, camera, seed=0):
    """Fit the floor to a depth image: RANSAC, then least squares on what lies on the plane.

    Works for a camera upright within 25 degrees, 0.15 m to 2 m above the floor. A plane with much below it (a table, a
    shelf) is no floor, so what is below counts against it.

    Parameters
    ----------
    depth : ros_3d_bb.estimation.DepthImage
    camera : ros_3d_bb.geometry.Camera
    seed : int
        Of the random choice; the same image gives the same floor.

    Returns
    -------
    Floor or None
        None where no credible floor is seen.
    """
    points = _points(depth, camera)
    if len(points) < MIN_POINTS:
        return None
    random = np.random.RandomState(seed)
    normals, offsets = _hypotheses(points, random)
    if not len(normals):
        return None
    some = points[random.randint(0, len(points), SCORING_POINTS)]
    heights = some.dot(normals.T) + offsets
    tolerance_m = _tolerance_m(some)[:, None]
    votes = (np.abs(heights) < tolerance_m).sum(axis=0) - (heights < -2 * tolerance_m).sum(axis=0)
    best = votes.argmax()
    return _refined(Floor(normals[best], offsets[best]), points)


def _points(depth, camera):
    """Points (n, 3) on a coarse grid of the image, as far as FAR_M."""
    height, width = depth.values.shape
    u, v = np.meshgrid(np.arange(STEP_PX // 2, width, STEP_PX), np.arange(STEP_PX // 2, height, STEP_PX))
    depth_m, valid = depth.at(u, v)
    valid[valid] = depth_m[valid] < FAR_M
    return camera.deproject(np.stack((u, v), axis=-1)[valid], depth_m[valid])


def _hypotheses(points, random):
    """Planes through three points each that could be the floor: normals (n, 3), offsets (n,)."""
    a, b, c = points[random.randint(0, len(points), (3, HYPOTHESES))]
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    spread = lengths > 1e-3
    normals = normals[spread] / lengths[spread, None]
    normals *= -np.sign(normals[:, 1:2])  # up is -y in the optical frame
    offsets = -(normals * a[spread]).sum(axis=1)
    usable = _is_upright(normals, offsets)
    return normals[usable], offsets[usable]


def _is_upright(normals, offsets):
    low, high = CAMERA_HEIGHT_M
    return (-normals[..., 1] > np.cos(MAX_TILT_RAD)) & (offsets > low) & (offsets < high)


def _tolerance_m(points):
    """How far off a plane a point of it is measured: height of a point seen at a flat angle grows worse with depth."""
    return 0.015 + 0.01 * points[:, 2]


def _refined(floor, points):
    """The plane that fits the points on a floor best, or None where it is not credible."""
    for share in (1.0, 0.6, 0.4, 0.4):  # narrower, as the foot of a wall pulls the plane up
        near = points[np.abs(floor.height(points)) < share * _tolerance_m(points)]
        if len(near) < max(MIN_POINTS, MIN_SHARE * len(points)):
            return None
        center = near.mean(axis=0)
        normal = np.linalg.svd((near - center) / near[:, 2:], full_matrices=False)[2][2]
        normal *= -np.sign(normal[1])
        floor = Floor(normal, -float(normal.dot(center)))
    below = np.mean(floor.height(points) < -3 * _tolerance_m(points))
    return floor if _is_upright(floor.normal, floor.offset_m) and below < MAX_BELOW else None
