"""Tracks as planners need them: where people are now, in the planner's frame, and what ground they take up.

Positions and velocities as in `types.TrackedObject`; points are (n, 3), metres, in the frame of the tracks.
"""
import numpy as np

from ros_3d_bb.camera.camera_model import transform_points
from ros_3d_bb.core.limits import FARTHEST_M, LARGEST_M

SWATH_STEP_S = 0.1  # a person at 3 m/s is 0.3 m further on, less than a body is wide: the footprints overlap
SAME_FRAME = np.eye(4)
LOWEST, HIGHEST = 0.25, 0.75  # of a cylinder's height: well off the floor, and below 2 m, where costmaps stop looking


def usable_tracks(tracks):
    """Separate the tracks that planners can read from broken ones, so that one of those takes no others with it.

    Returns
    -------
    usable : list of types.TrackedObject
    faults : list of str
        For each other track, what is wrong with it.
    """
    faults = [_fault_of(track) for track in tracks]
    return [track for track, fault in zip(tracks, faults) if not fault], [fault for fault in faults if fault]


def _fault_of(track):
    """What is wrong with a track: a number is not finite or absurdly large, a size or step is not positive; else ''."""
    values = np.concatenate([track.position_m, track.velocity_mps, track.size_m, track.prediction_m.ravel()])
    if not ((np.abs(values) < FARTHEST_M).all() and (0 < track.size_m).all() and (track.size_m < LARGEST_M).all()):
        shown = tuple(np.asarray(value).tolist() for value in (track.position_m, track.velocity_mps, track.size_m,
                                                               track.prediction_m))
        return ('track %d has position %s, velocity %s, size %s and prediction %s; finite numbers and a size of more '
                'than 0 and less than 10 m expected' % ((track.id,) + shown))
    if track.covariance is not None and not (np.abs(track.covariance) < FARTHEST_M).all():
        return 'track %d has a covariance that is not finite' % track.id
    if len(track.prediction_m) and not track.prediction_step_s > 0:
        return ('track %d has predictions in steps of %g s; a positive step expected'
                % (track.id, track.prediction_step_s))
    return ''


def walking_velocity(track):
    """The velocity (3,) of a track that moves; zero of one that does not: the rest is noise, and planners would take it
    for a person who walks off.
    """
    return track.velocity_mps if track.moving else np.zeros(3)


def position_after(track, ahead_s):
    """Where a track will be, as its tracker predicts: straight between the predicted positions, and beyond the last
    with its `walking_velocity`.

    Parameters
    ----------
    track : types.TrackedObject
    ahead_s : array_like, (...)
        Seconds after the stamp of the tracks, 0 or more.

    Returns
    -------
    numpy.ndarray, (..., 3)
    """
    ahead_s = np.asarray(ahead_s, float)
    times_s = track.prediction_step_s * np.arange(len(track.prediction_m) + 1)
    known_m = np.vstack((track.position_m, track.prediction_m))
    position_m = np.stack([np.interp(ahead_s, times_s, axis_m) for axis_m in known_m.T], axis=-1)
    return position_m + np.maximum(ahead_s - times_s[-1], 0)[..., np.newaxis] * walking_velocity(track)


def predicted_to(tracks, ahead_s):
    """The tracks some seconds later (see `position_after`) with their `walking_velocity`, without their predictions."""
    return [track._replace(position_m=position_after(track, ahead_s), velocity_mps=walking_velocity(track),
                           prediction_m=np.empty((0, 3)), prediction_covariance_m2=None) for track in tracks]


def in_frame(tracks, b_from_a):
    """The tracks of frame a in frame b, without their predictions.

    Parameters
    ----------
    tracks : list of types.TrackedObject
    b_from_a : numpy.ndarray, (4, 4)
        Both frames have z up.
    """
    return [track._replace(position_m=transform_points(b_from_a, track.position_m),
                           velocity_mps=b_from_a[:3, :3].dot(track.velocity_mps),
                           covariance=_turned(track.covariance, b_from_a[:3, :3]),
                           prediction_m=np.empty((0, 3)), prediction_covariance_m2=None) for track in tracks]


def rounding_m(tracks, b_from_a):
    """By how much the coordinates in frame b of tracks of frame a may be off as float32, metres."""
    farthest_m = max([np.abs(transform_points(b_from_a, track.position_m)).max() for track in tracks], default=0.0)
    return float(np.spacing(np.float32(farthest_m))) / 2


def _turned(covariance, rotation):
    if covariance is None:
        return None
    both = np.kron(np.eye(2), rotation)
    return both.dot(covariance).dot(both.T)


def footprint_points(tracks, ahead_s, spacing_m):
    """Points in people's cylinders, at three heights, and in the discs that they will cover, at half their height.

    Parameters
    ----------
    tracks : list of types.TrackedObject
    ahead_s : float
        How far ahead; 0: where people are only.
    spacing_m : float
        Between points of a disc.

    Returns
    -------
    numpy.ndarray, (n, 3)
    """
    later_s = np.linspace(0, ahead_s, int(np.ceil(ahead_s / SWATH_STEP_S)) + 1)[1:]
    points = [np.empty((0, 3))]
    for track in tracks:
        disc = disc_points(track.size_m[0] / 2, spacing_m)
        levels_m = np.outer((np.array([LOWEST, 0.5, HIGHEST]) - 0.5) * track.size_m[2], [0, 0, 1])
        centers_m = np.vstack((track.position_m + levels_m, position_after(track, later_s)))
        points.append((centers_m[:, np.newaxis] + disc).reshape(-1, 3))
    return np.concatenate(points)


def disc_points(radius_m, spacing_m):
    """A flat disc around the origin, (n, 3): its outline, and a grid inside."""
    side = np.arange(-np.floor(radius_m / spacing_m), np.floor(radius_m / spacing_m) + 1) * spacing_m
    grid = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    inside = grid[np.hypot(grid[:, 0], grid[:, 1]) < radius_m]
    return np.vstack((np.column_stack((inside, np.zeros(len(inside)))), ring_points(radius_m, spacing_m)))


def ring_points(radius_m, spacing_m):
    """A flat circle around the origin, (n, 3), with points `spacing_m` apart or a little less."""
    angles = np.linspace(0, 2 * np.pi, int(np.ceil(2 * np.pi * radius_m / spacing_m)), endpoint=False)
    return radius_m * np.column_stack((np.cos(angles), np.sin(angles), np.zeros_like(angles)))
