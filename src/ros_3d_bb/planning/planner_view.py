"""Tracks for planners: extrapolation to the current time, transformation to the planner's frame, and footprints.

Positions and velocities are as in `types.TrackedObject`; points are (n, 3), metres, in the frame of the tracks.
"""
import numpy as np

from ros_3d_bb.camera.camera_model import transform_points
from ros_3d_bb.core.object_classes import MAX_COORDINATE_M, MAX_SIZE_M, label_fault, score_fault
from ros_3d_bb.tracking.types import OUT_OF_VIEW

SWATH_STEP_S = 0.1  # a person at 3 m/s moves 0.3 m, less than a body's width, so that the footprints overlap
MAX_STD_M = 0.5  # predicted positions that are less certain are not marked
MAX_STD_UNSEEN_M = 0.2  # the same for the positions of walking people out of view
ROUNDING = 1e-6  # of eigenvalues of a covariance, relative to the largest one if that exceeds 1
SAME_FRAME = np.eye(4)
LOWEST, HIGHEST = 0.25, 0.75  # fractions of a cylinder's height: off the floor and below 2 m, the limit of costmaps


def usable_tracks(tracks):
    """Separate valid from invalid tracks. Returns the valid ones, and a description of the fault of each other one."""
    faults = [_fault_of(track) for track in tracks]
    return [track for track, fault in zip(tracks, faults) if not fault], [fault for fault in faults if fault]


def _fault_of(track):
    """Fault of a track: a value is not finite or implausibly large, or a size or step is not positive; '' if valid."""
    values = np.concatenate([track.position_m, track.velocity_mps, track.size_m, track.prediction_m.ravel()])
    with np.errstate(invalid='ignore'):  # nan
        is_plausible = ((np.abs(values) < MAX_COORDINATE_M).all()
                        and ((0 < track.size_m) & (track.size_m < MAX_SIZE_M)).all())
    if not is_plausible:
        return ('track %d has position %s, velocity %s, size %s and prediction %s; finite numbers and a size of more '
                'than 0 and less than %g m expected' % (track.id, track.position_m, track.velocity_mps, track.size_m,
                                                        track.prediction_m.tolist(), MAX_SIZE_M))
    if len(track.prediction_m) and not track.prediction_step_s > 0:
        return ('track %d has predictions in steps of %g s; a positive step expected'
                % (track.id, track.prediction_step_s))
    if label_fault(track.label) or score_fault(track.score):
        return 'track %d has %s' % (track.id, label_fault(track.label) or score_fault(track.score))
    return ''


def with_usable_covariances(tracks):
    """Make covariances unknown that are not finite or have negative variances: people without one are better than no
    people. Returns the tracks, and a description of each fault."""
    are_usable = [track.covariance is None or _is_usable(track) for track in tracks]
    usable = [track if is_usable else track._replace(covariance=None, prediction_covariance_m2=None)
              for track, is_usable in zip(tracks, are_usable)]
    return usable, ['the covariance of track %d is not finite, or has a negative variance: it counts as unknown'
                    % track.id for track, is_usable in zip(tracks, are_usable) if not is_usable]


def _is_usable(track):
    blocks_m2 = np.concatenate((track.covariance[:3, :3][np.newaxis], track.covariance[3:, 3:][np.newaxis],
                                track.prediction_covariance_m2))
    with np.errstate(invalid='ignore'):  # nan
        is_plausible = (np.abs(blocks_m2) < MAX_COORDINATE_M).all()
    if not is_plausible:
        return False
    variances_m2 = np.linalg.eigvalsh(blocks_m2)
    return bool((variances_m2[:, 0] >= -ROUNDING * np.maximum(variances_m2[:, 2], 1)).all())


def with_class_widths(tracks, classes):
    """Give elongated objects at least the length of their class (ObjectClasses) as their width.

    A dog that is seen from the front appears narrow. Planners must keep clear of its length in any direction.
    """
    return [track._replace(size_m=np.maximum(track.size_m, [length_m, length_m, 0])) for track, length_m in
            ((track, classes.of(track.label).length) for track in tracks)]


def walking_velocity(track):
    """Velocity (3,), m/s; zero for a track that does not move: it is noise that planners would extrapolate."""
    return track.velocity_mps if track.moving else np.zeros(3)


def position_after(track, ahead_s):
    """Positions (..., 3) of a track `ahead_s` (...) seconds after its stamp, metres.

    The predicted positions are interpolated linearly. Before the stamp and beyond the last one, only moving tracks
    move, at their velocity.
    """
    ahead_s = np.asarray(ahead_s, float)
    known_m = np.vstack((track.position_m, track.prediction_m))
    beyond_s = np.maximum(ahead_s - track.prediction_step_s * len(track.prediction_m), 0) + np.minimum(ahead_s, 0)
    return (_interpolated(known_m, track.prediction_step_s, ahead_s)
            + beyond_s[..., np.newaxis] * walking_velocity(track))


def covariances_after(track, ahead_s):
    """Covariances (n, 3, 3) of the positions of a track `ahead_s` (n,) seconds after its stamp, m², interpolated
    linearly; 0 if unknown. Beyond the last one, what they have grown since the stamp goes on to grow with the square of
    the time. Without predictions, it is that by the covariance of the velocity.
    """
    if track.covariance is None or track.prediction_covariance_m2 is None:
        return np.zeros((len(ahead_s), 3, 3))
    known_m2 = np.concatenate((track.covariance[np.newaxis, :3, :3], track.prediction_covariance_m2))
    end_s = track.prediction_step_s * len(track.prediction_covariance_m2)
    beyond_s2 = np.maximum(np.maximum(ahead_s, 0.0) ** 2 - end_s ** 2, 0)
    growth_m2ps2 = (known_m2[-1] - known_m2[0]) / end_s ** 2 if end_s else track.covariance[3:, 3:]
    return (_interpolated(known_m2.reshape(-1, 9), track.prediction_step_s, ahead_s).reshape(-1, 3, 3)
            + beyond_s2[:, np.newaxis, np.newaxis] * growth_m2ps2)


def _interpolated(rows, step_s, times_s):
    """Interpolate rows (k, n) at intervals of `step_s` linearly to times (...). Returns an array (..., n)."""
    return np.stack([np.interp(times_s, step_s * np.arange(len(rows)), column) for column in rows.T], axis=-1)


def predicted_to(tracks, ahead_s):
    """Predict tracks `ahead_s` seconds ahead, see `position_after` and `covariances_after`; the result has no
    predictions, and no velocity where a track does not move.
    """
    return [_predicted_to(track, ahead_s) for track in tracks]


def _predicted_to(track, ahead_s):
    covariance, covariances_m2 = track.covariance, track.prediction_covariance_m2
    if covariance is not None and covariances_m2 is not None:
        covariance, covariances_m2 = covariance.copy(), covariances_m2[:0]
        covariance[:3, :3], = covariances_after(track, [ahead_s])
    return track._replace(position_m=position_after(track, ahead_s), velocity_mps=walking_velocity(track),
                          prediction_m=np.empty((0, 3)), covariance=covariance, prediction_covariance_m2=covariances_m2)


def in_frame(tracks, b_from_a):
    """Transform tracks from frame a to frame b, which both have z up; the result has no predictions."""
    both = np.kron(np.eye(2), b_from_a[:3, :3])
    return [track._replace(position_m=transform_points(b_from_a, track.position_m),
                           velocity_mps=b_from_a[:3, :3].dot(track.velocity_mps),
                           covariance=None if track.covariance is None else both.dot(track.covariance).dot(both.T),
                           prediction_m=np.empty((0, 3)), prediction_covariance_m2=None) for track in tracks]


def rounding_m(tracks, b_from_a):
    """Largest float32 rounding error of the coordinates in frame b of tracks in frame a, metres."""
    farthest_m = max([np.abs(transform_points(b_from_a, track.position_m)).max() for track in tracks], default=0.0)
    return float(np.spacing(np.float32(farthest_m))) / 2


def footprint_points(tracks, ahead_s, spacing_m):
    """Points (n, 3) of people's cylinders at three heights, and of the discs that they are predicted to cover up to
    `ahead_s` seconds ahead, at half their height, as long as their position is certain (`MAX_STD_M`). The points of a
    disc are `spacing_m` apart. Walking people out of view must be more certain
    (`MAX_STD_UNSEEN_M`), because they turn and stop.
    """
    later_s = np.linspace(0, ahead_s, int(np.ceil(ahead_s / SWATH_STEP_S)) + 1)[1:]
    points = [np.empty((0, 3))]
    for track in tracks:
        covariances_m2 = covariances_after(track, np.append(0, later_s))
        std_m = np.sqrt(np.maximum(np.linalg.eigvalsh(covariances_m2[:, :2, :2])[:, 1], 0))  # in any direction
        if track.moving and track.status == OUT_OF_VIEW and std_m[0] >= MAX_STD_UNSEEN_M:
            continue
        disc = disc_points(track.size_m[0] / 2, spacing_m)
        levels_m = np.outer((np.array([LOWEST, 0.5, HIGHEST]) - 0.5) * track.size_m[2], [0, 0, 1])
        centers_m = np.vstack((track.position_m + levels_m, position_after(track, later_s[std_m[1:] < MAX_STD_M])))
        points.append((centers_m[:, np.newaxis] + disc).reshape(-1, 3))
    return np.concatenate(points)


def disc_points(radius_m, spacing_m):
    """Points (n, 3) of a horizontal disc around the origin: its outline, and a grid inside."""
    side = np.arange(-np.floor(radius_m / spacing_m), np.floor(radius_m / spacing_m) + 1) * spacing_m
    grid = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    inside = grid[np.hypot(grid[:, 0], grid[:, 1]) < radius_m]
    return np.vstack((np.column_stack((inside, np.zeros(len(inside)))), ring_points(radius_m, spacing_m)))


def ring_points(radius_m, spacing_m):
    """Points (n, 3) of a horizontal circle around the origin, at most `spacing_m` apart."""
    angles = np.linspace(0, 2 * np.pi, int(np.ceil(2 * np.pi * radius_m / spacing_m)), endpoint=False)
    return radius_m * np.column_stack((np.cos(angles), np.sin(angles), np.zeros_like(angles)))
