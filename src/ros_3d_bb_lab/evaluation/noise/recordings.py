"""Error model from recordings with ground truth of moving people: also how long errors last, and what is detected.

A session of single images shows neither. The errors of people in the images of a recording are matched with the truth
within `tracking.metrics.PAIRED_M`.
"""
import datetime
from typing import NamedTuple

import numpy as np

from ros_3d_bb.camera.camera_model import transform_points
from ros_3d_bb.core.detector_model import DetectorModel
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.types import VISIBLE
from ros_3d_bb_lab.evaluation.error_model_fit import fit_error_model
from ros_3d_bb_lab.evaluation.matching import assign, plane_distances
from ros_3d_bb_lab.evaluation.tracking.metrics import PAIRED_M

BAND_M, LEAST_IN_BAND = 4.0, 20  # bands of range, and images of people that one needs, for the detection probability
DETECTED = 0.8  # share of the people in a band up to which the range of the detector extends
MOST_DETECTED = 0.99
LONGEST_LAG_S = 1.5
TIMES_S = np.geomspace(0.02, 5.0, 49)  # candidates for the correlation time
LEAST_PAIRS = 100  # of errors at two times, for the correlation time


class MatchedPeople(NamedTuple):
    """People who should be detected, one row for each image and person: `person` (n,), `stamp_ns` (n,), `range_m` (n,),
    whether they are `detected` (n,), and the measured position (n, 3) and the true x, z (n, 2) in the optical frame,
    NaN if not."""

    person: np.ndarray
    stamp_ns: np.ndarray
    range_m: np.ndarray
    detected: np.ndarray
    measured_m: np.ndarray
    truth_m: np.ndarray


def fit_recordings(runs, source, camera):
    """Fit an ErrorModel to a list of `recorded_detections.RecordedRun`. Raises ValueError as `fit_error_model`."""
    people = match_people(runs)
    found = people.detected
    measured_m, truth_m = people.measured_m[found], people.truth_m[found]
    model = fit_error_model(measured_m, truth_m, source, '', camera, datetime.date.today().isoformat(),
                            people.person[found])
    errors_m = model.corrected(measured_m)[:, [0, 2]] - truth_m
    lasting_m, time_s = lasting_errors(errors_m, people.person[found], people.stamp_ns[found])
    probability, range_m = detection_range(people.range_m, found)
    return model._replace(detector=DetectorModel(lasting_m, time_s, probability, range_m))


def match_people(runs):
    """Match the detections of each image with the people who should be detected. Returns MatchedPeople.

    Raises ValueError if there are none.
    """
    rows = [row for number, run in enumerate(runs) for image in run.images for row in _match(image, number)]
    if not rows:
        raise ValueError('no person in the recordings counts; the ground truth of visible people expected')
    columns = [np.array(column) for column in zip(*rows)]
    return MatchedPeople(np.unique(columns[0], axis=0, return_inverse=True)[1].reshape(-1), *columns[1:])


def _match(image, number):
    """Yield the columns of MatchedPeople for each person of an image; a person is the number of the run and an ID."""
    truth = image.truth
    counts = np.flatnonzero(truth.status == VISIBLE)
    found_m = np.array([detection.position_m for detection in image.detections]).reshape(-1, 3)
    distances_m = plane_distances(truth.position_m[counts].reshape(-1, 2), found_m)
    pairs = dict(zip(*assign(np.where(distances_m <= PAIRED_M, distances_m, np.inf))))
    camera_from_fixed = np.linalg.inv(image.view.fixed_from_camera)
    ranges_m = np.hypot(*(truth.position_m[counts] - image.view.fixed_from_camera[:2, 3]).T)
    for row, person in enumerate(counts):
        measured_m, truth_m = np.full(3, np.nan), np.full(2, np.nan)
        if row in pairs:
            place_m = found_m[pairs[row]]
            measured_m = transform_points(camera_from_fixed, place_m)
            truth_m = transform_points(camera_from_fixed, np.append(truth.position_m[person], place_m[2]))[[0, 2]]
        yield (number, truth.ids[person]), image.stamp_ns, ranges_m[row], row in pairs, measured_m, truth_m


def lasting_errors(errors_m, person, stamp_ns):
    """Standard deviation of lasting errors, metres, and their correlation time, seconds.

    The autocovariance of the errors (n, 2) of a person is fitted by variance · exp(-lag / time), without the lag 0,
    where the independent errors add to it. Raises ValueError if too few people are detected repeatedly.
    """
    first, second = _pairs_of(person, stamp_ns)
    if len(first) < LEAST_PAIRS:
        raise ValueError('%d pairs of errors of a person within %g s; at least %d expected'
                         % (len(first), LONGEST_LAG_S, LEAST_PAIRS))
    lags_s = (stamp_ns[second] - stamp_ns[first]) / NS
    products_m2 = (errors_m[first] * errors_m[second]).mean(axis=1)
    best_cost, variance_m2, best_time_s = np.inf, 0.0, 0.0
    for time_s in TIMES_S:
        shape = np.exp(-lags_s / time_s)
        fitted_m2 = max(shape.dot(products_m2) / shape.dot(shape), 0.0)
        cost = ((products_m2 - fitted_m2 * shape) ** 2).sum()
        if cost < best_cost:
            best_cost, variance_m2, best_time_s = cost, fitted_m2, time_s
    return float(np.sqrt(variance_m2)), float(best_time_s)


def _pairs_of(person, stamp_ns):
    """Indices (m,) and (m,) of the earlier and later error of a person, more than 0 and at most LONGEST_LAG_S apart.

    Memory grows with the number of these pairs, not with the square of the number of errors.
    """
    order = np.lexsort((stamp_ns, person))
    pairs = [(order[:0], order[:0])]
    for step in range(1, len(order)):
        first, second = order[:-step], order[step:]
        lags_ns = stamp_ns[second] - stamp_ns[first]
        near = (person[first] == person[second]) & (lags_ns <= LONGEST_LAG_S * NS)
        if not near.any():  # with more steps between them, they are farther apart
            break
        near &= lags_ns > 0
        pairs.append((first[near], second[near]))
    return tuple(np.concatenate(indices) for indices in zip(*pairs))


def detection_range(range_m, detected):
    """Detection probability within the range of the detector, and that range, metres; None if people are detected up
    to the farthest ones."""
    bands = (range_m // BAND_M).astype(int)
    for band in range(bands.max() + 1):
        inside = bands == band
        if inside.sum() >= LEAST_IN_BAND and detected[inside].mean() < DETECTED:
            limit_m = band * BAND_M
            break
    else:
        limit_m = None
    within = detected if limit_m is None else detected[range_m < limit_m]
    if not len(within):
        raise ValueError('less than %d %% of the people nearer than %g m are detected' % (100 * DETECTED, BAND_M))
    return float(min(within.mean(), MOST_DETECTED)), limit_m
