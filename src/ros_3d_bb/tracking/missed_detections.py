"""Visibility of tracks without a detection, combined over one or several cameras.

The latest image of each camera classifies each track, and the best result is used. A track that one camera cannot see
is therefore neither out of view nor missed while another camera detects it, sees it occluded or should detect it. A
camera that stops sending images is ignored after a short time.
"""
from typing import NamedTuple

import numpy as np

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.occlusion import classify_visibility
from ros_3d_bb.tracking.track import position_std_of
from ros_3d_bb.tracking.types import OCCLUDED, OUT_OF_VIEW, VISIBLE, CameraView

# Detected: ranks before the results of `classify_visibility` for undetected tracks, VISIBLE, OCCLUDED, OUT_OF_VIEW.
SEEN = -1
STATUS = np.array([OCCLUDED, OCCLUDED, OUT_OF_VIEW, VISIBLE])  # indexed by the result; the last entry is for SEEN
RECENT_NS = NS  # a camera whose latest image is older is ignored
BEHIND_M = 0.45  # upper bound of the position's standard deviation of a person who stays behind an occluder
OCCLUDING_S = 0.3  # a track missed for longer does not occlude others


class CameraVisibility(NamedTuple):
    """The latest image of a camera: its stamp, its view, and the result for each track (n,), SEEN or a visibility of
    `classify_visibility`.
    """

    stamp_ns: int
    view: CameraView
    visibility: np.ndarray


def mark_missed(tracks, before, rows, cameras, camera, observed_s, max_range_m):
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
    cameras : dict
        CameraVisibility by camera; the `visibility` of the image's camera is modified in place.
    camera : str
        The camera of the image.
    observed_s : float
        Time that the image accounts for, seconds.
    max_range_m : float
        Range of the detector: people farther from a camera are not detected.
    """
    image, missed, before = cameras[camera], tracks[rows], before[rows]
    visibility = _visibility(missed, tracks, image.view, max_range_m)
    held = (visibility == VISIBLE) & (missed['status'] == OCCLUDED)
    held[held] = _visibility(before[held], tracks, image.view, max_range_m) == OCCLUDED
    visibility[held] = OCCLUDED
    image.visibility[rows] = visibility
    best = visibility
    for name, other in cameras.items():
        if name != camera and image.stamp_ns - other.stamp_ns <= RECENT_NS:
            # The person may also stay behind what occludes the view of another camera.
            hidden = (other.visibility[rows] == OCCLUDED) & (missed['status'] == OCCLUDED) & (visibility != VISIBLE)
            hidden[hidden] = _visibility(missed[hidden], tracks, other.view, max_range_m) == VISIBLE
            hidden[hidden] = _visibility(before[hidden], tracks, other.view, max_range_m) == OCCLUDED
            held |= hidden
            best = np.minimum(best, other.visibility[rows])
    held &= best == OCCLUDED
    missed['mean'][held] = before['mean'][held]
    held &= position_std_of(missed) > BEHIND_M
    missed['covariance'][held] = before['covariance'][held]
    missed['unseen_s'] += np.where(best == SEEN, 0, observed_s)
    missed['missed_s'] += np.where(best == VISIBLE, observed_s, 0)
    missed['status'] = STATUS[best]
    tracks[rows] = missed


def _visibility(missed, tracks, view, max_range_m):
    """Visibility (k,) of missed tracks in a camera's view."""
    if not len(missed):
        return np.zeros(0, int)
    occluding = tracks[tracks['confirmed'] & (tracks['missed_s'] < OCCLUDING_S)]
    return classify_visibility(view, _positions_of(missed), missed['size_m'], _positions_of(occluding), max_range_m)


def _positions_of(tracks):
    return np.column_stack((tracks['mean'][:, :2], tracks['z_m']))
