"""Visibility of tracks without a detection, combined over one or several cameras.

The latest image of each camera classifies each track, and the best result is used. A track that one camera cannot see
is therefore neither out of view nor missed while another camera detects it, sees it occluded or should detect it. A
camera that stops sending images is ignored after a short time.
"""
from typing import NamedTuple

import numpy as np

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.occlusion import classify_visibility
from ros_3d_bb.tracking.types import OCCLUDED, OUT_OF_VIEW, VISIBLE, CameraView

# Detected: ranks before the results of `classify_visibility` for undetected tracks, VISIBLE, OCCLUDED, OUT_OF_VIEW.
SEEN = -1
STATUS = np.array([OCCLUDED, OCCLUDED, OUT_OF_VIEW, VISIBLE])  # indexed by the result; the last entry is for SEEN
LATELY_NS = NS  # a camera whose latest image is older is ignored
BEHIND_M = 0.45  # upper bound of the position's standard deviation of a person who stays behind an occluder
HIDING_S = 0.3  # a track missed for longer does not occlude others


class CameraVisibility(NamedTuple):
    """The latest image of a camera: its stamp, its view, and the result for each track (n,), SEEN or a visibility of
    `classify_visibility`.
    """

    stamp_ns: int
    view: CameraView
    places: np.ndarray


def others_of(looks, view, stamp_ns):
    """The recent `CameraVisibility` of all cameras other than that of `view`, by camera."""
    return {camera: look for camera, look in looks.items()
            if camera != view.camera and stamp_ns - look.stamp_ns <= LATELY_NS}


def carried(looks, kept, begun):
    """The `CameraVisibility` by camera for the `kept` tracks, (n,) bool, and `begun` new tracks, OUT_OF_VIEW."""
    return {camera: look._replace(places=np.concatenate((look.places[kept], np.full(begun, OUT_OF_VIEW))))
            for camera, look in looks.items()}


def mark_missed(tracks, before, rows, view, others, looked_s, farthest_m):
    """Update the status of the undetected tracks in `rows`, and the times for which they are undetected and missed.

    An occluded person who is predicted to reappear but is not detected is assumed to stay behind the occluder: the
    track keeps its previous position.

    Parameters
    ----------
    tracks : numpy.ndarray of track.TRACK, (n,)
        Predicted to the stamp of the image; modified in place.
    before : numpy.ndarray of track.TRACK, (n,)
        The same tracks after the previous image.
    rows : numpy.ndarray of int
    view : CameraView
    others : dict
        CameraVisibility of the other cameras, from `others_of`.
    looked_s : float
        Time that the image accounts for, seconds.
    farthest_m : float
        Range of the detector: people farther from a camera are not detected.

    Returns
    -------
    numpy.ndarray of int, (n,)
        `CameraVisibility.places` of the image.
    """
    said = np.full(len(tracks), SEEN)
    if not len(rows):
        return said
    missed, before = tracks[rows], before[rows]
    places = _places(missed, tracks, view, farthest_m)
    held = (places == VISIBLE) & (missed['status'] == OCCLUDED)
    held[held] = _places(before[held], tracks, view, farthest_m) == OCCLUDED
    places[held] = OCCLUDED
    best = places.copy()
    for look in others.values():
        held |= _held_by(look, missed, before, rows, places, tracks, farthest_m)
        best = np.minimum(best, look.places[rows])
    held &= best == OCCLUDED
    missed['mean'][held] = before['mean'][held]
    held &= sigma_of(missed) > BEHIND_M
    missed['covariance'][held] = before['covariance'][held]
    missed['unseen_s'] += np.where(best == SEEN, 0, looked_s)
    missed['missed_s'] += np.where(best == VISIBLE, looked_s, 0)
    missed['status'] = STATUS[best]
    tracks[rows], said[rows] = missed, places
    return said


def _held_by(look, missed, before, rows, places, tracks, farthest_m):
    """Which missed tracks are assumed to stay behind an occluder, from the view of another camera; (k,) bool."""
    held = (look.places[rows] == OCCLUDED) & (missed['status'] == OCCLUDED) & (places != VISIBLE)
    held[held] = _places(missed[held], tracks, look.view, farthest_m) == VISIBLE
    held[held] = _places(before[held], tracks, look.view, farthest_m) == OCCLUDED
    return held


def _places(missed, tracks, view, farthest_m):
    """Visibility (k,) of missed tracks in a camera's view."""
    if not len(missed):
        return np.zeros(0, int)
    hiding = tracks[tracks['confirmed'] & (tracks['missed_s'] < HIDING_S)]
    return classify_visibility(view, positions_of(missed), missed['size_m'], positions_of(hiding), farthest_m)


def positions_of(tracks):
    """Centres (n, 3) of tracks, metres."""
    return np.column_stack((tracks['mean'][:, :2], tracks['z_m']))


def sigma_of(tracks):
    """Standard deviations (n,) of the positions, the larger one of x and y, metres."""
    return np.sqrt(np.maximum(tracks['covariance'][:, 0, 0], tracks['covariance'][:, 1, 1]))
