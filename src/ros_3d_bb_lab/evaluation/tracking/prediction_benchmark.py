"""Predictions of recorded pedestrians 2 s ahead from their positions, by kind of motion: walk, start, stop, wait.

The data is a folder with a folder of CSV files for each kind. A file shows one person: `timestamp` (s), `x`, `y` (m).
Recordings are resampled to each rate, with their true positions and with noise. The tracker gets one person at a time,
in the order of appearance, without covariances: it learns the noise from earlier people. The constant velocity is that
of the last `STEP_S`, or of the last image, if that takes longer.
"""
import math
import os

import numpy as np

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.tracker import Tracker, TrackerParams
from ros_3d_bb.tracking.types import CameraView, Detection
from ros_3d_bb_lab.evaluation.defaults import data_folder, in_range
from ros_3d_bb_lab.evaluation.text_table import line_of
from ros_3d_bb_lab.evaluation.tracking.metrics import WITHIN_95
from ros_3d_bb_lab.evaluation.tracking.trajectories import read_rows

# Defaults, except that true positions are no depth of the background, and all are those of one person.
PARAMS = TrackerParams(outlier_share=0.0, new_target_density=1e-9)
HORIZON_S = 2.0
SIZE_M = np.array([0.5, 0.5, 1.7])
COLUMNS = ('timestamp', 'x', 'y')
AS_RECORDED_HZ = 10  # rate of the main result
RATES_HZ = (30, 15, 10, 5, 3)
NOISES_M = {'true': 0.0, 'noise_5cm': 0.05}
STEP_S = 0.1
OBSERVED_S, FEWEST_OBSERVED = 0.7, 3  # duration and number of images before predictions count
STANDING_MPS = 0.3  # people stand whose tracks are slower; chosen
KEYS = 'cv_fde_2s_m', 'coverage_95_2s', 'ours_fde_2s_m', 'area_95_2s_m2'


def _mean(values):
    return float(np.mean(values)) if len(values) else None


def read_clips(folder):
    """The clips of each kind, {name: [(times (n,), places (n, 2))]}. Raises ValueError if there are none, or one cannot
    be read."""
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
    return rows[:, 0], rows[:, 1:]


def scores_of(clips, rate_hz, noise_m=0.0, seed=0):
    """Scores of all predictions for the clips of one kind at a rate: {key: value} with the `KEYS`, `standing` and
    `standing_coverage_95_2s`.

    `coverage` is the share 0..1 inside the 95 % ellipse, `area` the mean area of the ellipse, and `standing` the number
    of predictions of people who stand. Values are None without predictions.
    """
    tracker, rows = Tracker(PARAMS), []
    for number, (times_s, points_m) in enumerate(clips):
        random = np.random.RandomState([seed, number])
        rows += _clip_errors(tracker, times_s, points_m, rate_hz, noise_m, random)
    values = np.reshape(rows, (-1, len(KEYS) + 1))
    is_standing = values[:, -1] < STANDING_MPS
    scores = {key: _mean(column) for key, column in zip(KEYS, values.T)}
    inside = values[is_standing, KEYS.index('coverage_95_2s')]
    return dict(scores, standing=len(inside), standing_coverage_95_2s=_mean(inside))


def _clip_errors(tracker, recorded_s, recorded_m, rate_hz, noise_m, random):
    count = int((recorded_s[-1] - recorded_s[0]) * rate_hz + 1e-6) + 1
    times_s = recorded_s[0] + np.arange(count) / rate_hz
    true_m = np.column_stack([np.interp(times_s, recorded_s, values_m) for values_m in recorded_m.T])
    seen_m = true_m + random.normal(0, noise_m, true_m.shape) if noise_m else true_m
    ahead, steps = int(round(HORIZON_S * rate_hz)), max(int(round(STEP_S * rate_hz)), 1)
    for row, track in enumerate(tracked(tracker, times_s, seen_m)):
        is_observed = row + 1 >= FEWEST_OBSERVED and times_s[row] - times_s[0] >= OBSERVED_S - 1e-6
        if track is not None and is_observed and row >= steps and row + ahead < count:
            future_m = true_m[row + ahead]
            yield ((_constant_error_m(times_s, seen_m, row, steps, future_m),)
                   + _errors(future_m, *_predicted(track)) + (np.linalg.norm(track.velocity_mps),))


def tracked(tracker, times_s, points_m):
    """Yield the latest published track, None without one, of a person at times (n,) and places (n, 2), after each."""
    tracker.reset()
    view = CameraView(np.eye(4))
    for time_s, point_m in zip(times_s, points_m):
        detection = Detection(np.append(point_m, SIZE_M[2] / 2), SIZE_M)
        tracks = tracker.update(int(round((time_s - times_s[0] + 1) * NS)), [detection], view)
        yield max(tracks, key=lambda track: track.last_seen_ns) if tracks else None


def _predicted(track):
    step = int(round(HORIZON_S / track.prediction_step_s)) - 1
    return track.prediction_m[step, :2], track.prediction_covariance_m2[step, :2, :2]


def _constant_error_m(times_s, points_m, row, steps, future_m):
    """Error of the position that the velocity over the `steps` before a row predicts."""
    velocity_mps = (points_m[row] - points_m[row - steps]) / (times_s[row] - times_s[row - steps])
    return np.linalg.norm(points_m[row] + HORIZON_S * velocity_mps - future_m)


def _errors(future_m, mean_m, covariance_m2):
    """Whether a future position is in the 95 % ellipse of a prediction, the error, and the area of the ellipse."""
    error_m = mean_m - future_m
    is_inside = error_m.dot(np.linalg.solve(covariance_m2, error_m)) < WITHIN_95
    return is_inside, np.linalg.norm(error_m), math.pi * WITHIN_95 * math.sqrt(np.linalg.det(covariance_m2))


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
    parser.add_argument('--data', default=data_folder('vru'), metavar='DIR',
                        help='folder with a folder of CSV files for each kind of motion, with the columns %s (default: '
                        '$ROS_3D_BB_DATA/data/vru if it exists)' % ','.join(COLUMNS))
    parser.add_argument('--seed', type=in_range(int, 0, 2 ** 32 - 1), default=0, metavar='N',
                        help='random seed of the noise (default: 0)')
