"""Common motion: if most people seem to jump in the same way, the pose of the camera jumped, and not the people.

A motion (3,) is a translation in the plane and a rotation about the camera, (x, y, angle), metres and radians. Each
pair of a track and a measurement votes for the motions that explain it alone (as in RANSAC, Fischler and Bolles 1981).
The best one is refined by least squares, weighted with the covariances of the innovations.

The pose itself shows a jump, too, if the camera could not have moved like that, as after a correction of the
localisation. This needs a single person only, who must fit the jump better than the pose without it.

A pose jumps once. A motion that people's own acceleration explains, or that goes on, is that of people who turn or stop
together, and is left to the filter.
"""
import math
from typing import Any, NamedTuple, Tuple

import numpy as np

from ros_3d_bb.core.time_sync import NS

# Squared Mahalanobis distances of innovations below which 90 % and 99 % lie (chi-square, 2 degrees of freedom).
USUAL, GATE = 4.6, 9.2
SIGNIFICANT = 25.0  # squared Mahalanobis distance of a motion; chosen: 1 of 60000 is larger by chance (3 degrees)
FEWEST = 3  # people; chosen: two may turn or stop together
MOST = 12  # people who vote; chosen to limit the computing time
LEAST_M, LARGEST_M = 0.1, 1.0  # of a jump; chosen: less is left to the filter, more may be another person
SETTLED_NS = NS  # people must have fitted for this long before a jump; chosen: the duration of a turn
PEOPLE_MPS2 = 4.0  # upper bound of the acceleration of people; chosen: they stop and turn with 3 to 4 m/s2
PRIOR_STD = np.array([0.5, 0.5, 0.1])  # of a jump; chosen: the fit of people in one direction is well-conditioned
ROBOT_MPS2, ROBOT_RADPS2 = 2.0, 2.0  # acceleration of a robot, standard deviation of that of its camera; chosen
FITS = 3  # the pairs are selected and the motion is fitted this many times; chosen


class CameraMotion(NamedTuple):
    """Motion of a camera since its previous image: the CameraState of that image, None if there is none; the time since
    then, seconds, and the change of the pose and the mean velocity (x, y, angle); 0 without one.
    """

    previous: Any
    period_s: float = 0.0
    change: Tuple[float, float, float] = (0.0, 0.0, 0.0)
    velocity: Tuple[float, float, float] = (0.0, 0.0, 0.0)


def camera_motion(previous, image):
    """The CameraMotion until an image, given the CameraState of the previous image of the camera."""
    if previous is None:
        return CameraMotion(None)
    period_s = (image.stamp_ns - previous.stamp_ns) / NS
    before, after = previous.view.fixed_from_camera, image.view.fixed_from_camera
    if period_s <= 0 or before is after:
        return CameraMotion(previous, period_s)
    (xx, xy), (yx, yy) = after[:2, :3].dot(before[:2, :3].T).tolist()
    angle, (x, y) = math.atan2(yx - xy, xx + yy), (after[:2, 3] - before[:2, 3]).tolist()
    return CameraMotion(previous, period_s, (x, y, angle), (x / period_s, y / period_s, angle / period_s))


def pose_jump(camera, known, measurements, view):
    """Motion of the frame and its covariance (3, 3), as of `common_motion`, by which the CameraMotion deviates from a
    constant velocity.

    None unless it moves the known people by more than a robot can accelerate, and they fit it better.
    """
    period_s = camera.period_s
    if period_s <= 0 or not known or not measurements:
        return None
    motion = [change - period_s * velocity for change, velocity in zip(camera.change, camera.previous.velocity)]
    half = period_s ** 2 / 2
    farthest_m = max(measurement.distance_m for measurement in measurements)
    if math.hypot(motion[0], motion[1]) + abs(motion[2]) * farthest_m <= LEAST_M + ROBOT_MPS2 * half:
        return None
    known = known[:MOST]
    jacobians = _jacobians([(track.state.x, track.state.y) for track in known], view)
    shifts = jacobians.dot(motion)
    if np.linalg.norm(shifts, axis=1).max() <= LEAST_M + ROBOT_MPS2 * half:
        return None
    spread = np.diag(np.square((ROBOT_MPS2 * half, ROBOT_MPS2 * half, ROBOT_RADPS2 * half)))
    innovations, inverses = _innovations(known, measurements)
    nearest = [np.minimum(_distances2(innovations - shift, inverses), GATE).min(axis=1).sum()
               for shift in (0.0, shifts[:, None])]
    return (np.array(motion), spread) if nearest[0] - nearest[1] > USUAL else None


def may_jump(latest, others):
    """Whether people who do not fit an image can show a motion of the frame, by the CameraState of the previous image
    of the camera, None if it is the first one, and those of the other cameras.

    If the poses of several cameras disagree, people seem to jump from the image of one to that of the other. The people
    must therefore have fitted the images of the camera before, and those of the others.
    """
    return not others or bool(latest and latest.fits) and all(other.fits is not False for other in others)


def most_fit(known, matches, measurement_count):
    """Whether at least half of the known people fit their measurements without a motion; None for less than `FEWEST`
    people or measurements.

    `known` are confirmed tracks that the camera detected in its previous image, predicted to this one; `matches` are
    the pairs (Track, Measurement) that were associated without a motion.
    """
    if len(known) < FEWEST or measurement_count < FEWEST:
        return None
    known_ids = set(track.id for track in known)
    fitting = [track for track, measurement in matches if track.id in known_ids and _fits(track.state, measurement)]
    return 2 * len(fitting) >= len(known)


def _fits(state, measurement):
    x, y = measurement.x - state.x, measurement.y - state.y
    if abs(x) <= LEAST_M and abs(y) <= LEAST_M:
        return True
    xx, xy, yy = state.xx + measurement.xx, state.xy + measurement.xy, state.yy + measurement.yy
    return (yy * x * x - 2 * xy * x * y + xx * y * y) / (xx * yy - xy * xy) < USUAL


def common_motion(known, measurements, view, period_s):
    """Motion of the frame since the previous image, `period_s` before, and its covariance (3, 3).

    None unless one motion explains two thirds of the known people, as of `most_fit`, and their own acceleration does
    not.
    """
    known = known[:MOST]
    innovations, inverses = _innovations(known, measurements)
    allowed = np.linalg.norm(innovations, axis=2) < LARGEST_M
    allowed &= np.array([[track.kind.group == to.kind.group for to in measurements] for track in known])
    if not allowed.any():
        return None
    jacobians = _jacobians([(track.state.x, track.state.y) for track in known], view)
    motions = _motions_of_one(innovations, jacobians)[allowed].reshape(-1, 3)
    for _fit in range(FITS):
        rows, columns = _explained(motions, innovations, inverses, jacobians, allowed)
        if len(set(columns.tolist())) < FEWEST or 3 * len(rows) < 2 * len(known):
            return None
        motion, covariance = _least_squares(innovations[rows, columns], inverses[rows, columns], jacobians[rows])
        motions = motion[None]
    moved_m = np.linalg.norm(jacobians[rows].dot(motion), axis=1).mean()
    is_significant = motion.dot(np.linalg.solve(covariance, motion)) > SIGNIFICANT
    return (motion, covariance) if is_significant and moved_m > LEAST_M + PEOPLE_MPS2 * period_s ** 2 / 2 else None


def _innovations(known, measurements):
    """Innovations (n, m, 2) of all pairs of tracks and measurements, and their inverse covariances (n, m, 2, 2)."""
    states = [track.state for track in known]
    innovations = np.array([[(to.x - state.x, to.y - state.y) for to in measurements] for state in states])
    return innovations, np.linalg.inv([[((state.xx + to.xx, state.xy + to.xy), (state.xy + to.xy, state.yy + to.yy))
                                        for to in measurements] for state in states])


def moved(state, motion, covariance, view):
    """The State after a motion of the frame with a covariance."""
    jacobian = _jacobians([(state.x, state.y)], view)[0]
    (x, y), spread = jacobian.dot(motion).tolist(), jacobian.dot(covariance).dot(jacobian.T)
    (xx, xy), (_, yy) = spread.tolist()
    return state._replace(x=state.x + x, y=state.y + y, xx=state.xx + xx, xy=state.xy + xy, yy=state.yy + yy)


def _motions_of_one(innovations, jacobians):
    """The translation and the rotation (n, m, 2, 3) that explain each innovation (n, m, 2)."""
    motions = np.zeros(innovations.shape[:2] + (2, 3))
    motions[..., 0, :2] = innovations
    turns = jacobians[:, None, :, 2]
    motions[..., 1, 2] = (turns * innovations).sum(axis=2) / np.maximum((turns ** 2).sum(axis=2), 1e-6)
    return motions


def _explained(motions, innovations, inverses, jacobians, allowed):
    """Rows and columns of the pairs that the best one of the motions (k, 3) explains."""
    residuals = innovations - (jacobians @ motions.T).transpose(2, 0, 1)[:, :, None]
    distances2 = np.where(allowed, _distances2(residuals, inverses), np.inf)
    nearest = distances2.min(axis=2)
    best = np.minimum(nearest, GATE).sum(axis=1).argmin()
    rows = np.flatnonzero(nearest[best] < GATE)
    return rows, distances2[best, rows].argmin(axis=1)


def _least_squares(innovations, inverses, jacobians):
    weighted = jacobians.transpose(0, 2, 1) @ inverses
    covariance = np.linalg.inv(np.diag(PRIOR_STD ** -2) + (weighted @ jacobians).sum(axis=0))
    return covariance.dot((weighted @ innovations[..., None]).sum(axis=0)[:, 0]), covariance


def _jacobians(positions_m, view):
    """Derivatives (n, 2, 3) of positions (n, 2) by a motion."""
    x_m, y_m = (np.array(positions_m) - view.fixed_from_camera[:2, 3]).T
    jacobians = np.zeros((len(positions_m), 2, 3))
    jacobians[:, [0, 1], [0, 1]] = 1
    jacobians[:, 0, 2], jacobians[:, 1, 2] = -y_m, x_m
    return jacobians


def _distances2(innovations, inverses):
    return ((inverses @ innovations[..., None])[..., 0] * innovations).sum(axis=-1)
