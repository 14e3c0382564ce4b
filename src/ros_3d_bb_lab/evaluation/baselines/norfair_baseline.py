"""Norfair, a tracking library, with the interface of this package's trackers."""
from typing import NamedTuple

import numpy as np

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.types import OCCLUDED, VISIBLE, TrackedObject, prediction_times_s


class NorfairParams(NamedTuple):
    """Parameters of Norfair, in images (`rate_hz` per second) and metres.

    Tuned for HOTA and IDF1 on the recordings eth, hotel, students001 and zara03: `distance_threshold` from 0.4 to 0.8,
    `hit_counter_max` (images that a track survives without detections) from 12 to 90, `initialization_delay` from 2 to
    8, and `process_noise` (Q) from 0.0002 to 0.002. The other parameters are Norfair's defaults.
    """

    distance_threshold: float = 0.5
    hit_counter_max: int = 45
    initialization_delay: int = 3
    process_noise: float = 0.0002
    measurement_noise: float = 4.0
    position_variance: float = 10.0
    velocity_variance: float = 1.0
    rate_hz: float = 30.0
    prediction_time: float = 2.0
    prediction_step: float = 0.25
    moving_speed: float = 0.2


class Norfair(object):
    """Tracks objects in the plane with Norfair's tracker and its constant-velocity Kalman filter.

    Raises ValueError if Norfair is not installed.
    """

    def __init__(self, params=NorfairParams()):
        try:
            import norfair
            from norfair.filter import OptimizedKalmanFilterFactory
        except ImportError as error:
            raise ValueError('Norfair cannot be imported (%s); install it: pip install norfair' % error)
        self._params, self._detection = params, norfair.Detection
        self._tracker = norfair.Tracker(
            distance_function='euclidean', distance_threshold=params.distance_threshold,
            hit_counter_max=params.hit_counter_max, initialization_delay=params.initialization_delay,
            past_detections_length=0, filter_factory=OptimizedKalmanFilterFactory(
                R=params.measurement_noise, Q=params.process_noise, pos_variance=params.position_variance,
                vel_variance=params.velocity_variance))
        self._now_ns, self._first_seen_ns = None, {}

    def update(self, stamp_ns, detections, view=None):
        """Update the tracks with the detections of one image, as `ThesisTracker.update`."""
        period = 1
        if self._now_ns is not None:
            period = max(1, int(round((stamp_ns - self._now_ns) / NS * self._params.rate_hz)))
        self._now_ns = stamp_ns
        seen = [self._detection(detection.position_m[np.newaxis, :2], data=(stamp_ns, detection))
                for detection in detections]
        return [self._published(thing) for thing in self._tracker.update(seen, period=period)]

    def _published(self, thing):
        params = self._params
        last_ns, detection = thing.last_detection.data
        first_ns = self._first_seen_ns.setdefault(thing.id, last_ns)
        position_m = np.append(thing.estimate[0], detection.position_m[2])
        velocity_mps = np.append(thing.filter.x[2:4].ravel() * params.rate_hz, 0)
        times_s = prediction_times_s(params.prediction_time, params.prediction_step)
        return TrackedObject(thing.id, position_m, detection.size_m, velocity_mps, velocity_mps,
                             VISIBLE if last_ns == self._now_ns else OCCLUDED,
                             bool(np.linalg.norm(velocity_mps) >= params.moving_speed), first_ns, last_ns,
                             position_m + times_s[:, np.newaxis] * velocity_mps, params.prediction_step)
