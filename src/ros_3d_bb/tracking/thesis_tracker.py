"""The thesis' tracker (3.6): greedy nearest neighbour, smoothed velocity, linear prediction.

As in the thesis: greedy matching in the ground plane without a gate; an unmatched object keeps its position and is
deleted after a limit; the velocity is an exponential moving average that starts at zero; positions are predicted along
the averaged velocity. Different from the original: velocities are in metres per second from the stamps of the images
instead of per frame; the limit is in seconds; tracks do not age during skipped images (no transform).
"""
from typing import NamedTuple

import numpy as np

from ros_3d_bb.core.object_classes import ObjectClasses
from ros_3d_bb.core.params import Param, parameters
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.association import match_greedily, plane_distances
from ros_3d_bb.tracking.types import (MOVING_SPEED, NOT_DETECTED, OCCLUDED, PREDICTION_STEP, PREDICTION_TIME, VISIBLE,
                                      TrackedObject, TrackerBase, prediction_times_s)


@parameters('thesis')
class ThesisTrackerParams(NamedTuple):
    """Parameters of the thesis' tracker."""

    alpha: float = Param(
        0.2, 'Weight of the newest velocity in the average: higher reacts faster and is noisier. The default is that '
        "of the thesis' package.", limits=(1e-6, 1), live=(0.01, 1))
    disappearance_limit: float = Param(
        1.0, "A track that is not matched for longer than this is deleted, with 0 in the first image without a match; "
        "30 frames in the thesis' package.", 's', live=(0, 10))
    prediction_time: float = PREDICTION_TIME
    prediction_step: float = PREDICTION_STEP
    moving_speed: float = MOVING_SPEED


class ThesisTracker(TrackerBase):
    """Tracks objects from image to image, as of `types.TrackerBase`, in the order of the stamps.

    Parameters: ThesisTrackerParams. Label and score are those of the latest detection.

    Raises
    ------
    ValueError
        If a parameter is invalid; the message names it.
    """

    def __init__(self, params=ThesisTrackerParams(), last_id=0, classes=ObjectClasses()):
        self._classes, self._last_id = classes, last_id
        self.reconfigure(params)
        self.reset()

    def update(self, stamp_ns, detections, view=None):
        """Update the tracks with the detections of one image, as `TrackerBase.update`.

        The thesis' tracker does not consider the view. Raises ValueError without any change if the stamp is not later
        than the previous one.
        """
        (params,), elapsed_ns = self._params, self._advance(stamp_ns)
        limit_ns = params.disappearance_limit * NS
        # The limit may be less than the image period: tracks matched in the previous image can be matched in any case.
        tracks = [(track._replace(detection=NOT_DETECTED), unseen_ns + elapsed_ns) for track, unseen_ns in self._tracks
                  if not unseen_ns or unseen_ns + elapsed_ns <= limit_ns]
        pairs = []
        if tracks and detections:
            distances_m = plane_distances([track.position_m for track, _unseen_ns in tracks],
                                          [detection.position_m for detection in detections])
            groups, others = (np.array([self._classes.group_of(known.label) for known in objects])
                              for objects in ([track for track, _unseen_ns in tracks], detections))
            distances_m[groups[:, None] != others] = np.inf
            pairs = [pair for pair in match_greedily(distances_m) if np.isfinite(distances_m[pair])]
        for row, column in pairs:
            tracks[row] = self._matched(tracks[row][0], stamp_ns, detections[column]), 0
        tracks = [(track, unseen_ns) for track, unseen_ns in tracks if unseen_ns <= limit_ns]
        matched = set(column for _row, column in pairs)
        for column, detection in enumerate(detections):
            if column not in matched:
                self._last_id += 1
                position_m, size_m = np.array(detection.position_m), np.array(detection.size_m)
                track = TrackedObject(self._last_id, position_m, size_m, np.zeros(3), np.zeros(3), VISIBLE, False,
                                      stamp_ns, stamp_ns, None, None, None, None, detection.label, detection.score,
                                      detection.index)
                tracks.append((track, 0))
        self._tracks = tracks
        times_s = prediction_times_s(params.prediction_time, params.prediction_step)[:, None]
        return [track._replace(status=OCCLUDED if unseen_ns else VISIBLE, prediction_step_s=params.prediction_step,
                               moving=bool(np.linalg.norm(track.velocity_mps) >= params.moving_speed),
                               prediction_m=track.position_m + times_s * track.velocity_mps)
                for track, unseen_ns in tracks]

    def _matched(self, track, stamp_ns, detection):
        """A track with the position and size of a detection, and updated velocities."""
        elapsed_s, position_m = (stamp_ns - track.last_seen_ns) / float(NS), np.array(detection.position_m)
        velocity_mps, alpha = (position_m - track.position_m) / elapsed_s, self._params[0].alpha
        return track._replace(position_m=position_m, size_m=np.array(detection.size_m), last_seen_ns=stamp_ns,
                              instant_velocity_mps=velocity_mps,
                              velocity_mps=alpha * velocity_mps + (1 - alpha) * track.velocity_mps,
                              label=detection.label, score=detection.score, detection=detection.index)

    def skip(self, stamp_ns, _camera=''):
        """Skip an image whose detections are unusable: tracks do not age. Never raises, as the stamp may be wrong."""
        self._skipped_ns = max(stamp_ns, self._skipped_ns)

    def reset(self):
        """Delete all tracks, as after a jump in time. IDs are not reused."""
        self._tracks = []  # (TrackedObject, nanoseconds since its last detection without skipped images)
        self._now_ns, self._skipped_ns = None, 0

    def _advance(self, stamp_ns):
        """Nanoseconds since the previous image, skipped or not; 0 for the first."""
        if self._now_ns is not None and stamp_ns <= self._now_ns:
            raise ValueError('stamp %.9f is not later than the last, %.9f' % (stamp_ns / NS, self._now_ns / NS))
        elapsed_ns = 0 if self._now_ns is None else max(stamp_ns - max(self._now_ns, self._skipped_ns), 0)
        self._now_ns, self._skipped_ns = stamp_ns, 0
        return elapsed_ns
