"""Ground plane in the camera optical frame.

Convention: the normal points up. The height of a point p above the floor is normal . p + offset_m, and the offset is
the height of the camera.
"""
from typing import NamedTuple

import numpy as np

from ros_3d_bb.detection.depth.person_clusters import DepthPeopleParams

STEP_PX = 10  # sampling distance: about 3000 points of a 640x480 image
HYPOTHESES, REACH = 300, 16  # number of triples of points; their extent in sampling distances, less for half of them
SCORING_POINTS = 400
BELOW_WEIGHT = 10  # points below a plane count this much against it: a table may fill more of the image than the floor
FAR_M = 8.0
MAX_ROLL_RAD = MAX_UPWARDS_RAD = np.radians(27)  # of a camera whose floor is fitted
MAX_KNOWN_TILT_RAD = np.radians(65)  # of a floor that is known from tf
ON_PLANE = 0.4  # of the tolerance, after the plane is refined
MIN_POINTS, MIN_SHARE = 60, 0.04  # inliers of a credible plane: number, and share of the points with depth
MAX_ABOVE = 0.5  # maximum number of points just above a credible plane per inlier; 1 for one that cuts other surfaces
MAX_BELOW = 0.05  # maximum share of the points below a credible plane
MAX_LEVERAGE = 14  # maximum distance of the visible floor from the camera, in standard deviations of its points
PARALLEL, HIGHER_M = np.cos(np.radians(3)), 0.1  # a table: parallel to the floor, and higher by at least this
MAX_HIGHER = 100  # images in a row with a higher plane only, after which the camera must have been lowered
MORE_POINTS = 1.2  # on a fitted plane than on the floor from tf, if it is to replace it; chosen
MAX_STEP_M = 0.3  # of a fitted plane above the floor from tf; chosen: seats and tables are higher
CONFIRMED, MIN_CONFIRMING = 0.6, 20  # least share and number of the points near a floor on it, not to fit a plane

# The same random numbers serve for all images: the points of the sample, as shares of their number, and triples.
_RANDOM = np.random.RandomState(0)
SAMPLE, FIRST = _RANDOM.rand(SCORING_POINTS), _RANDOM.rand(HYPOTHESES)
SHIFTS = _RANDOM.randint(-REACH, REACH + 1, (2, 2, HYPOTHESES))  # of the rows and columns of the two other points
SHIFTS[..., ::2] //= 3


class Floor(NamedTuple):
    """A plane in the camera optical frame: unit `normal` (3,), upwards; `offset_m`, the camera's height above it."""

    normal: np.ndarray
    offset_m: float

    def height(self, points):
        """Height above the floor, in metres, of points (..., 3) in the camera optical frame."""
        return np.dot(points, self.normal) + self.offset_m

    def row(self, camera, column, depth_m):
        """Image row, in pixels, where a column shows the floor at a depth. It may lie outside the image."""
        x = camera.rays(column, camera.cy)[0]
        y = -(self.offset_m / depth_m + self.normal[0] * x + self.normal[2]) / self.normal[1]
        row = camera.project(np.array((x, y, 1.0)))[1]
        return float(row) if np.isfinite(row) else camera.height  # beyond the fold of a distortion


class CameraPose(NamedTuple):
    """Pose of a camera above the floor; the angles are those of `camera.images.mounted_camera`."""

    height_m: float
    tilt_rad: float
    roll_rad: float


def camera_pose_above(floors):
    """CameraPose by the median of the Floors that were fitted to images of an upright camera."""
    x, y, z = np.median([floor.normal for floor in floors], axis=0).tolist()
    return CameraPose(float(np.median([floor.offset_m for floor in floors])), float(np.arctan2(-z, np.hypot(x, y))),
                      float(np.arctan2(-x, -y)))


def floor_from_transform(camera_from_floor):
    """Floor from the transform (4, 4) to the camera optical frame from a frame whose z = 0 plane is the floor, z up."""
    normal = camera_from_floor[:3, 2]
    return Floor(normal, -float(np.dot(normal, camera_from_floor[:3, 3])))


def check_upright(floor):
    """Raise ValueError if the floor is not below the camera or the camera is tilted by more than 65 degrees."""
    if not (-floor.normal[1] > np.cos(MAX_KNOWN_TILT_RAD) and floor.offset_m > 0):
        raise ValueError('the normal of the floor is (%.2f, %.2f, %.2f) in the camera frame, and the camera is %.2f m '
                         'above the floor; about (0, -1, 0) and more than 0 expected. Check that the camera frame is '
                         'an optical frame and that the z axis of the floor frame points up'
                         % (tuple(floor.normal) + (floor.offset_m,)))


class FittedFloor(object):
    """The floor in successive images of a camera at a fixed height, `floor`; None before it was visible.

    If the floor is hidden, the plane of a table or a bed may be fitted instead. A fitted plane that is parallel to the
    last floor and higher is therefore ignored for `MAX_HIGHER` images in a row.
    """

    def __init__(self):
        self.floor, self._higher = None, 0

    def update(self, depth, camera, params):
        """Fit the floor to the next image, see `fit_floor`. Returns the floor."""
        fitted = fit_floor(depth, camera, params)
        if fitted is None:
            return self.floor
        self._higher = self._higher + 1 if self._is_higher(fitted) else 0
        if not 0 < self._higher <= MAX_HIGHER:
            self.floor, self._higher = fitted, 0
        return self.floor

    def _is_higher(self, plane):
        return (self.floor is not None and plane.normal.dot(self.floor.normal) > PARALLEL
                and plane.offset_m < self.floor.offset_m - HIGHER_M)


class KnownFloor(object):
    """The floor from tf in successive images, corrected where the depth images contradict it.

    tf may be wrong by the mount, or by the suspension of a robot that brakes. A fitted plane with more points on it
    replaces the floor from tf, unless it is higher, as a table. The correction holds until an image refutes it.
    """

    def __init__(self):
        self._turn, self._rise_m = np.zeros(3), 0.0

    def of(self, known):
        """The corrected Floor, given the one from tf: `known` itself, unless an image contradicted it."""
        if not self._turn.any() and not self._rise_m:
            return known
        normal = known.normal + self._turn
        return Floor(normal / np.linalg.norm(normal), known.offset_m + self._rise_m)

    def correct(self, known, depth, camera, params):
        """Compare the floor from tf with a depth image, after `is_confirmed` failed. Returns the corrected Floor."""
        points, cells = _points(depth, camera)
        fitted = _fit(points, cells, params)
        if fitted is not None and not _is_seat(fitted, known, points):
            is_better = _support(fitted, points) > MORE_POINTS * _support(known, points)
            self._turn, self._rise_m = ((fitted.normal - known.normal, fitted.offset_m - known.offset_m) if is_better
                                        else (np.zeros(3), 0.0))
        return self.of(known)


def is_confirmed(height_m, depth_m, floor):
    """Whether the points (n,) near a Floor, of which the heights above it and the depths are known, are on it."""
    heights = np.abs(height_m) / _tolerance_m(depth_m, floor.offset_m)
    on_plane = np.count_nonzero(heights < ON_PLANE)
    return on_plane > MIN_CONFIRMING and on_plane > CONFIRMED * np.count_nonzero(heights < 2.5)


def _support(floor, points):
    """Number of the points on a plane, less those below it."""
    heights = floor.height(points) / _tolerance_m(points[:, 2], floor.offset_m)
    return np.count_nonzero(np.abs(heights) < ON_PLANE) - BELOW_WEIGHT * np.count_nonzero(heights < -2)


def _is_seat(plane, floor, points):
    """Whether a plane is so high above the floor from tf that it is a seat or a table."""
    on_plane = points[np.abs(plane.height(points)) < ON_PLANE * _tolerance_m(points[:, 2], plane.offset_m)]
    return floor.height(on_plane.mean(axis=0)) > MAX_STEP_M


def fit_floor(depth, camera, params=DepthPeopleParams()):
    """Fit the floor to a depth image by RANSAC and least squares on the inliers.

    Points below a plane count against it, so that tables and shelves are not detected as the floor. The same image
    always gives the same floor.

    `params` are DepthPeopleParams with the limits of the height and tilt of the camera. Returns None if no credible
    floor is visible.
    """
    return _fit(*_points(depth, camera), params)


def _fit(points, cells, params):
    if len(points) < MIN_POINTS:
        return None
    normals, offsets = _hypotheses(points, cells, params)
    if not len(normals):
        return None

    sample = points[(SAMPLE * len(points)).astype(int)]
    heights_m = normals.dot(sample.T) + offsets[:, None]
    heights = heights_m / _tolerance_m(sample[:, 2], offsets[:, None])
    inliers = np.count_nonzero(np.abs(heights) < 1, axis=1)
    best = (inliers - BELOW_WEIGHT * np.count_nonzero(heights < -2, axis=1)).argmax()
    return _refine(Floor(normals[best], offsets[best]), points, params)


def _points(depth, camera):
    """Points (n, 3) on a coarse grid of the image, up to FAR_M, and their numbers in the grid (h, w), or -1."""
    height, width = depth.shape
    u, v = np.meshgrid(np.arange(STEP_PX // 2, width, STEP_PX), np.arange(STEP_PX // 2, height, STEP_PX))
    depth_m, valid = depth.at(u, v)
    valid[valid] = depth_m[valid] < FAR_M
    cells = np.full(valid.shape, -1)
    cells[valid] = np.arange(np.count_nonzero(valid))
    return camera.deproject(np.stack((u, v), axis=-1)[valid], depth_m[valid]), cells


def _hypotheses(points, cells, params):
    """Candidate floor planes through three points near each other in the image: normals (n, 3), offsets (n,).

    Neighbours are often on the same surface, so that a small part of a floor yields candidates, too.
    """
    first = (FIRST * len(points)).astype(int)
    row_shifts, column_shifts = SHIFTS
    others = np.flatnonzero(cells >= 0)[first] + row_shifts * cells.shape[1] + column_shifts
    others = cells.take(others, mode='clip')
    have_depth = others.min(axis=0) >= 0
    a, (b, c) = points[first[have_depth]], points[others[:, have_depth]]
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    spread = lengths > 1e-3
    normals = normals[spread] / lengths[spread, None]
    normals *= -np.sign(normals[:, 1:2])  # up is -y in the optical frame
    offsets = -(normals * a[spread]).sum(axis=1)
    usable = _is_upright(normals, offsets, params)
    return normals[usable], offsets[usable]


def _is_upright(normals, offsets, params):
    x, y, z = normals.T
    return ((-y > np.cos(params.max_camera_tilt)) & (np.abs(x) < np.sin(MAX_ROLL_RAD)) & (z < np.sin(MAX_UPWARDS_RAD))
            & (offsets > params.min_camera_height) & (offsets < params.max_camera_height))


def _tolerance_m(depth_m, offset_m):
    """Maximum distance of inliers from a plane. Errors of heights grow with depth and with the height of the camera."""
    return np.sqrt(np.maximum(1, offset_m)) * (0.015 + 0.01 * depth_m)


def _refine(floor, points, params):
    """Fit the plane to its inliers by least squares. Returns None if the result is not credible."""
    tolerance_m = _tolerance_m(points[:, 2], floor.offset_m)
    for share in (1.0, 0.6, ON_PLANE, ON_PLANE):  # shrink the tolerance: the foot of a wall pulls the plane up
        near = points[np.abs(floor.height(points)) < share * tolerance_m]
        if len(near) < max(MIN_POINTS, MIN_SHARE * len(points)):
            return None
        center = near.mean(axis=0)
        offsets = (near - center) / near[:, 2:]
        normal = np.linalg.eigh(offsets.T.dot(offsets))[1][:, 0]
        normal *= -np.sign(normal[1])
        floor = Floor(normal, -float(normal.dot(center)))
    heights = floor.height(points) / tolerance_m
    below, inliers, above = (np.count_nonzero((heights >= low) & (heights < high))
                             for low, high in ((-np.inf, -3), (-1, 1), (1, 3)))
    ahead = near.dot(np.array([0, 0, 1]) - floor.normal[2] * floor.normal)
    is_credible = (below < MAX_BELOW * len(points) and above < MAX_ABOVE * inliers
                   and ahead.mean() < MAX_LEVERAGE * ahead.std())
    return floor if is_credible and _is_upright(floor.normal, floor.offset_m, params) else None
