"""Highest speed at which a robot can stop before it reaches the places where people will be.

Robot frame, metres, radians, seconds. The robot is a disc around the origin that moves straight or along a circle.
"""
import functools
import math
from typing import NamedTuple

import numpy as np

from ros_3d_bb.core.params import Param, parameters
from ros_3d_bb.planning.people_removal import scan_points
from ros_3d_bb.planning.planner_view import covariances_after, position_after

TIME_STEP_S, PATH_STEP_M = 0.05, 0.05
STANDING_S = 2.0  # the usual time of the predictions
# At this speed, 17 kg (a Jackal) touch a shin with twice the quasi-static limit of its force, as ISO/TS 15066 permits
# for transient contacts: 2 * 130 N / sqrt(60 kN/m * 14 kg), A.3.
LEAVING_MPS = 0.3
# Chosen: there is room for a person behind an obstacle whose edge is so much nearer than what is seen beside it, and
# which is at least so wide. Legs are narrower.
LEAST_ROOM_M, LEAST_WIDTH_M = 0.5, 0.35


@parameters('safe speed')
class SafeSpeedParams(NamedTuple):
    robot_radius: float = Param(0.35, 'Radius of the robot around the origin of its frame.', 'm', limits=(0.05, 5.0))
    reaction_time: float = Param(
        0.3, 'Time from a command to the beginning of the deceleration, in which the robot keeps its speed.', 's',
        limits=(0.0, 5.0), live=(0, 1))
    deceleration: float = Param(
        1.0, 'Deceleration of which the robot is always capable, at its highest load and on any floor.', 'm/s^2',
        limits=(0.05, 10.0), live=(0.1, 3))
    people_clearance: float = Param(
        0.1, 'Distance from people at which the robot stops.', 'm', limits=(0.0, 5.0), live=(0, 1))
    position_sigmas: float = Param(
        2.0, 'Standard deviations of the predicted positions that are kept free.', limits=(0.0, 5.0), live=(0, 3))
    highest_speed: float = Param(2.0, 'Limit where there are no people.', 'm/s', limits=(0.05, 10.0), live=(0.1, 3))


@parameters('blind corners')
class CornerParams(NamedTuple):
    emerging_speed: float = Param(
        1.4, 'Speed at which people may come from behind a blind corner; the default is the usual speed of walking.',
        'm/s', limits=(0.0, 5.0), live=(0, 3))
    corner_speed: float = Param(
        0.3, 'Blind corners do not lower the limit further than to this, so that the robot can pass them.', 'm/s',
        limits=(0.05, 10.0), live=(0.1, 1))


def highest_safe_speed(tracks, age_s, robot_from_tracks, velocity, params, pose_age_s=0.0, leaves=True):
    """Highest speed, m/s, from which the robot stops before the ellipses of all people in its way.

    The separation distance of ISO/TS 15066 (5.5.4), with the distance in which the robot stops, v T + v²/2a, on one
    side, and on the other side the free distance along its path to the nearest ellipse in which a person may be at any
    time until the robot stands. The ellipse is the predicted position with `position_sigmas` of its covariance, around
    which the body, the robot and `people_clearance` are added.

    A person who will come to a robot that `leaves` does not keep it from that at up to `LEAVING_MPS`: if it would be in
    the ellipse where it stands, within `STANDING_S`, only places count that are nearer to the person, relative to the
    ellipse, or nearer to the body at its expected position, if within `people_clearance`.

    The stamp of the tracks (TrackedObject) is `age_s` seconds ago; the latest pose of their frame, (4, 4), is that of
    `pose_age_s` seconds ago, and the robot has moved on since. Of the velocity of the robot, along x, along y and
    angular, only the path counts, which is that straight ahead without a linear velocity. `params` are SafeSpeedParams.
    """
    speed_mps, robot_m = params.highest_speed, np.linalg.inv(robot_from_tracks)[:3, 3]
    for track in sorted(tracks, key=lambda each: np.linalg.norm(each.position_m - robot_m)):  # the nearest limit most
        to_person = functools.partial(_distances_to_person, track, age_s, robot_from_tracks, params)
        safe_mps = _safe_speed(lambda *moved: to_person(*moved)[0], velocity, params, speed_mps, pose_age_s)
        if leaves and safe_mps < LEAVING_MPS:
            standing_s = np.arange(0, STANDING_S, TIME_STEP_S)
            least, gap_m = (distances.min() for distances in to_person(standing_s, np.zeros((1, 2))))
            nearer = functools.partial(_nearer, to_person, np.clip(least, 1e-9, 1),
                                       np.clip(gap_m, 0, params.people_clearance))
            leaving_mps = _safe_speed(nearer, velocity, params, LEAVING_MPS, pose_age_s)
            safe_mps = max(safe_mps, min(leaving_mps, LEAVING_MPS))
        speed_mps = min(speed_mps, safe_mps)
    return speed_mps


def blind_corners(ranges_m, limits_m, first_angle, step):
    """Blind corners (n, 3) in a planar scan, in the frame of the laser.

    The ranges (n,) are as in REP 117: infinite without a return, nan or less than the least one of the laser if they
    are invalid. `limits_m` are the least and the largest one; 0: unlimited. The angles are those of the first beam and
    between two beams. Where people would fit between beams that are valid, invalid ones are taken for an opening:
    older drivers report 0 without a return, and depthimage_to_laserscan nan. Raises ValueError if no range is valid.
    """
    least_m, largest_m = limits_m
    ranges_m, largest_m = np.array(ranges_m, float), largest_m if largest_m > 0 else np.inf
    with np.errstate(invalid='ignore'):  # nan
        is_valid = (ranges_m >= least_m) & (ranges_m > 0)
    if not (is_valid.any() and np.isfinite([first_angle, step]).all() and step):
        raise ValueError('none of its %d beams has a range of at least %g m and an angle (first %g, step %g rad)'
                         % (len(ranges_m), least_m, first_angle, step))
    is_circle = abs(step) * (len(ranges_m) + 1) > 2 * np.pi
    limited_m = np.minimum(np.where(is_valid, ranges_m, np.inf), largest_m)
    is_used = is_valid | _is_opening(limited_m, is_valid, step, is_circle)
    points_m, limited_m = scan_points(limited_m, first_angle, step)[is_used], limited_m[is_used]
    count = len(limited_m)
    if is_circle:  # taken twice: obstacles across its ends are whole
        points_m, limited_m = np.tile(points_m, (2, 1)), np.tile(limited_m, 2)
    with np.errstate(invalid='ignore'):  # between two infinite ranges
        jumps_m = np.diff(limited_m)
        before, = np.nonzero(np.abs(jumps_m) > LEAST_ROOM_M)  # the last beams on obstacles
    if not len(before):
        return np.zeros((0, 3))
    first, last = np.append(0, before + 1), np.append(before, len(limited_m) - 1)  # beams on each obstacle
    with np.errstate(invalid='ignore'):
        is_wide = np.linalg.norm(points_m[last] - points_m[first], axis=1) >= LEAST_WIDTH_M
    is_next = (jumps_m[before] < 0).astype(int)  # whether the nearer obstacle is the next one
    corners = (before + is_next)[is_wide[np.arange(len(before)) + is_next]]
    return points_m[np.unique(corners % count)]


def _is_opening(ranges_m, is_valid, step, is_circle):
    """Whether a person fits between the valid beams beside each invalid one, at the range of the farther of both.
    Beams before the first and after the last one are those of a full circle, or missing."""
    if is_circle:
        is_opening = _is_opening(np.tile(ranges_m, 3), np.tile(is_valid, 3), step, False)
        return is_opening[len(ranges_m):2 * len(ranges_m)]
    numbers, count = np.arange(len(ranges_m)), len(ranges_m)
    before = np.maximum.accumulate(np.where(is_valid, numbers, -1))
    after = np.minimum.accumulate(np.where(is_valid, numbers, count)[::-1])[::-1]
    valid_m = np.append(np.where(is_valid, ranges_m, 0), 0)  # also of the numbers -1 and count
    width_m = np.maximum(valid_m[before], valid_m[after]) * abs(step) * np.maximum(after - before, 1)
    return ~is_valid & (width_m >= LEAST_WIDTH_M)


def speed_before_corners(corners_m, age_s, velocity, params, corner_params):
    """Highest speed, m/s, from which the robot stops before a person who comes from behind a blind corner.

    As `highest_safe_speed`, with a circle around each corner (n, 2) in which the person may be, in the frame of the
    robot `age_s` seconds ago. It is not less than `corner_speed`.
    """
    speed_mps = params.highest_speed
    for corner_m in sorted(corners_m, key=np.linalg.norm):
        distances = functools.partial(_distances_to_corner, corner_m, age_s, params, corner_params.emerging_speed)
        speed_mps = min(speed_mps, _safe_speed(distances, velocity, params, speed_mps, age_s))
    return max(speed_mps, corner_params.corner_speed)


def limited_velocity(velocity, limit):
    """Velocity, along x, along y and angular, with at most this speed on the same path; rotations in place are kept."""
    speed_mps = math.hypot(*velocity[:2])
    factor = limit / speed_mps if speed_mps > limit else 1.0
    return tuple([factor * part for part in velocity])


def _safe_speed(distances_to, velocity, params, most_mps, pose_age_s):
    """Highest speed from which the robot stops before a place that is occupied then; any higher speed where it is more
    than `most_mps`. Only the times and the path until the robot stands after this speed are computed: their product,
    which is the cost, grows with its cube.

    `distances_to` is called with times (n,) and places (m, 2) and returns distances (n, m), which are at most 1 at
    occupied places. Only those that decrease along the path count. The path begins where the robot was `pose_age_s`
    ago; it has kept its speed since.
    """
    reaction_s, deceleration = params.reaction_time, params.deceleration
    braking_s = most_mps / deceleration
    ahead_s = np.arange(0, reaction_s + braking_s + TIME_STEP_S, TIME_STEP_S)
    unbraked_s = pose_age_s + reaction_s
    longest_m = most_mps * (unbraked_s + braking_s / 2)
    distances = distances_to(ahead_s, _path(velocity, np.arange(0, longest_m + 2 * PATH_STEP_M, PATH_STEP_M)))
    is_met = (distances <= 1) & (np.gradient(distances, axis=1) < 0)
    first = np.where(is_met.any(axis=1), is_met.argmax(axis=1), np.inf)
    free_m = np.maximum(first - 1, 0) * PATH_STEP_M
    by_distance = np.sqrt((deceleration * unbraked_s) ** 2 + 2 * deceleration * free_m) - deceleration * unbraked_s
    by_time = deceleration * (ahead_s - TIME_STEP_S - reaction_s)  # slower robots stand before the person is there
    return float(np.maximum(by_distance, by_time).min())


def _path(velocity, lengths_m):
    x, y, rate = velocity
    speed_mps = math.hypot(x, y)
    turn = lengths_m * (rate / speed_mps if speed_mps else 0.0)
    along = np.column_stack((np.sinc(turn / np.pi), np.sinc(turn / 2 / np.pi) ** 2 * turn / 2))
    cos, sin = (x / speed_mps, y / speed_mps) if speed_mps else (1.0, 0.0)
    return lengths_m[:, np.newaxis] * along.dot([[cos, sin], [-sin, cos]])


def _nearer(to_person, least, gap_m, *moved):
    """Distances (n, m) that are at most 1 where they are at most `least` in the ellipse, and up to `gap_m` before the
    body."""
    in_ellipse, gaps_m = to_person(*moved)
    return np.minimum(in_ellipse / least, 1 + gaps_m - gap_m)


def _distances_to_person(track, age_s, robot_from_tracks, params, ahead_s, places_m):
    """Distances (n, m) of places (m, 2) from the centre of a person at times (n,), relative to the ellipse, and gaps
    (n, m) between robot and body, m."""
    rotation, robot_m = robot_from_tracks[:2, :2], np.linalg.inv(robot_from_tracks)[:2, 3]
    ahead_s = age_s + ahead_s
    centers_m = (position_after(track, ahead_s)[:, :2] - robot_m).dot(rotation.T)  # also where the robot is tilted
    covariances_m2 = np.matmul(np.matmul(rotation, covariances_after(track, ahead_s)[:, :2, :2]), rotation.T)
    variances_m2, axes = np.linalg.eigh(covariances_m2)
    touching_m = track.size_m[0] / 2 + params.robot_radius
    semi_axes_m = touching_m + params.people_clearance + params.position_sigmas * np.sqrt(np.maximum(variances_m2, 0))
    offsets_m = np.matmul(places_m - centers_m[:, np.newaxis], axes)
    return (np.linalg.norm(offsets_m / semi_axes_m[:, np.newaxis], axis=2),
            np.linalg.norm(offsets_m, axis=2) - touching_m)


def _distances_to_corner(corner_m, age_s, params, people_mps, ahead_s, places_m):
    """Distances (n, m) of places (m, 2) from a corner at times (n,); 1: on the circle in which people may be."""
    reaches_m = params.robot_radius + params.people_clearance + people_mps * (age_s + ahead_s)
    return np.linalg.norm(places_m - corner_m, axis=1) / reaches_m[:, np.newaxis]
