"""Predictions of recorded pedestrians 2 s ahead, by kind of motion: those who walk, start, stop, wait.

The data is a folder with a folder of CSV files for each kind. A file shows one person: `timestamp` (s), `x`, `y` (m).
Recordings are resampled to each rate, with their true positions and with noise. The tracker gets one person at a time,
without covariances, and learns the noise. The plain filter is its Kalman filter, extrapolated with its velocity and its
acceleration; the constant velocity is that of the last `STEP_S` or of the last image, if that takes longer.
"""
import math
import os
from typing import NamedTuple

import numpy as np

from ros_3d_bb.tracking.tracker import Tracker
from ros_3d_bb_lab.evaluation.defaults import data_folder, in_range
from ros_3d_bb_lab.evaluation.text_table import line_of
from ros_3d_bb_lab.evaluation.tracking.csv_tables import read_rows
from ros_3d_bb_lab.evaluation.tracking.metrics import WITHIN_95
from ros_3d_bb_lab.evaluation.tracking.prediction_benchmark import (HORIZON_S, PARAMS, predicted, step_velocity_mps,
                                                                    tracked)

COLUMNS = ('timestamp', 'x', 'y')
AS_RECORDED_HZ = 10  # rate of the main result
RATES_HZ = (30, 15, 10, 5, 3)
NOISES_M = {'true': 0.0, 'noise_5cm': 0.05}
STEP_S = 0.1
OBSERVED_S, FEWEST_OBSERVED = 0.7, 3  # duration and number of images before predictions count
KEYS = ('coverage_95_2s', 'ours_fde_2s_m', 'cv_fde_2s_m', 'area_95_2s_m2', 'nll_2s', 'plain_coverage_95_2s',
        'plain_fde_2s_m', 'plain_area_95_2s_m2', 'plain_nll_2s')
ERRORS = ('distance', 'error_m', 'area_m2', 'nll')  # of a prediction with a covariance, see `_errors`


class Clip(NamedTuple):
    """One person: times (n,), seconds, and places (n, 2), metres."""

    times_s: np.ndarray
    points_m: np.ndarray


def read_clips(folder):
    """The clips of each kind, {name: [Clip]}. Raises ValueError if there are none, or one cannot be read."""
    kinds = {}
    for kind in sorted(os.listdir(folder)):
        path = os.path.join(folder, kind)
        names = sorted(name for name in os.listdir(path) if name.endswith('.csv')) if os.path.isdir(path) else ()
        if names:
            kinds[kind] = [_clip(os.path.join(path, name)) for name in names]
    if not kinds:
        raise ValueError('%s has no folder with .csv files; one for each kind of motion expected, with the columns %s'
                         % (folder, ','.join(COLUMNS)))
    return kinds


def _clip(path):
    rows = np.array([list(row.values()) for row in read_rows(path, COLUMNS)])
    if len(rows) < 2 or not np.isfinite(rows).all() or not (np.diff(rows[:, 0]) > 0).all():
        raise ValueError('%s has no two finite rows with increasing timestamp' % path)
    return Clip(rows[:, 0], rows[:, 1:])


def scores_of(clips, rate_hz, noise_m=0.0, seed=0):
    """Scores of all predictions for the clips of one kind at a rate: {key: value} with the `KEYS`.

    `coverage` is the share 0..1 inside the 95 % ellipse, `area` the mean area of the ellipse, and `nll` the mean
    negative log likelihood of the true position, in nats with metres. Values are None without predictions.
    """
    tracker, rows = Tracker(PARAMS), []
    for number, clip in enumerate(clips):
        rows += _clip_errors(tracker, clip, rate_hz, noise_m, np.random.RandomState([seed, number]))
    if not rows:
        return dict.fromkeys(KEYS)
    columns = np.array(rows).T
    columns[[1, 5]] = columns[[1, 5]] < WITHIN_95
    cv, coverage, error_m, area_m2, nll, *plain = [float(mean) for mean in columns.mean(axis=1)]
    return dict(zip(KEYS, [coverage, error_m, cv, area_m2, nll] + plain))


def _clip_errors(tracker, clip, rate_hz, noise_m, random):
    """Yield, for each prediction, the error of the constant velocity, and the `ERRORS` of ours and the plain filter."""
    count = int((clip.times_s[-1] - clip.times_s[0]) * rate_hz + 1e-6) + 1
    times_s = clip.times_s[0] + np.arange(count) / rate_hz
    true_m = np.column_stack([np.interp(times_s, clip.times_s, values_m) for values_m in clip.points_m.T])
    seen_m = true_m + random.normal(0, noise_m, true_m.shape) if noise_m else true_m
    ahead, steps = int(round(HORIZON_S * rate_hz)), max(int(round(STEP_S * rate_hz)), 1)
    for row, track in enumerate(tracked(tracker, times_s, seen_m)):
        is_observed = row + 1 >= FEWEST_OBSERVED and times_s[row] - times_s[0] >= OBSERVED_S - 1e-6
        if track is None or not is_observed or row < steps or row + ahead >= count:
            continue
        future_m = true_m[row + ahead]
        constant_m = seen_m[row] + HORIZON_S * step_velocity_mps(times_s, seen_m, row, steps)
        yield ((np.linalg.norm(constant_m - future_m),) + _errors(future_m, *predicted(track))
               + _errors(future_m, *_extrapolated(track)))


def _extrapolated(track):
    """Position (2,) and covariance (2, 2) of a TrackedObject after `HORIZON_S`, by its Kalman filter alone."""
    position, cross, velocity = (track.covariance[rows, columns] for rows, columns in (
        (slice(0, 2), slice(0, 2)), (slice(0, 2), slice(3, 5)), (slice(3, 5), slice(3, 5))))
    spread_m2 = PARAMS.acceleration * HORIZON_S ** 3 / 3
    return (track.position_m[:2] + HORIZON_S * track.velocity_mps[:2],
            position + HORIZON_S * (cross + cross.T) + HORIZON_S ** 2 * velocity + spread_m2 * np.eye(2))


def _errors(future_m, mean_m, covariance_m2):
    """The `ERRORS` of a prediction: squared Mahalanobis distance, error, area of the 95 % ellipse, and NLL."""
    error_m, determinant = mean_m - future_m, np.linalg.det(covariance_m2)
    distance = error_m.dot(np.linalg.solve(covariance_m2, error_m))
    return (distance, np.linalg.norm(error_m), math.pi * WITHIN_95 * math.sqrt(determinant),
            distance / 2 + math.log(2 * math.pi) + math.log(determinant) / 2)


def run(arguments):
    """Print the scores by kind, rate and noise. Returns {kind: scores}; those of all rates are in
    `rates.<rate>.<noise>` of a kind.
    """
    if not arguments.data:
        raise ValueError('no recordings found; --data DIR or ROS_3D_BB_DATA expected')
    result = {}
    for kind, clips in read_clips(arguments.data).items():
        rates = {}
        for rate_hz in RATES_HZ:
            rates[str(rate_hz)] = {noise: scores_of(clips, rate_hz, noise_m, arguments.seed)
                                   for noise, noise_m in NOISES_M.items()}
            for noise, scores in rates[str(rate_hz)].items():
                print(line_of('%s, %d Hz, %s:' % (kind, rate_hz, noise), **scores), flush=True)
        result[kind] = dict(rates[str(AS_RECORDED_HZ)]['true'], rates=rates)
    return result


def add_options(parser):
    """Add the options of the command."""
    parser.add_argument('--data', default=data_folder('vru'), metavar='DIR',
                        help='folder with a folder of CSV files for each kind of motion, with the columns %s (default: '
                        '$ROS_3D_BB_DATA/data/vru if it exists)' % ','.join(COLUMNS))
    parser.add_argument('--seed', type=in_range(int, 0, 2 ** 32 - 1), default=0, metavar='N',
                        help='random seed of the noise (default: 0)')
