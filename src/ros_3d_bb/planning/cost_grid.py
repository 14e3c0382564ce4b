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
COMFORT_M = 0.2  # kept free around the body
# Share of the standard deviation across the walking direction that counts: later images will reduce it. A robot that
# does not expect this finds no free way past a person who comes straight on, and stops in the way (Trautman and Krause
# 2010, the freezing robot problem).
ACROSS = 0.5
EXTENT = 3.0  # standard deviations up to which costs are computed
CENTERS_M = (np.arange(int(round(2 * HALF_SIZE_M / CELL_M))) + 0.5) * CELL_M - HALF_SIZE_M  # of the cells, in x and y


def presence_costs(tracks, robot_from_tracks, robot_radius_m):
    """Costs of the cells around the robot: the largest probability, over the times of the prediction, that a person or
    the comfort zone around the body covers the cell, minus that person's probability at the robot, relative to `RISKY`.
    The highest cost of all people counts. Places where the robot is less in the way of a person than now have no cost,
    so that it leaves the way instead of stopping in it.

    The probability that a disc of radius r covers a point at the offset d from its expected centre is approximated by
    pi r² N(d; 0, C + r²/4 I), where C is the covariance of the centre, narrowed by `ACROSS`: the disc is replaced by a
    Gaussian with the same area and second moments.

    Parameters
    ----------
    tracks : list of TrackedObject
        Those that do not move are expected to stay.
    robot_from_tracks : numpy.ndarray, (4, 4)
    robot_radius_m : float
        Of the disc around the origin in which the highest probability counts as that at the robot.

    Returns
    -------
    numpy.ndarray, (n, n), int8
        0 to `HIGHEST`. Rows are along y, columns along x; the robot is in the middle.
    """
    is_robot = np.hypot(CENTERS_M, CENTERS_M[:, np.newaxis]) < robot_radius_m
    excesses = np.zeros(is_robot.shape)
    for track in tracks:
        probabilities = np.zeros(is_robot.shape)
        end_s = min(track.prediction_step_s * len(track.prediction_m), HORIZON_S) if track.moving else 0.0
        times_s = np.arange(0, end_s + STEP_S / 2, STEP_S)
        centers_m = transform_points(robot_from_tracks, position_after(track, times_s))[:, :2]
        narrowed = robot_from_tracks[:2, :3] @ _narrowing(walking_velocity(track))
        covariances_m2 = narrowed @ covariances_after(track, times_s) @ narrowed.T
        for center_m, covariance_m2 in zip(centers_m, covariances_m2):
            _raise_to(probabilities, center_m, covariance_m2, track.size_m[0] / 2 + COMFORT_M)
        np.minimum(probabilities, 1, out=probabilities)
        np.maximum(excesses, probabilities - probabilities[is_robot].max(), out=excesses)
    return np.rint(HIGHEST * np.minimum(excesses / RISKY, 1)).astype(np.int8)


def _raise_to(probabilities, center_m, covariance_m2, radius_m):
    """Raise probabilities (n, n) to the approximated ones of a disc at one time, which may be more than 1."""
    spread_m2 = covariance_m2 + radius_m ** 2 / 4 * np.eye(2)
    extent_m = EXTENT * np.sqrt(np.diag(spread_m2))
    low, high = (np.clip(np.ceil((center_m + side * extent_m + HALF_SIZE_M) / CELL_M - 0.5), 0, len(probabilities))
                 .astype(int) for side in (-1, 1))
    x, y = (CENTERS_M[low[axis]:high[axis]] - center_m[axis] for axis in (0, 1))
    (xx, xy), (_xy, yy) = np.linalg.inv(spread_m2)
    squares = xx * x ** 2 + 2 * xy * x * y[:, np.newaxis] + yy * y[:, np.newaxis] ** 2
    window = probabilities[low[1]:high[1], low[0]:high[0]]
    np.maximum(window, radius_m ** 2 / 2 / np.sqrt(np.linalg.det(spread_m2)) * np.exp(-squares / 2), out=window)


def _narrowing(velocity_mps):
    """Matrix (3, 3) that scales offsets across a velocity (3,) by `ACROSS`; the identity if it is zero."""
    x, y, _z = velocity_mps
    across = np.array([-y, x, 0]) / max(np.hypot(x, y), 1e-9)
    return np.eye(3) - (1 - ACROSS) * np.outer(across, across)
