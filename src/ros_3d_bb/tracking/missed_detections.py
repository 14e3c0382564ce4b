"""What it means for tracks that an image does not show them, where one or several cameras look.

Each camera has its say with its latest image; the best one counts. So whom one camera cannot see is neither out of view
nor missed while another one sees him, hides him or should see him. A camera that sends nothing more is soon not asked.
"""
from typing import NamedTuple

import numpy as np

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.occlusion import classify_visibility
from ros_3d_bb.tracking.types import OCCLUDED, OUT_OF_VIEW, VISIBLE, CameraView

# better than what `classify_visibility` says of places where nobody was found: VISIBLE, OCCLUDED, OUT_OF_VIEW
SEEN = -1
STATUS = np.array([OCCLUDED, OCCLUDED, OUT_OF_VIEW, VISIBLE])  # by that, the last one of SEEN
LATELY_NS = NS  # a camera whose latest image is older is not asked
BEHIND_M = 0.45  # no less sure is where somebody is who does not come out from behind something
HIDING_S = 0.3  # who was missed for longer hides nobody


class CameraVisibility(NamedTuple):
    """The latest image of a camera: its stamp, its view, and what it said of each track (n,): SEEN, or what the camera
    could see of the place.
    """

    stamp_ns: int
    view: CameraView
    places: np.ndarray


def others_of(looks, view, stamp_ns):
    """The looks, by camera, of those other than that of a view which looked lately."""
    return {camera: look for camera, look in looks.items()
            if camera != view.camera and stamp_ns - look.stamp_ns <= LATELY_NS}


def carried(looks, kept, begun):
    """Looks for the tracks that are `kept`, (n,) bool, and `begun` new ones, of which they could say nothing."""
    return {camera: look._replace(places=np.concatenate((look.places[kept], np.full(begun, OUT_OF_VIEW))))
            for camera, look in looks.items()}


def mark_missed(tracks, before, rows, view, others, looked_s, farthest_m):
    """Say why the tracks in `rows` were not seen, and count for how long, and how long of that they should have.

    Who was hidden, should have come out by now and did not, is still behind what hid them.

    Parameters
    ----------
    tracks, before : numpy.ndarray of tracker.TRACK, (n,)
        At the stamp of the image, changed in place; and after the image before.
    rows : numpy.ndarray of int
    view : CameraView
    others : dict
        Of `others_of`.
    looked_s : float
        The time that the image answers for.
    farthest_m : float
        People farther from a camera are not found.

    Returns
    -------
    numpy.ndarray of int, (n,)
        The places of the look.
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
    """Whom another camera would say to be still behind what hid them, had it looked now."""
    held = (look.places[rows] == OCCLUDED) & (missed['status'] == OCCLUDED) & (places != VISIBLE)
    held[held] = _places(missed[held], tracks, look.view, farthest_m) == VISIBLE
    held[held] = _places(before[held], tracks, look.view, farthest_m) == OCCLUDED
    return held


def _places(missed, tracks, view, farthest_m):
    """What a camera could see of the places of missed people."""
    if not len(missed):
        return np.zeros(0, int)
    hiding = tracks[tracks['confirmed'] & (tracks['missed_s'] < HIDING_S)]
    return classify_visibility(view, positions_of(missed), missed['size_m'], positions_of(hiding), farthest_m)


def positions_of(tracks):
    """Centres (n, 3), metres."""
    return np.column_stack((tracks['mean'][:, :2], tracks['z_m']))


def sigma_of(tracks):
    """Standard deviations (n,) of the positions, along the axis of the frame where they are less sure."""
    return np.sqrt(np.maximum(tracks['covariance'][:, 0, 0], tracks['covariance'][:, 1, 1]))
