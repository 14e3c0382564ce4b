"""Tracks as a structured array: update of matched tracks, start of new ones, and prediction for publishing.

Fixed frame, metres, nanoseconds.
"""
import itertools
from typing import NamedTuple

import numpy as np

from ros_3d_bb.core.object_classes import MAX_IN_GROUP
from ros_3d_bb.core.params import Param, parameters
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking import kalman_filter, track_score
from ros_3d_bb.tracking.types import PREDICTION_STEP, PREDICTION_TIME, VISIBLE, TrackedObject, prediction_times_s

# `hits` counts the detections of a track, `end_hits` those that showed the lower and the upper end of the body.
# `cut_ns` are the stamps of the latest detections of which the image border truncated these ends.
# `log_odds` is the track score (`track_score`).
# `unseen_s` is the time since the last detection, `missed_s` the part of it during which a detection was expected.
# `votes` are filtered scores of the classes of the group, of which `class_number` (see `ClassNumbers`) has the highest.
# `score` is the filtered score of the detections; `detection` is `Detection.index` in the latest image.
# `innovation_m` is the innovation of the latest image, for `noise_scale`.
TRACK = np.dtype([('id', int), ('mean', float, 4), ('covariance', float, (4, 4)), ('z_m', float), ('z_m2', float),
                  ('size_m', float, 3), ('end_hits', int, 2), ('cut_ns', np.int64, 2), ('hits', int),
                  ('first_ns', np.int64), ('last_ns', np.int64), ('missed_s', float), ('unseen_s', float),
                  ('status', int), ('log_odds', float), ('confirmed', bool), ('moving', bool), ('class_number', int),
                  ('votes', float, MAX_IN_GROUP), ('score', float), ('detection', int), ('innovation_m', float, 2)])
PUBLISHED = 'id', 'status', 'moving', 'first_ns', 'last_ns', 'class_number', 'score', 'detection'
RECENTLY_MATCHED_NS = NS // 5  # no track starts near a track that was matched less than this ago
SMOOTHING = 0.1  # weight of the newest detection in size, height and score
CUT_SMOOTHING = 0.02  # the same for boxes that the image border truncates sideways: the head may be outside
CUT_LASTS_NS = NS // 2  # hysteresis: an end is visible again this long after it was last truncated
NEVER_NS = -10 ** 18
LEAST_HEIGHT_M = 0.1
STARTING_SUPPORT = 0.2  # minimum support of a detection that starts a track: most positions with less are wrong
NEW_NS = NS  # people pass each other later than that after they were first detected
SAME_PERSON_M = 0.15  # two people who are both visible cannot be this close to each other
AXES = [[0], [1], [3], [4]]  # indices of x, y and their velocities among x, y, z and their velocities
STILL_MOVING = 0.5  # hysteresis: a moving track stops below this share of `moving_speed`


@parameters('kalman: how certain predictions are')
class PredictionParams(NamedTuple):
    """Parameters of the prediction of tracks."""

    prediction_time: float = PREDICTION_TIME
    prediction_step: float = PREDICTION_STEP
    prediction_acceleration: float = Param(
        0.03, 'How much more people turn than the filter models: density of a white acceleration.', 'm^2/s^3',
        live=(0, 1))
    standing_speed: float = Param(
        0.15, 'A velocity much lower than this is not extrapolated: it is mostly noise.', 'm/s', live=(0, 1))
    position_bias: float = Param(
        0.05, 'Standard deviation added for errors that stay the same for seconds.', 'm', live=(0, 0.5))


def update_matched(tracks, rows, measurements, stamp_ns, params, classes):
    """Update the tracks in `rows` in place, which are predicted to the stamp, with one measurement each."""
    matched = tracks[rows]
    matched['mean'], matched['covariance'] = kalman_filter.update(matched['mean'], matched['covariance'], measurements,
                                                                  params)
    period_s = (stamp_ns - matched['last_ns']) / NS - matched['unseen_s']
    track_score.add_detections(matched, measurements['score'], period_s, params)
    matched['hits'] += 1
    matched['last_ns'], matched['unseen_s'], matched['missed_s'], matched['status'] = stamp_ns, 0, 0, VISIBLE
    speed_mps = np.hypot(*matched['mean'][:, 2:].T)
    matched['moving'] = speed_mps >= params.moving_speed * np.where(matched['moving'], STILL_MOVING, 1)
    _update_size(matched, measurements, stamp_ns)
    _update_class(matched, measurements, classes)
    tracks[rows] = matched


def new_targets(tracks, measurements, stamp_ns, params, classes):
    """Start tracks from unmatched measurements, except measurements with little support or a low score, and duplicate
    detections of recently matched or new tracks of the same group of classes.

    Returns the new tracks, whose IDs are not set, and the indices of the measurements that started them.
    """
    new = np.zeros(len(measurements), TRACK)
    new['mean'][:, :2] = measurements['position_m']
    new['covariance'][:, :2, :2] = measurements['noise_m2']
    speeds_mps = params.initial_speed * classes.initial_speed[measurements['class_number']]
    new['covariance'][:, [2, 3], [2, 3]] = speeds_mps[:, None] ** 2
    for name in ('size_m', 'z_m', 'z_m2', 'class_number', 'score', 'detection'):
        new[name] = measurements[name]
    new['end_hits'] = ~measurements['cut_ends']
    new['cut_ns'] = np.where(measurements['cut_ends'], stamp_ns, NEVER_NS)
    new['hits'], new['first_ns'], new['last_ns'] = 1, stamp_ns, stamp_ns
    new['log_odds'] = track_score.log_odds_of(measurements['score'], params.even_score)
    new['votes'][np.arange(len(new)), classes.member[new['class_number']]] = _vote_weights(measurements)
    is_recent = stamp_ns - tracks['last_ns'] < RECENTLY_MATCHED_NS
    occupied_m = np.concatenate((tracks['mean'][is_recent, :2], new['mean'][:, :2]))
    groups = classes.group[np.concatenate((tracks['class_number'][is_recent], new['class_number']))]
    others, first = list(range(is_recent.sum())), is_recent.sum()
    kept = []
    trusted = (measurements['support'] >= STARTING_SUPPORT) & (new['log_odds'] > track_score.MIN_TRACK_SCORE)
    for row in np.flatnonzero(trusted).tolist():
        is_far = np.linalg.norm(occupied_m[others] - occupied_m[first + row], axis=1) >= params.duplicate_distance
        if (is_far | (groups[others] != groups[first + row])).all():
            kept.append(row)
            others.append(first + row)
    return new[kept], kept


def duplicates(tracks, stamp_ns, classes):
    """Which tracks (n,) are of the object of an older track: both are confirmed, recently matched and at one place, and
    of one group of classes. Tracks that exist for longer than `NEW_NS` are of different objects, which pass each other.
    """
    duplicate = np.zeros(len(tracks), bool)
    rows = np.flatnonzero(tracks['confirmed'] & (stamp_ns - tracks['last_ns'] < RECENTLY_MATCHED_NS))
    is_new = stamp_ns - tracks['first_ns'][rows] < NEW_NS
    if is_new.any():
        order = np.argsort(tracks['first_ns'][rows], kind='mergesort')
        rows, is_new = rows[order], is_new[order]
        places_m, groups = tracks['mean'][rows, :2], classes.group[tracks['class_number'][rows]]
        at_one_place = np.linalg.norm(places_m[:, None] - places_m, axis=2) < SAME_PERSON_M
        duplicate[rows] = is_new & np.tril(at_one_place & (groups[:, None] == groups), -1).any(axis=1)
    return duplicate


def _vote_weights(measurements):
    """Weights (n,) of the detections for the class of their tracks: their scores, 1 if unknown."""
    return np.where(measurements['score'] > 0, measurements['score'], 1)


def _update_class(matched, measurements, classes):
    """Filter the scores of each track with one measurement: of the classes of its group, and of its detections.

    The filter is the mean of the first measurements, then a first-order filter. Unknown scores leave the score as it
    is.
    """
    matched['detection'] = measurements['detection']
    scores, numbers = measurements['score'], measurements['class_number']
    share = np.maximum(SMOOTHING, 1 / matched['hits'])
    known = np.where(scores > 0, scores, matched['score'])
    matched['score'] = np.where(matched['score'] > 0, matched['score'] + share * (known - matched['score']), known)
    groups = classes.group[numbers]
    if (classes.size[groups] > 1).any():
        matched['votes'] *= 1 - share[:, None]
        matched['votes'][np.arange(len(matched)), classes.member[numbers]] += share * _vote_weights(measurements)
        matched['class_number'] = classes.numbers[groups, matched['votes'].argmax(axis=1)]


def _update_size(matched, measurements, stamp_ns):
    """Smooth the size and the height of each track with one measurement.

    The lower and the upper end are smoothed separately. A truncated end moves with the other one, so that the height
    stays constant. An end that has never been visible is placed where the estimator expects it. Detectors place the
    edge of a truncated person on either side of the limit of truncation, so an end stays truncated for `CUT_LASTS_NS`.
    """
    cut, cut_sideways = measurements['cut_ends'], measurements['cut_sideways']
    matched['cut_ns'] = np.where(cut, stamp_ns, matched['cut_ns'])
    was_cut = ~cut & (stamp_ns - matched['cut_ns'] < CUT_LASTS_NS)
    matched['end_hits'] += ~cut & ~was_cut
    held = was_cut | cut & (matched['end_hits'] > 0)
    end_share = np.where(held, 0, np.maximum(SMOOTHING, 1 / np.maximum(matched['end_hits'], 1)))
    share = np.maximum(SMOOTHING, 1 / matched['hits'])
    share[cut_sideways] = CUT_SMOOTHING
    end_share = np.minimum(end_share, np.where(cut_sideways, CUT_SMOOTHING, 1)[:, None])
    change_m = measurements['size_m'] - matched['size_m']
    up_m, taller_m = measurements['z_m'] - matched['z_m'], change_m[:, 2]
    lower_m, upper_m = end_share[:, 0] * (up_m - taller_m / 2), end_share[:, 1] * (up_m + taller_m / 2)
    lower_m = np.where(held[:, 0], upper_m, lower_m)
    upper_m = np.where(held[:, 1], lower_m, upper_m)
    matched['size_m'][:, :2] += share[:, None] * change_m[:, :2]
    matched['size_m'][:, 2] = np.maximum(matched['size_m'][:, 2] + upper_m - lower_m, LEAST_HEIGHT_M)
    matched['z_m'] += (lower_m + upper_m) / 2
    matched['z_m2'] += end_share.mean(axis=1) * (measurements['z_m2'] - matched['z_m2'])


def position_std_of(tracks):
    """Standard deviations (n,) of the positions, the larger one of x and y, metres."""
    return np.sqrt(np.maximum(tracks['covariance'][:, 0, 0], tracks['covariance'][:, 1, 1]))


def objects_of(tracks, params, classes):
    """Convert tracks to a list of TrackedObject with predictions at constant velocity; `params` are PredictionParams,
    `classes` ClassNumbers.

    A low velocity is mostly noise of a standing person. The predicted velocity v is therefore scaled by
    v² / (v² + standing_speed²). The covariance of the filter does not include errors that stay constant for seconds,
    such as those of a wrong calibration; `position_bias` is added for them. `prediction_acceleration` accounts for
    turns.
    """
    if not len(tracks):
        return []
    times_s = prediction_times_s(params.prediction_time, params.prediction_step)
    velocities_mps, level = tracks['mean'][:, 2:], np.eye(3)[:, :2]
    speed2 = (velocities_mps ** 2).sum(axis=1, keepdims=True)
    expected_mps = velocities_mps * speed2 / (speed2 + params.standing_speed ** 2 + 1e-12)
    velocities_mps = velocities_mps.dot(level.T)

    positions_m = np.column_stack((tracks['mean'][:, :2], tracks['z_m']))
    predictions_m = positions_m[:, None] + times_s[:, None] * expected_mps.dot(level.T)[:, None]
    predictions_m2 = level @ _covariances_ahead(tracks['covariance'], times_s, params) @ level.T
    predictions_m2[..., 2, 2] = tracks['z_m2'][:, None]
    covariances = np.zeros((len(tracks), 6, 6))
    covariances[:, AXES, np.transpose(AXES)] = tracks['covariance']
    covariances[:, [0, 1], [0, 1]] += params.position_bias ** 2
    covariances[:, 2, 2] = tracks['z_m2']

    columns = {name: tracks[name].tolist() for name in PUBLISHED}
    labels = [classes.labels[number] for number in columns['class_number']]
    return list(map(TrackedObject, columns['id'], positions_m, tracks['size_m'].copy(), velocities_mps, velocities_mps,
                    columns['status'], columns['moving'], columns['first_ns'], columns['last_ns'], predictions_m,
                    itertools.repeat(params.prediction_step), covariances, predictions_m2, labels, columns['score'],
                    columns['detection']))


def _covariances_ahead(covariance, times_s, params):
    """Covariances (n, steps, 2, 2) of the predicted positions."""
    position, velocity, both = covariance[:, None, :2, :2], covariance[:, None, 2:, 2:], covariance[:, None, :2, 2:]
    times = times_s[:, None, None]
    turned = params.prediction_acceleration * times ** 3 / 3 + params.position_bias ** 2
    return position + times * (both + both.transpose(0, 1, 3, 2)) + times ** 2 * velocity + turned * np.eye(2)
