"""The thesis' tracker as its package ran: with what the text does not tell and `tracking.thesis` mends.

Its velocities are those of one image times the rate at which the last images arrived. It asks tf where the camera is
when the boxes arrive, not where it was. Tracks age only where there are more of them than boxes, and by images; new
ones come only where there are fewer, and not where a box is as far from another track as that track's own box. Where it
failed with an exception, rospy went on with the next image.
"""
import numpy as np

from ros_3d_bb.camera.camera_model import transform_points
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.association import plane_distances
from ros_3d_bb.tracking.types import OCCLUDED, VISIBLE, TrackedObject

LONGEST_MISSED = 30  # images
ALPHA = 0.2
ALIKE_M = 0.3
USUAL_RATE_HZ = 30.0  # of the first image
PREDICTION_STEP_S, PREDICTIONS = 0.25, 8
MOVING_MPS = 0.2


def as_it_arrived(run):
    """A run as the original saw it: stamped on arrival, and placed by where the camera is then."""
    return run._replace(images=tuple(_as_it_arrived(image) for image in run.images))


def _as_it_arrived(image):
    later = image.arrival_view.fixed_from_camera.dot(np.linalg.inv(image.view.fixed_from_camera))
    moved = [detection._replace(position_m=transform_points(later, detection.position_m))
             for detection in image.detections]
    return image._replace(stamp_ns=image.arrival_ns, detections=moved, view=image.arrival_view)


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
        """Average the step to the newest position, which is repeated while the track is not matched."""
        average_m = self.average_step_m
        self.average_step_m = self.step_m if average_m is None else ALPHA * self.step_m + (1 - ALPHA) * average_m
        self.velocity_mps = self.average_step_m * rate_hz


class OriginalTracker(object):
    """Tracks objects from image to image; takes images as `as_it_arrived` gives them."""

    def __init__(self):
        self._tracks, self._last_id, self._now_ns, self._rate_hz = [], 0, None, USUAL_RATE_HZ

    def update(self, stamp_ns, detections, view=None):
        """Take the detections of one image, as `ThesisTracker.update`. Returns a list of TrackedObject."""
        return [self._published(track) for track in self.step(stamp_ns, detections)]

    def step(self, stamp_ns, detections):
        """The algorithm without its output. Returns the tracks, with `id`, `position_m` and `velocity_mps`."""
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
            for track in self._tracks:  # loses every second of those that it deletes here, as the original did
                self._miss(track)
            return
        distances_m = plane_distances(np.reshape([track.position_m for track in self._tracks], (-1, 3)),
                                      [detection.position_m for detection in detections])
        matched_m = self._move_matched(distances_m, detections)
        taken = set(column for _row, column in matched_m)
        if len(self._tracks) > len(detections):
            # deletes by place in the list while the list gets shorter; in the order of a set, so that it may fail
            for row in reversed(list(set(range(len(self._tracks))) - set(row for row, _column in matched_m))):
                self._miss(self._tracks[row])
        elif len(self._tracks) < len(detections):
            for column in set(range(len(detections))) - taken:
                if all(abs(distances_m[row, column] - own_m) > ALIKE_M for (row, _), own_m in matched_m.items()):
                    self._last_id += 1
                    self._tracks.append(_OriginalTrack(self._last_id, self._now_ns, detections[column]))

    def _move_matched(self, distances_m, detections):
        """Give each track its nearest box, nearest pair first; one whose box is taken gets none.

        Returns {(row, column): distance}.
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
        velocity_mps = track.velocity_mps
        times_s = PREDICTION_STEP_S * np.arange(1, PREDICTIONS + 1)
        return TrackedObject(track.id, track.position_m, track.size_m, velocity_mps, track.step_m * self._rate_hz,
                             VISIBLE if track.seen_ns == self._now_ns else OCCLUDED,
                             bool(np.linalg.norm(velocity_mps) >= MOVING_MPS), track.first_ns, track.seen_ns,
                             track.position_m + times_s[:, np.newaxis] * velocity_mps, PREDICTION_STEP_S)
