"""Ground plane in the camera optical frame.

Convention: the normal points up. The height of a point p above the floor is normal . p + offset_m, and the offset is
the height of the camera.
"""
from typing import NamedTuple

import numpy as np

STEP_PX = 10  # sampling distance: about 3000 points of a 640x480 image
HYPOTHESES = 300  # enough for a floor that fills a quarter of the image, which then contains 300 / 4**3 triples
SCORING_POINTS = 600
FAR_M = 6.0
MAX_FITTED_TILT_RAD = np.radians(27)
MAX_KNOWN_TILT_RAD = np.radians(50)  # of a floor that is known from tf
CAMERA_HEIGHT_M = (0.12, 2.2)
MIN_POINTS, MIN_SHARE = 60, 0.04  # inliers of a credible plane: number, and share of the points with depth
MAX_BELOW = 0.05  # maximum share of the points below a credible plane


class Floor(NamedTuple):
    """A plane in the camera optical frame: unit `normal` (3,), upwards; `offset_m`, the camera's height above it."""

    normal: np.ndarray
    offset_m: float

    def height(self, points):
        """Height above the floor, in metres, of points (..., 3) in the camera optical frame."""
        return np.dot(points, self.normal) + self.offset_m

    def row(self, camera, column, depth_m):
        """Image row, in pixels, where a column shows the floor at a depth. It may lie outside the image."""
        x = (column - camera.cx) / camera.fx
        y = -(self.offset_m / depth_m + self.normal[0] * x + self.normal[2]) / self.normal[1]
        return y * camera.fy + camera.cy


def floor_from_transform(camera_from_floor):
    """Floor from the transform (4, 4) to the camera optical frame from a frame whose z = 0 plane is the floor, z up."""
    normal = camera_from_floor[:3, 2]
    return Floor(normal, -float(np.dot(normal, camera_from_floor[:3, 3])))


def check_upright(floor):
    """Raise ValueError if the floor is not below the camera or the camera is tilted by more than 50 degrees."""
    if not (-floor.normal[1] > np.cos(MAX_KNOWN_TILT_RAD) and floor.offset_m > 0):
        raise ValueError('the normal of the floor is (%.2f, %.2f, %.2f) in the camera frame, and the camera is %.2f m '
                         'above the floor; about (0, -1, 0) and more than 0 expected. Check that the camera frame is '
                         'an optical frame and that the z axis of the floor frame points up'
                         % (tuple(floor.normal) + (floor.offset_m,)))


def fit_floor(depth, camera):
    """Fit the floor to a depth image by RANSAC and least squares on the inliers.

    The camera must be 0.15 m to 2 m above the floor and tilted by less than 25 degrees. Points below a plane count
    against it, so that tables and shelves are not detected as the floor. The same image always gives the same floor.
    Returns None if no credible floor is visible.
    """
    points = _points(depth, camera)
    if len(points) < MIN_POINTS:
        return None
    random = np.random.RandomState(0)
    normals, offsets = _hypotheses(points, random)
    if not len(normals):
        return None

    sample = points[random.randint(0, len(points), SCORING_POINTS)]
    heights_m = sample.dot(normals.T) + offsets
    tolerance_m = _tolerance_m(sample)[:, None]
    scores = (np.abs(heights_m) < tolerance_m).sum(axis=0) - (heights_m < -2 * tolerance_m).sum(axis=0)
    best = scores.argmax()
    return _refine(Floor(normals[best], offsets[best]), points)


def _points(depth, camera):
    """Points (n, 3) on a coarse grid of the image, up to FAR_M."""
    height, width = depth.shape
    u, v = np.meshgrid(np.arange(STEP_PX // 2, width, STEP_PX), np.arange(STEP_PX // 2, height, STEP_PX))
    depth_m, valid = depth.at(u, v)
    valid[valid] = depth_m[valid] < FAR_M
    return camera.deproject(np.stack((u, v), axis=-1)[valid], depth_m[valid])


def _hypotheses(points, random):
    """Candidate floor planes through three random points each: normals (n, 3), offsets (n,)."""
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
    return ((-normals[..., 1] > np.cos(MAX_FITTED_TILT_RAD))
            & (offsets > CAMERA_HEIGHT_M[0]) & (offsets < CAMERA_HEIGHT_M[1]))


def _tolerance_m(points):
    """Maximum distance of inliers from the plane. It grows with depth, as heights at flat viewing angles do."""
    return 0.015 + 0.01 * points[:, 2]


def _refine(floor, points):
    """Fit the plane to its inliers by least squares. Returns None if the result is not credible."""
    for share in (1.0, 0.6, 0.4, 0.4):  # shrink the tolerance: the foot of a wall pulls the plane up
        near = points[np.abs(floor.height(points)) < share * _tolerance_m(points)]
        if len(near) < max(MIN_POINTS, MIN_SHARE * len(points)):
            return None
        center = near.mean(axis=0)
        normal = np.linalg.svd((near - center) / near[:, 2:], full_matrices=False)[2][2]
        normal *= -np.sign(normal[1])
        floor = Floor(normal, -float(normal.dot(center)))
    below = np.mean(floor.height(points) < -3 * _tolerance_m(points))
    return floor if _is_upright(floor.normal, floor.offset_m) and below < MAX_BELOW else None
