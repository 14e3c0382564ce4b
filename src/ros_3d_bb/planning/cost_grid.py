"""Grid of costs around the robot: how likely a person will be at a place within the time of the prediction.

Robot frame, metres.
"""
import numpy as np

from ros_3d_bb.camera.camera_model import transform_points
from ros_3d_bb.planning.planner_view import covariances_after, position_after, walking_velocity

CELL_M = 0.1
HALF_SIZE_M = 5.0  # of the grid, whose centre is the robot
HIGHEST = 99  # of an OccupancyGrid; 100 would be lethal
RISKY = 0.3  # probability, above that at the robot, with the highest cost
STEP_S, HORIZON_S = 0.1, 2.0
COMFORT_M = 0.45  # kept free around the body: the intimate distance of Hall (The Hidden Dimension, 1966), 1.5 feet
# Share of the standard deviation across the walking direction that counts: later images will reduce it. A robot that
# does not expect this finds no free way past a person who comes straight on, and stops in the way (Trautman and Krause
# 2010, the freezing robot problem).
ACROSS = 0.5
EXTENT = 3.0  # standard deviations up to which costs are computed
CENTERS_M = (np.arange(int(round(2 * HALF_SIZE_M / CELL_M))) + 0.5) * CELL_M - HALF_SIZE_M  # of the cells, in x and y


def presence_costs(tracks, robot_from_tracks, robot_radius_m):
    """Costs of the cells around the robot: the largest probability, over the times of the prediction, that a person or
    the comfort zone around the body covers the cell, minus that person's probability at the robot, relative to
    `RISKY`. The highest cost of all people counts. Places where the robot is less in the way of a person than now
    have no cost, so that it leaves the way instead of stopping in it.

    The probability that a disc of radius r covers a point at the offset d from its expected centre is approximated by
    pi r² N(d; 0, C + r²/4 I), where C is the covariance of the centre, narrowed by `ACROSS`: the disc is replaced by a
    Gaussian with the same area and second moments. Up to 2 in the centre, it rises towards a person everywhere.

    Tracks (TrackedObject) that do not move are expected to stay. The highest probability in the disc with the radius
    `robot_radius_m` around the origin counts as that at the robot. Returns an array (n, n), int8, of 0 to `HIGHEST`.
    Rows are along y, columns along x; the robot is in the middle.
    """
    is_robot = np.hypot(CENTERS_M, CENTERS_M[:, np.newaxis]) < robot_radius_m
    excesses = np.zeros(is_robot.shape)
    for track in tracks:
        cells, probabilities = _presence_of(track, robot_from_tracks)
        at_robot = np.append(probabilities[is_robot[cells]], 0).max()
        excesses[cells] = np.maximum(excesses[cells], probabilities - at_robot)
    return np.rint(HIGHEST * np.minimum(excesses / RISKY, 1)).astype(np.int8)


def _presence_of(track, robot_from_tracks):
    """Index of the cells that a person may cover, and the largest probability of that over the times."""
    end_s = min(track.prediction_step_s * len(track.prediction_m), HORIZON_S) if track.moving else 0.0
    times_s = np.arange(0, end_s + STEP_S / 2, STEP_S)
    centers_m = transform_points(robot_from_tracks, position_after(track, times_s))[:, :2]
    narrowed = robot_from_tracks[:2, :3] @ _narrowing(walking_velocity(track))
    covariances_m2 = narrowed @ covariances_after(track, times_s) @ narrowed.T
    return _largest_presence(centers_m, covariances_m2, track.size_m[0] / 2 + COMFORT_M)


def _largest_presence(centers_m, covariances_m2, radius_m):
    """Largest probability over k times that a disc covers a cell, see `presence_costs`.

    The centres are (k, 2), their covariances (k, 2, 2). Returns an index of the cells that are within `EXTENT` of the
    centre along x and along y at any time, and their probabilities (rows, columns). The logarithms of all times are one
    array (k, rows, columns), of which only the largest are exponentiated.
    """
    spreads_m2 = covariances_m2 + radius_m ** 2 / 4 * np.eye(2)
    precisions = np.linalg.inv(spreads_m2)
    log_peaks = np.log(radius_m ** 2 / 2) - np.log(np.linalg.det(spreads_m2)) / 2

    offsets_m = CENTERS_M - centers_m[:, :, np.newaxis]  # (k, 2, n), along x and y
    is_near = np.abs(offsets_m) <= EXTENT * np.sqrt(_diagonals(spreads_m2))
    along = np.where(is_near, -_diagonals(precisions) * offsets_m ** 2 / 2, -np.inf)
    along[:, 0] += log_peaks[:, np.newaxis]

    columns, rows = (np.flatnonzero(near) for near in is_near.any(axis=0))
    x, along_x = (each[:, 0, columns][:, np.newaxis] for each in (offsets_m, along))
    y, along_y = (each[:, 1, rows][:, :, np.newaxis] for each in (offsets_m, along))
    logs = along_x + along_y - precisions[:, :1, 1:] * y * x
    largest = np.fmax.reduce(logs, axis=0)  # ignores NaN, from times with an invalid covariance
    return np.ix_(rows, columns), np.exp(largest)


def _diagonals(matrices):
    return np.diagonal(matrices, axis1=1, axis2=2)[:, :, np.newaxis]


def _narrowing(velocity_mps):
    """Matrix (3, 3) that scales offsets across a velocity (3,) by `ACROSS`; the identity if it is zero."""
    x, y, _z = velocity_mps
    across = np.array([-y, x, 0]) / max(np.hypot(x, y), 1e-9)
    return np.eye(3) - (1 - ACROSS) * np.outer(across, across)
