"""Motion of the robot, and its odometry.

Poses are (x, y, heading) in metres and radians.
"""
from typing import NamedTuple

import numpy as np

PERIOD_S = 0.01  # sampling period of the poses
SPEED_MPS = 0.7
EIGHT_M = (4.0, 2.5)  # half length and half width of the figure of eight that the robot drives
STANDING, DRIVING = 'standing', 'driving'


class OdometryModel(NamedTuple):
    """Errors of the odometry.

    Standard deviations of the constant scale errors, of the random walk over one metre (`step_m`, `turn`), which grows
    with the square root of the distance, and of the noise of a single pose (`position_m`, `heading`).
    """

    distance_scale: float = 0.02
    turn_scale: float = 0.01
    step_m: float = 0.002
    turn: float = np.radians(0.5)
    position_m: float = 0.004
    heading: float = np.radians(0.15)


def pose_at(poses, time_s):
    """Pose (3,) at a time, interpolated from poses (n, 3) every `PERIOD_S`."""
    row = time_s / PERIOD_S
    before = int(np.clip(np.floor(row), 0, len(poses) - 2))
    return poses[before] + (row - before) * (poses[before + 1] - poses[before])


def driving(place_m, heading, phase, seconds):
    """Poses (n, 3) of a robot that drives a figure of eight around a place, starting at its fraction `phase` (0..1)."""
    angles = np.linspace(0, 2 * np.pi, 4001)
    eight_m = np.stack((EIGHT_M[0] * np.cos(angles), EIGHT_M[1] * np.sin(2 * angles)), axis=1)
    way_m = np.append(0, np.cumsum(np.linalg.norm(np.diff(eight_m, axis=0), axis=1)))
    driven_m = SPEED_MPS * PERIOD_S * np.arange(int(round(seconds / PERIOD_S)) + 1)
    angle = np.interp((phase * way_m[-1] + driven_m) % way_m[-1], way_m, angles)
    x_m, y_m = EIGHT_M[0] * np.cos(angle), EIGHT_M[1] * np.sin(2 * angle)
    towards = np.unwrap(np.arctan2(2 * EIGHT_M[1] * np.cos(2 * angle), -EIGHT_M[0] * np.sin(angle)))
    cos, sin = np.cos(heading), np.sin(heading)
    return np.stack((place_m[0] + cos * x_m - sin * y_m, place_m[1] + sin * x_m + cos * y_m, towards + heading), axis=1)


def odometry_of(true, model, random):
    """Simulate the odometry poses (n, 3) for true poses by integrating noisy steps from the first true pose."""
    steps = np.diff(true, axis=0)
    cos, sin = np.cos(true[:-1, 2]), np.sin(true[:-1, 2])
    forward_m, left_m = cos * steps[:, 0] + sin * steps[:, 1], cos * steps[:, 1] - sin * steps[:, 0]
    scale, turn_scale = 1 + random.normal(0, (model.distance_scale, model.turn_scale))
    root_m = np.sqrt(np.abs(forward_m))
    turns = steps[:, 2] * turn_scale + random.normal(size=len(steps)) * model.turn * root_m
    forward_m = forward_m * scale + random.normal(size=len(steps)) * model.step_m * root_m
    heading = true[0, 2] + np.append(0, np.cumsum(turns))
    cos, sin = np.cos(heading[:-1]), np.sin(heading[:-1])
    moves_m = np.stack((cos * forward_m - sin * left_m, sin * forward_m + cos * left_m), axis=1)
    places_m = true[0, :2] + np.concatenate((np.zeros((1, 2)), np.cumsum(moves_m, axis=0)))
    return np.column_stack((places_m, heading))


def to_frame(pose, points_m):
    """Transform points (..., 2) of the plane to a pose's frame: forward and left, metres. Inverse of `from_frame`."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    return (np.asarray(points_m) - pose[:2]).dot(np.array([[cos, -sin], [sin, cos]]))


def from_frame(pose, points_m):
    """Transform points (..., 2), forward and left of a pose, to the plane. Inverse of `to_frame`."""
    return turned(pose[2], points_m) + pose[:2]


def turned(angle, vectors):
    """Rotate vectors (..., 2) of the plane counterclockwise by an angle."""
    cos, sin = np.cos(angle), np.sin(angle)
    return np.asarray(vectors).dot(np.array([[cos, sin], [-sin, cos]]))


def bearing_of(points_m):
    """Bearings of points (..., 2), forward and left."""
    return np.arctan2(points_m[..., 1], points_m[..., 0])
