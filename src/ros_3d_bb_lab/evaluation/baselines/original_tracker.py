"""The thesis' tracker as implemented in its package.

It includes behaviour that the text of the thesis does not describe. Velocities are the displacement between two images
times the current rate of arrival. The camera pose is looked up at the time at which the boxes arrive, not at the image
stamp. Missed images are counted only if there are more tracks than boxes, and lifetimes are in images. New tracks start
only if there are fewer tracks than boxes, and only from boxes that are not as far from a matched track as that track's
own box. If an exception occurs, the image is skipped, as rospy does.
"""
import numpy as np
from scipy.spatial.distance import cdist

from ros_3d_bb.camera.camera_model import transform_points
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.types import OCCLUDED, VISIBLE, TrackedObject

LONGEST_MISSED = 30  # images
ALPHA = 0.2
ALIKE_M = 0.3
USUAL_RATE_HZ = 30.0  # assumed for the first image
PREDICTION_STEP_S, PREDICTIONS = 0.25, 8
MOVING_MPS = 0.2


def as_it_arrived(run):
    """Transform a run to the inputs of the original: images stamped on arrival, with the camera pose at that time."""
    images = []
    for image in run.images:
        later = image.arrival_view.fixed_from_camera.dot(np.linalg.inv(image.view.fixed_from_camera))
        moved = [detection._replace(position_m=transform_points(later, detection.position_m))
                 for detection in image.detections]
        images.append(image._replace(stamp_ns=image.arrival_ns, detections=moved, view=image.arrival_view))
    return run._replace(images=tuple(images))


class _OriginalTrack(object):
    def __init__(self, track_id, stamp_ns, detection):
        self.id, self.first_ns = track_id, stamp_ns
        self.position_m = detection.position_m
        self.average_step_m = self.velocity_mps = None
        self.move(stamp_ns, detection)

    def move(self, stamp_ns, detection):
        self.step_m = detection.position_m - self.position_m
        self.position_m, self.size_m = detection.position_m, detection.size_m
        self.seen_ns, self.missed = stamp_ns, 0

    def filter_velocity(self, rate_hz):
        """Smooth the last displacement, which is repeated while the track is not matched."""
        average_m = self.average_step_m
        self.average_step_m = self.step_m if average_m is None else ALPHA * self.step_m + (1 - ALPHA) * average_m
        self.velocity_mps = self.average_step_m * rate_hz


class OriginalTracker(object):
    """Tracks objects from image to image. Its input is the output of `as_it_arrived`."""

    def __init__(self):
        self._tracks, self._last_id, self._now_ns, self._rate_hz = [], 0, None, USUAL_RATE_HZ

    def update(self, stamp_ns, detections, view=None):
        return [self._published(track) for track in self.step(stamp_ns, detections)]

    def step(self, stamp_ns, detections):
        """Update the tracks without publishing. Returns the tracks, with `id`, `position_m` and `velocity_mps`."""
        self._rate_hz = USUAL_RATE_HZ if self._now_ns is None else NS / (stamp_ns - self._now_ns)
        self._now_ns = stamp_ns
        try:
            self._match(detections)
        except IndexError:
            return []
        for track in self._tracks:
            track.filter_velocity(self._rate_hz)
        return self._tracks

    def _match(self, detections):
        if not detections:
            for track in self._tracks:  # modified while iterating: every second deletion is skipped, as in the original
                self._miss(track)
            return
        distances_m = cdist(np.reshape([track.position_m[:2] for track in self._tracks], (-1, 2)),
                            [detection.position_m[:2] for detection in detections])
        matched_m = self._move_matched(distances_m, detections)
        taken = set(column for _row, column in matched_m)
        if len(self._tracks) > len(detections):
            # indices are in set order and become invalid as the list shrinks, as in the original; may raise IndexError
            for row in reversed(list(set(range(len(self._tracks))) - set(row for row, _column in matched_m))):
                self._miss(self._tracks[row])
        elif len(self._tracks) < len(detections):
            for column in set(range(len(detections))) - taken:
                if all(abs(distances_m[row, column] - own_m) > ALIKE_M for (row, _), own_m in matched_m.items()):
                    self._last_id += 1
                    self._tracks.append(_OriginalTrack(self._last_id, self._now_ns, detections[column]))

    def _move_matched(self, distances_m, detections):
        """Match each track with its nearest box in order of distance. Returns {(row, column): distance}.

        A track whose nearest box is already matched gets none.
        """
        matched_m, taken = {}, set()
        if not len(distances_m):
            return matched_m
        nearest_m = distances_m.min(axis=1)
        rows = np.argsort(nearest_m)
        columns = distances_m.argmin(axis=1)[rows]
        for row, column, distance_m in zip(rows.tolist(), columns.tolist(), nearest_m[rows].tolist()):
            if column not in taken:
                taken.add(column)
                self._tracks[row].move(self._now_ns, detections[column])
                matched_m[row, column] = distance_m
        return matched_m

    def _miss(self, track):
        track.missed += 1
        if track.missed >= LONGEST_MISSED:
            self._tracks.remove(track)

    def _published(self, track):
        times_s = PREDICTION_STEP_S * np.arange(1, PREDICTIONS + 1)
        return TrackedObject(track.id, track.position_m, track.size_m, track.velocity_mps,
                             VISIBLE if track.seen_ns == self._now_ns else OCCLUDED,
                             bool(np.linalg.norm(track.velocity_mps) >= MOVING_MPS), track.first_ns, track.seen_ns,
                             track.position_m + times_s[:, np.newaxis] * track.velocity_mps, PREDICTION_STEP_S)
