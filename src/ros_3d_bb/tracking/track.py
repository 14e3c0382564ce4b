"""Tracks: the state of one object from image to image.

The track score is the log odds that a track is an object and not a series of false detections: the sum of the
log-likelihood ratios of its detections and misses (Sittler 1964; Blackman and Popoli, Design and Analysis of Modern
Tracking Systems, 1999, 6.2). Those of successive images are not independent: detectors repeat their errors. An image
therefore counts in proportion to the time since the previous one, and fully after a correlation time: at high image
rates, the score depends on the time and not on the number of images.

A track starts with the log odds of its first detection and of an arrival: the number of people who come into view
between two images grows with the time between them, the number of independent false detections of an image does not.
"""
import math
from typing import Any, FrozenSet, NamedTuple, Optional

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking import kalman_filter
from ros_3d_bb.tracking.appearance import LEAST_SUPPORT, Appearance
from ros_3d_bb.tracking.measurement_model import Kind, Kinds, Measurement
from ros_3d_bb.tracking.types import NOT_DETECTED, OUT_OF_VIEW, VISIBLE, Detection

# All are chosen; `./run bench tracking` and `./run bench scenes` show the effect of others.
HIT_CORRELATION_S = 0.08  # without scores, three images at 30 Hz or two independent ones confirm a track by default
CONFIRMING_NS = 6 * NS // 100  # detections of less time than three images at 30 Hz confirm no track
ARRIVAL_S = 1.0  # people in the first image of a camera have arrived before: during this time, as after longer gaps
OUTLIER_CORRELATION_S = 0.2  # boxes of the same kind, such as outliers, follow each other; chosen
LEAST_MISPLACED = -5.0  # of the log odds that outliers have moved a track: earlier boxes are forgotten; chosen
MISS_CORRELATION_S = 0.15  # the causes of misses, such as poses and partial occlusion, last longer
UNKNOWN_SCORE, LARGEST_SCORE = 0.5, 0.9999  # assumed if the score is unknown; upper bound, for its log odds
# Of the score of a detection. A high score does not mean that the position is right, as of a person half hidden.
MAX_LOG_ODDS = 1.1
HIT = 0.8  # of a detection where a track is expected: little, because false detections repeat at their place, too
MAX_TRACK_SCORE = 4.0  # earlier evidence is forgotten: an undetected person is published for 0.4 s
MIN_TRACK_SCORE = -2.0  # with less (12 % probability), tracks do not start, and undetected tracks are not published
SMOOTHING = 0.1  # weight of the newest detection in size, height and score
LEGS_M = 0.2  # a lower end that is this much higher does not show the legs; chosen: heights of people differ by less
LEAST_HEIGHT_M = 0.1
STILL_MOVING = 0.5  # hysteresis: a moving track stops below this share of `moving_speed`
SLOW_S = 0.3  # time constant of the slow velocity, from which the velocity differs in manoeuvres; see `prediction`
# Visibility of a detected track, and of one that is not detected, but whose place is occupied in the depth image:
# STAYED if by something that is farther than the axis of the body. They rank before VISIBLE, OCCLUDED and OUT_OF_VIEW.
SEEN, PRESENT, STAYED = -3, -2, -1


class Rules(NamedTuple):
    """What the update of a track needs of `tracker.TrackerParams`, and `measurement_model.Kinds`."""

    outliers: kalman_filter.OutlierModel
    even_log_odds: float
    confirming_log_odds: float
    moving_speed: float
    kinds: Kinds

    @classmethod
    def of(cls, params: Any, kinds: Kinds) -> 'Rules':
        """The Rules of TrackerParams."""
        return cls(kalman_filter.outlier_model(params), _logit(params.even_score),
                   _logit(params.confirmation_probability), params.moving_speed, kinds)


class Track(object):
    """One object. Plain numbers in the fixed frame, metres, nanoseconds.

    `state` is a `kalman_filter.State`. `z_m` is the height of the centre and `z_m2` its variance; `size_m` are the
    extents; `lower_hits` and `upper_hits` count the detections that show the ends of the body. `hits` counts the
    detections, of which `first_ns` and `last_ns` are the first and the latest. `unseen_s` is the time since the latest
    one. `visibility` is that in the latest image of each camera: SEEN, PRESENT, STAYED, or as `status`; since the
    stamps `since_ns`. `latest` is the latest Measurement, and `log_odds` is the track score. `kind` is the class of the
    group that has the most of the filtered scores `votes`; `score` is the filtered score of the detections, `detection`
    the `Detection.index` in the latest image. `innovation_m` is that of the latest image if its noise is assumed,
    otherwise 0. `slow_mps` is the velocity, filtered over `SLOW_S`. `misplaced` are the log odds that outliers have
    moved this track. `is_moving` is whether it moved at the latest detection. `appearance` is the `Appearance`, None if
    unknown, and `met` are the IDs of the tracks that were detected in an image together with this one.
    """

    def __init__(self, track_id: int, measurement: Measurement, stamp_ns: int, camera: str, speed_mps: float,
                 log_odds: float) -> None:
        """Start a track with a track score; the velocity is unknown, with the standard deviation `speed_mps` along each
        axis.
        """
        detection, speed_m2 = measurement.detection, speed_mps ** 2
        self.id, self.kind, self.score, self.detection = track_id, measurement.kind, detection.score, detection.index
        self.state = kalman_filter.State(measurement.x, measurement.y, 0.0, 0.0, measurement.xx, measurement.xy, 0.0,
                                         0.0, measurement.yy, 0.0, 0.0, speed_m2, 0.0, speed_m2)
        self.z_m, self.z_m2, self.size_m = measurement.z, measurement.zz, measurement.size_m
        _left, top, _right, bottom = detection.truncated_edges
        self.lower_hits, self.upper_hits = int(not bottom), int(not top)
        self.latest = measurement
        self.hits, self.first_ns, self.last_ns, self.unseen_s = 1, stamp_ns, stamp_ns, 0.0
        self.status, self.innovation_m = VISIBLE, (0.0, 0.0)
        self.visibility, self.since_ns = {camera: SEEN}, {camera: stamp_ns}
        self.slow_mps, self.misplaced = (0.0, 0.0), 0.0
        self.log_odds, self.is_confirmed, self.is_moving = log_odds, False, False
        self.votes = {measurement.kind.label: _vote(detection.score)}
        self.appearance: Optional[Appearance] = None
        self.met: FrozenSet[int] = frozenset()
        self._update_appearance(detection)

    def predicted(self, elapsed_s: float, acceleration: float) -> 'Track':
        """A copy of this track `elapsed_s` later, not detected, given the acceleration density of people."""
        track = Track.__new__(Track)
        track.__dict__.update(self.__dict__)
        track.state = kalman_filter.predict(self.state, elapsed_s, acceleration * self.kind.known.acceleration)
        track.detection = NOT_DETECTED
        return track

    def set_visibility(self, camera: str, visibility: int, stamp_ns: int) -> None:
        """Set the visibility in the latest image of a camera. Copies of this track keep the previous one."""
        if self.visibility.get(camera) != visibility:
            self.visibility, self.since_ns = dict(self.visibility), dict(self.since_ns)
            self.visibility[camera], self.since_ns[camera] = visibility, stamp_ns

    def update(self, measurement: Measurement, stamp_ns: int, camera: str, rules: Rules) -> None:
        """Update this track, predicted to the stamp, with its measurement in the image of a camera."""
        self.set_visibility(camera, SEEN, stamp_ns)
        elapsed_s = (stamp_ns - self.last_ns) / NS
        period_s, share = elapsed_s - self.unseen_s, max(1 - math.exp(-elapsed_s / SLOW_S), 1 / self.hits)
        latest, self.latest = self.latest, measurement
        measurement = self._in_place(measurement, latest, period_s, rules.outliers)
        detection, state = measurement.detection, self.state
        is_assumed = measurement.is_assumed
        self.innovation_m = (measurement.x - state.x, measurement.y - state.y) if is_assumed else (0.0, 0.0)
        self.state = state = kalman_filter.update(state, measurement, rules.outliers)
        slow_u, slow_v = self.slow_mps
        self.slow_mps = slow_u + share * (state.u - slow_u), slow_v + share * (state.v - slow_v)
        log_odds = log_odds_of(detection.score, rules.even_log_odds)
        # At least that of a new track: an object may be where false detections were (as in Page's test, 1954).
        total = max(self.log_odds + min(period_s / HIT_CORRELATION_S, 1) * (log_odds + HIT), log_odds)
        self.log_odds = min(total, MAX_TRACK_SCORE)
        is_repeated = stamp_ns - self.first_ns >= CONFIRMING_NS
        self.is_confirmed = self.is_confirmed or is_repeated and self.log_odds >= rules.confirming_log_odds
        self.hits, self.last_ns, self.unseen_s = self.hits + 1, stamp_ns, 0.0
        self.status, self.detection = VISIBLE, detection.index
        limit_mps = rules.moving_speed * (STILL_MOVING if self.is_moving else 1)
        self.is_moving = math.hypot(state.u, state.v) >= limit_mps
        self._update_size(measurement)
        self._update_class(measurement.kind, detection.score, rules.kinds)
        self._update_appearance(detection)

    def _in_place(self, measurement: Measurement, latest: Measurement, period_s: float,
                  outliers: kalman_filter.OutlierModel) -> Measurement:
        """Resolve a measurement that is nearer than this track by the offset of outliers. Returns the one to use.

        If outliers have probably moved this track, it is moved back. Otherwise the box is wrong, and the measurement is
        moved to the track; always if several cameras have it in view, whose boxes differ where their poses are wrong.
        Other measurements are returned as they are.

        The log odds `misplaced` add up the log-likelihood ratios of the boxes. One of another kind than the `latest`
        counts fully, others by the time `period_s` since then, because errors of boxes last.
        """
        is_nearer = measurement.is_nearer
        share = min(period_s / OUTLIER_CORRELATION_S, 1) if is_nearer == latest.is_nearer else 1
        if not is_nearer:
            self.misplaced = max(self.misplaced + share * (outliers.log_outliers - outliers.log_inliers),
                                 LEAST_MISPLACED)
            return measurement
        self.misplaced += share * (outliers.log_inliers - outliers.log_nearer)
        cameras = sum(seen != OUT_OF_VIEW for seen in self.visibility.values())
        if self.misplaced < 0 or cameras > 1:
            return kalman_filter.moved_back(measurement, -measurement.ray_x, -measurement.ray_y, outliers)
        self.state = kalman_filter.moved_back(self.state, measurement.ray_x, measurement.ray_y, outliers)
        self.misplaced, self.latest = LEAST_MISPLACED, self.latest._replace(is_nearer=False)
        return measurement

    def miss(self, status: int, unseen_s: float, missed_s: float, detection_probability: float) -> None:
        """Mark this track as not detected for `unseen_s` and not detected where a camera should for `missed_s`."""
        self.status, self.unseen_s = status, self.unseen_s + unseen_s
        self.log_odds += min(missed_s / MISS_CORRELATION_S, 1) * math.log(1 - detection_probability)
        self.innovation_m = 0.0, 0.0

    def _update_size(self, measurement: Measurement) -> None:
        """Smooth the extents and the height, unless the box shows only a part of the width, whose ends may be others.

        The lower and the upper end are smoothed separately. An end that is truncated moves with the other one, so that
        the height stays constant, as does a lower end that is hidden: much higher than before, below the same head. An
        end that has never been visible is placed where the estimator expects it.
        """
        is_left_cut, is_top_cut, is_right_cut, is_bottom_cut = measurement.detection.truncated_edges
        if is_left_cut or is_right_cut:
            return
        (width_m, depth_m, height_m), (new_width_m, new_depth_m, new_height_m) = self.size_m, measurement.size_m
        up_m, taller_m = measurement.z - self.z_m, new_height_m - height_m
        lower_m, upper_m = up_m - taller_m / 2, up_m + taller_m / 2
        is_hidden = is_bottom_cut or abs(upper_m) < LEGS_M < lower_m
        self.lower_hits, self.upper_hits = self.lower_hits + (not is_hidden), self.upper_hits + (not is_top_cut)
        share = max(SMOOTHING, 1 / self.hits)
        lower_share = max(SMOOTHING, 1 / (self.lower_hits or self.hits))
        upper_share = max(SMOOTHING, 1 / (self.upper_hits or self.hits))
        lower_m, upper_m = lower_share * lower_m, upper_share * upper_m
        if is_hidden and (self.lower_hits or not is_bottom_cut):
            lower_m = upper_m
        if is_top_cut and self.upper_hits:
            upper_m = lower_m
        self.size_m = (width_m + share * (new_width_m - width_m), depth_m + share * (new_depth_m - depth_m),
                       max(height_m + upper_m - lower_m, LEAST_HEIGHT_M))
        self.z_m += (lower_m + upper_m) / 2
        self.z_m2 += (lower_share + upper_share) / 2 * (measurement.zz - self.z_m2)

    def _update_appearance(self, detection: Detection) -> None:
        """Average the colours of the clothes."""
        if detection.appearance is not None and detection.support >= LEAST_SUPPORT:
            self.appearance = (self.appearance or Appearance()).updated(detection.appearance)

    def _update_class(self, kind: Kind, score: float, kinds: Kinds) -> None:
        """Filter the score, and those of the classes of the group: the mean of the first detections, then a first-order
        filter. Unknown scores leave the score as it is.
        """
        share = max(SMOOTHING, 1 / self.hits)
        if score > 0:
            self.score = self.score + share * (score - self.score) if self.score > 0 else score
        if len(kind.members) > 1:
            votes = {label: (1 - share) * vote for label, vote in self.votes.items()}
            votes[kind.label] = votes.get(kind.label, 0.0) + share * _vote(score)
            self.votes, self.kind = votes, kinds[max(kind.members, key=lambda label: votes.get(label, 0.0))]


def _vote(score: float) -> float:
    """Weight of a detection for the class of its track: its score, 1 if unknown."""
    return score if score > 0 else 1.0


def log_odds_of(score: float, even_log_odds: float) -> float:
    """Log odds that a detection shows an object: its score is 0..1, 0 if unknown; half of the detections with the score
    of the log odds `even_log_odds` do.
    """
    log_odds = _logit(min(score if score > 0 else UNKNOWN_SCORE, LARGEST_SCORE)) - even_log_odds
    return min(log_odds, MAX_LOG_ODDS)


def log_odds_of_arrival(period_s: Optional[float]) -> float:
    """Log odds that a new detection shows a person who has come into view in the time `period_s` since the previous
    image of the camera, None for its first one, relative to those after `HIT_CORRELATION_S`. After less, new false
    detections are rarer, too, as those of the previous image repeat.
    """
    arrival_s = ARRIVAL_S if period_s is None else min(max(period_s, HIT_CORRELATION_S), ARRIVAL_S)
    return math.log(arrival_s / HIT_CORRELATION_S)


def _logit(probability: float) -> float:
    return math.log(probability / (1 - probability))
