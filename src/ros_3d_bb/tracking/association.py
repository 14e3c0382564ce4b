"""Data association: the gate and the costs of pairs of a track and a measurement, their assignment, and new tracks."""
import itertools
import math
from typing import Any, Callable, Dict, Iterable, List, Optional, Sequence, Set, Tuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.appearance import MOST_ALIKE, evidence_of_pairs
from ros_3d_bb.tracking.kalman_filter import OutlierModel, as_outlier, weighted
from ros_3d_bb.tracking.measurement_model import Measurement
from ros_3d_bb.tracking.out_of_sequence import DetectedImage
from ros_3d_bb.tracking.track import (ARRIVAL_S, LEGS_M, MIN_TRACK_SCORE, SEEN, Rules, Track, log_odds_of,
                                      log_odds_of_arrival)

UNSURE_SHARE = 0.1  # upper bound of the new-target density, relative to the peak density of the detection; chosen
HEAD_SIGMAS = 2.0  # standard deviation of the head top relative to that of the height; chosen: the camera tilts
HIDDEN_LEGS_COST = 1.0  # of a box whose top matches and whose lower end is too high for another person; chosen
# Most cost of a height: people change their posture. It is -ln [P height_sigma sqrt(2 pi) / 1 m] if in P = 3 % of the
# boxes, the height is anywhere within 1 m; P is chosen.
POSTURE_COST = 5.0
CROWD = 200  # pairs from which on arrays are faster than numbers; measured with `./run bench speed`
# Of the birth of tracks. All are chosen; `./run bench tracking` and `./run bench scenes` show the effect of others.
RECENTLY_MATCHED_NS = NS // 2  # no track starts near a track that was matched less than this ago
STARTING_SUPPORT = 0.2  # minimum support of a detection that starts a track: most positions with less are wrong
NEW_NS = 3 * NS // 2  # people pass each other later than that after they were first detected
SAME_PERSON_M = 0.15  # two people who are both visible cannot be this close to each other
LOG_TWO_PI = math.log(2 * math.pi)
Pair = Tuple[int, int]  # numbers of the track and of the measurement
Costs = Dict[Pair, float]
Gate = Tuple[float, float, float]  # see `_gate`


def associate(tracks: Sequence[Track], measurements: Sequence[Measurement], detection_log_odds: Sequence[float],
              params: Any, outliers: OutlierModel) -> List[Tuple[Track, Measurement]]:
    """Assign measurements to confirmed tracks first, and then to tentative ones.

    A pair is allowed only if it is more likely than that the measurement is of a new target and the track is missed
    (the gate), and both have the same group of classes. Of the allowed pairs, those are selected that explain all
    measurements best, with a new target where no pair is left. `detection_log_odds` are those that each track is
    detected, and not missed; `params` are `tracker.TrackerParams`, `outliers` their OutlierModel. Returns a list of
    (Track, Measurement).
    """
    matches = []
    taken: Set[int] = set()
    allowed, nearer = allowed_costs(tracks, measurements, detection_log_odds, params, outliers)
    for is_confirmed in (True, False):
        costs = {pair: cost for pair, cost in allowed.items()
                 if tracks[pair[0]].is_confirmed == is_confirmed and pair[1] not in taken}
        for row, column in costs if len(costs) == 1 else _assigned(costs):
            track, measurement = tracks[row], measurements[column]
            matches.append((track, measurement._replace(is_nearer=True) if (row, column) in nearer else measurement))
            taken.add(column)
    return matches


def detection_log_odds_of(tracks: Sequence[Track], camera: str, period_s: Optional[float],
                          detection_probability: float) -> List[float]:
    """Log odds that each track is detected in the image of a camera, and not missed, a list; 0, unknown, of tracks that
    are not confirmed, or that the previous image, `period_s` before, does not show, or that have left since.
    """
    log_odds = math.log(detection_probability / (1 - detection_probability))
    is_recent = period_s is not None and period_s <= ARRIVAL_S
    return [log_odds if is_recent and track.is_confirmed and track.visibility.get(camera) == SEEN else 0.0
            for track in tracks]


def allowed_costs(tracks: Sequence[Track], measurements: Sequence[Measurement], detection_log_odds: Sequence[float],
                  params: Any, outliers: OutlierModel) -> Tuple[Costs, Set[Pair]]:
    """The costs {(number of the track, number of the measurement): cost} of the allowed pairs, less those of a new
    target and a missed track; and the set of the pairs that fit better if the measurement is nearer than the track by
    the offset of outliers.

    As in Reid, An Algorithm for Tracking Multiple Targets (1979), the cost is -log [P p / ((1 - P) q)], where P is the
    probability of detection, p the density of the measurement given the track, of their heights and of their
    appearance, and q that of new targets, per m².
    """
    evidence = evidence_of_pairs(tracks, measurements)
    most = (MOST_ALIKE if evidence else 0.0) + max(detection_log_odds, default=0.0)
    new_cost = -math.log(params.new_target_density)
    gates = [_gate(measurement, params.new_target_density, outliers, most) for measurement in measurements]
    is_crowd = len(tracks) * len(measurements) >= CROWD
    pairs = (_likely_pairs_of_crowd if is_crowd else _likely_pairs)(tracks, measurements, gates, outliers)
    costs, nearer = {}, set()
    for row, column, cost, is_nearer in pairs:
        track, measurement = tracks[row], measurements[column]
        cost += height_cost(track, measurement, params.height_sigma) - evidence.get((row, column), 0.0)
        limit = gates[column][0] - most
        cost -= max(detection_log_odds[row] - (limit - new_cost), 0.0)  # the limit of uncertain boxes is high enough
        if cost < limit and track.kind.group == measurement.kind.group:
            costs[row, column] = cost - limit
            if is_nearer:
                nearer.add((row, column))
    return costs, nearer


def _gate(measurement: Measurement, new_target_density: float, outliers: OutlierModel, evidence: float) -> Gate:
    """The cost of a new target plus the most `evidence` of an appearance, and two lengths for a first look: a pair is
    above this cost from the distance `factor` * sqrt(tr P) + `reach` on, where P is the covariance of the position of
    the track.

    The cost of a new target is -log of its density; at least that of a measurement whose own noise makes every density
    low: an uncertain detection fits a new target and a track about equally well, and the track takes precedence. The
    density of a Gaussian at the distance d of its mean is at most exp(-d² / (2 tr S)) / (2 pi sqrt(det R)), where R
    is the noise and S = P + R the covariance of the innovation; the square root of tr S is at most the sum of those of
    tr P and tr R. Outliers are nearer by their offset, and have a larger R.
    """
    determinant = measurement.xx * measurement.yy - measurement.xy * measurement.xy
    limit = -math.log(min(new_target_density, UNSURE_SHARE / (2 * math.pi * math.sqrt(determinant)))) + evidence
    factor = math.sqrt(max(2 * (limit - LOG_TWO_PI) - math.log(determinant), 0))
    reach = factor * math.sqrt(measurement.xx + measurement.yy + outliers.spread_m2) + outliers.offset_m
    return limit, factor, reach


def position_cost(x: float, y: float, xx: float, xy: float, yy: float, ray_x: float, ray_y: float,
                  outliers: OutlierModel) -> float:
    """-log of the density of an innovation (x, y) with the covariance (xx, xy, yy), per m²."""
    inlier, _a_x, _a_y, _determinant = weighted(x, y, xx, xy, yy, outliers.log_inliers)
    x, y, xx, xy, yy = as_outlier(x, y, xx, xy, yy, ray_x, ray_y, outliers)
    outlier, _a_x, _a_y, _determinant = weighted(x, y, xx, xy, yy, outliers.log_outliers)
    larger, smaller = (inlier, outlier) if inlier > outlier else (outlier, inlier)
    return LOG_TWO_PI - larger - math.log1p(math.exp(smaller - larger))


def position_costs(x: Any, y: Any, xx: Any, xy: Any, yy: Any, ray_x: Any, ray_y: Any,
                   outliers: OutlierModel) -> np.ndarray:
    """As `position_cost`, of arrays."""
    outlier = as_outlier(x, y, xx, xy, yy, ray_x, ray_y, outliers)
    return LOG_TWO_PI - np.logaddexp(weighted(x, y, xx, xy, yy, outliers.log_inliers, np.log)[0],
                                     weighted(*outlier, log_share=outliers.log_outliers, log=np.log)[0])


def nearer_cost(x: Any, y: Any, xx: Any, xy: Any, yy: Any, ray_x: Any, ray_y: Any, outliers: OutlierModel,
                log: Callable[[Any], Any] = math.log) -> Any:
    """As `position_cost`, of a box that is nearer than the track by the offset of outliers. With `log` = numpy.log, of
    arrays."""
    nearer = as_outlier(x, y, xx, xy, yy, -ray_x, -ray_y, outliers)
    return LOG_TWO_PI - weighted(*nearer, log_share=outliers.log_nearer, log=log)[0]


def _likely_pairs(tracks: Sequence[Track], measurements: Sequence[Measurement], gates: Sequence[Gate],
                  outliers: OutlierModel) -> Iterable[Tuple[int, int, float, bool]]:
    """The pairs (row, column, position cost, whether the measurement is nearer) with costs below those of new targets.
    """
    pairs = []
    for row, track in enumerate(tracks):
        x, y, _u, _v, xx, xy, _xu, _xv, yy = track.state[:9]
        spread = math.sqrt(xx + yy)
        for column, (measurement, (limit, factor, reach)) in enumerate(zip(measurements, gates)):
            far, to_x, to_y = factor * spread + reach, measurement.x - x, measurement.y - y
            if -far < to_x < far and -far < to_y < far:
                innovation = (to_x, to_y, xx + measurement.xx, xy + measurement.xy, yy + measurement.yy,
                              measurement.ray_x, measurement.ray_y, outliers)
                cost = position_cost(*innovation)
                before_cost = nearer_cost(*innovation) if not track.unseen_s else math.inf
                if min(cost, before_cost) < limit:
                    pairs.append((row, column, min(cost, before_cost), before_cost < cost))
    return pairs


def _likely_pairs_of_crowd(tracks: Sequence[Track], measurements: Sequence[Measurement], gates: Sequence[Gate],
                           outliers: OutlierModel) -> Iterable[Tuple[int, int, float, bool]]:
    """As `_likely_pairs`, by arrays."""
    x, y, xx, xy, yy = np.array([track.state for track in tracks]).T[[0, 1, 4, 5, 8]]
    is_recent = np.array([not track.unseen_s for track in tracks])
    to_x, to_y, noise_xx, noise_xy, noise_yy, ray_x, ray_y, limits, factors, reaches = np.array([
        (measurement.x, measurement.y, measurement.xx, measurement.xy, measurement.yy, measurement.ray_x,
         measurement.ray_y) + gate for measurement, gate in zip(measurements, gates)]).T
    far = reaches + factors * np.sqrt(xx + yy)[:, None]
    rows, columns = ((np.abs(to_x - x[:, None]) < far) & (np.abs(to_y - y[:, None]) < far)).nonzero()
    innovations = (to_x[columns] - x[rows], to_y[columns] - y[rows], xx[rows] + noise_xx[columns],
                   xy[rows] + noise_xy[columns], yy[rows] + noise_yy[columns], ray_x[columns], ray_y[columns], outliers)
    costs = position_costs(*innovations)
    before_costs = np.where(is_recent[rows], nearer_cost(*innovations, log=np.log), np.inf)
    least = np.minimum(costs, before_costs)
    is_likely = least < limits[columns]
    return zip(*(values[is_likely].tolist() for values in (rows, columns, least, before_costs < costs)))


def height_cost(track: Track, measurement: Measurement, sigma_m: float) -> float:
    """Association cost of the height difference: its negative log likelihood, 0 for the same height.

    The height is unknown if the image border truncates the box, or has truncated all previous boxes of the track. The
    tops of the heads are then compared if both are known; otherwise the cost is 0. As furniture occludes only the lower
    part of a body, a box without legs costs at most that of the tops plus `HIDDEN_LEGS_COST`. No cost is above
    `POSTURE_COST`.
    """
    _left, is_top_cut, _right, is_bottom_cut = measurement.detection.truncated_edges
    if not track.upper_hits or is_top_cut:
        return 0.0
    height_m, seen_m = track.size_m[2], measurement.size_m[2]
    if track.is_confirmed:
        sigma_m *= math.sqrt(1 + 1 / track.hits)  # error of the mean of its boxes; other tracks may be of false boxes
    higher_m = track.z_m + height_m / 2 - measurement.z - seen_m / 2
    top_cost = (higher_m / (HEAD_SIGMAS * sigma_m)) ** 2 / 2
    if not track.lower_hits or is_bottom_cut:
        return min(top_cost, POSTURE_COST)
    costs = [((height_m - seen_m) / sigma_m) ** 2 / 2, POSTURE_COST]
    if abs(height_m - seen_m - higher_m) > LEGS_M:
        costs.append(top_cost + HIDDEN_LEGS_COST)
    return min(costs)


def _assigned(costs: Costs) -> List[Pair]:
    """The pairs with the minimum total cost, from {(row, column): cost} of the allowed ones: not always as many pairs
    as possible."""
    if not costs:
        return []
    rows, columns = (sorted(set(numbers)) for numbers in zip(*costs))
    if len(rows) == len(columns) == len(costs):  # no choice
        return sorted(costs)
    matrix = np.zeros((len(rows), len(columns)))
    row_of, column_of = ({number: place for place, number in enumerate(numbers)} for numbers in (rows, columns))
    for (row, column), cost in costs.items():
        matrix[row_of[row], column_of[column]] = cost
    found = zip(*(places.tolist() for places in linear_sum_assignment(matrix)))
    return [pair for pair in ((rows[row], columns[column]) for row, column in found) if pair in costs]


def initiate(tracks: Iterable[Track], unmatched: Iterable[Measurement], image: DetectedImage,
             period_s: Optional[float], params: Any, rules: Rules, assign_id: Callable[[int], int]) -> List[Track]:
    """Start tracks from the unmatched measurements of an image, except those that are ignored, or have little support
    or a low score, and duplicate detections of recently matched or new tracks of the same group of classes. Returns the
    new tracks.

    `period_s` is the time since the previous image of the camera, None for its first one. `params` are
    `tracker.TrackerParams`, `rules` the `track.Rules`; assign_id(number) returns the ID of the track that the detection
    of this number starts.
    """
    stamp_ns, camera, arrival_log_odds = image.stamp_ns, image.view.camera, log_odds_of_arrival(period_s)
    new, occupied = [], [(track.state.x, track.state.y, track.kind.group) for track in tracks
                         if stamp_ns - track.last_ns < RECENTLY_MATCHED_NS]
    for measurement in unmatched:
        detection, kind, x, y = measurement.detection, measurement.kind, measurement.x, measurement.y
        log_odds = log_odds_of(detection.score, rules.even_log_odds)
        is_duplicate = any(math.hypot(other_x - x, other_y - y) < params.duplicate_distance and group == kind.group
                           for other_x, other_y, group in occupied)
        is_excluded = is_duplicate or detection.is_ignored
        if log_odds > MIN_TRACK_SCORE and detection.support >= STARTING_SUPPORT and not is_excluded:
            occupied.append((x, y, kind.group))
            new.append(Track(assign_id(measurement.number), measurement, stamp_ns, camera,
                             params.initial_speed * kind.known.initial_speed, log_odds + arrival_log_odds))
    return new


def duplicates(tracks: Sequence[Track], stamp_ns: int) -> Set[int]:
    """The IDs of the tracks that are of the object of an older track: both are confirmed, recently matched and at one
    place, and of one group of classes. Tracks that exist for longer than `NEW_NS` are of different objects, which pass
    each other.
    """
    recent = [track for track in tracks if track.is_confirmed and stamp_ns - track.last_ns < RECENTLY_MATCHED_NS]
    if all(stamp_ns - track.first_ns >= NEW_NS for track in recent):
        return set()
    recent.sort(key=lambda track: track.first_ns)
    found, by_x = set(), sorted(enumerate(recent), key=lambda entry: entry[1].state.x)
    for number, (age, track) in enumerate(by_x):
        for other_age, other in itertools.islice(by_x, number + 1, None):
            if other.state.x - track.state.x >= SAME_PERSON_M:
                break
            younger = recent[max(age, other_age)]
            if stamp_ns - younger.first_ns < NEW_NS and _are_same(track, other):
                found.add(younger.id)
    return found


def _are_same(track: Track, other: Track) -> bool:
    distance_m = math.hypot(track.state.x - other.state.x, track.state.y - other.state.y)
    return distance_m < SAME_PERSON_M and track.kind.group == other.kind.group
