"""Norfair, a tracking library, with the interface of this package's tracker."""
from typing import NamedTuple

import numpy as np

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.types import NOT_DETECTED, OCCLUDED, VISIBLE, TrackedObject, prediction_times_s

COUNTS_HZ = 30.0  # the unit of Norfair's lifetimes is one image at this rate
PREDICTION_TIME_S, PREDICTION_STEP_S = 2.0, 0.25
MOVING_MPS = 0.2


class NorfairSettings(NamedTuple):
    """Arguments of `norfair.Tracker` and of its filter factory, and the images per second: the filter predicts once per
    image, so its velocity is in metres per image."""

    tracker: dict
    filter: dict
    rate_hz: float = 30.0


# Tuned for HOTA and IDF1 on the recordings eth, hotel, students001 and zara03: distance_threshold from 0.4 to 0.8,
# hit_counter_max (images that a track survives without detections) from 12 to 90, initialization_delay from 2 to 8, and
# Q from 0.0002 to 0.002. The others are Norfair's defaults.
D435 = NorfairSettings({'distance_threshold': 0.5, 'hit_counter_max': 45, 'initialization_delay': 3},
                       {'Q': 0.0002, 'R': 4.0, 'pos_variance': 10.0, 'vel_variance': 1.0})
# Tuned for HOTA on recorded boxes of PointRCNN, at 10 Hz: 90 random combinations of distance_threshold from 0.5 to 1.5,
# hit_counter_max from 15 to 60, initialization_delay from 2 to 12, Q from 0.0002 to 0.02, R from 1 to 16, vel_variance
# from 0.01 to 1, and the lowest score of a box, `LIDAR_SCORE`, from 0.14 to 0.56.
LIDAR = NorfairSettings({'distance_threshold': 0.5, 'hit_counter_max': 30, 'initialization_delay': 6},
                        {'Q': 0.005, 'R': 1.0, 'pos_variance': 10.0, 'vel_variance': 1.0}, 10.0)
LIDAR_SCORE = 0.4


class Norfair(object):
    """Tracks objects in the plane with Norfair's tracker and its constant-velocity Kalman filter.

    Raises ValueError if Norfair is not installed.
    """

    def __init__(self, settings=D435):
        try:
            import norfair
            from norfair.filter import OptimizedKalmanFilterFactory
        except ImportError as error:
            raise ValueError('Norfair cannot be imported (%s); install it: pip install norfair' % error)
        self._detection, self._settings = norfair.Detection, settings
        self._tracker = norfair.Tracker(distance_function='euclidean', past_detections_length=0,
                                        filter_factory=OptimizedKalmanFilterFactory(**settings.filter),
                                        **settings.tracker)
        self._now_ns, self._first_seen_ns = None, {}

    def update(self, stamp_ns, detections, view=None):
        """Update the tracks with the detections of one image, as `Tracker.update`."""
        period = 1
        if self._now_ns is not None:
            period = max(1, int(round((stamp_ns - self._now_ns) / NS * COUNTS_HZ)))
        self._now_ns = stamp_ns
        seen = [self._detection(np.array([detection.position_m[:2]], float), data=(stamp_ns, detection))
                for detection in detections]
        return [self._published(thing) for thing in self._tracker.update(seen, period=period)]

    def _published(self, thing):
        last_ns, detection = thing.last_detection.data
        first_ns = self._first_seen_ns.setdefault(thing.id, last_ns)
        position_m = np.append(thing.estimate[0], detection.position_m[2])
        velocity_mps = np.append(thing.filter.x[2:4].ravel() * self._settings.rate_hz, 0)
        times_s = prediction_times_s(PREDICTION_TIME_S, PREDICTION_STEP_S)
        is_detected = last_ns == self._now_ns
        return TrackedObject(thing.id, position_m, detection.size_m, velocity_mps,
                             VISIBLE if is_detected else OCCLUDED,
                             bool(np.linalg.norm(velocity_mps) >= MOVING_MPS), first_ns, last_ns,
                             position_m + times_s[:, np.newaxis] * velocity_mps, PREDICTION_STEP_S,
                             detection=detection.index if is_detected else NOT_DETECTED)
