"""Predictions from the true positions of recorded pedestrians: those of the tracker, and a constant velocity.

As in Schöller et al., What the Constant Velocity Model Can Teach Us About Pedestrian Motion Prediction (RA-L 2020), a
person is observed for 8 steps of the recording, and the constant velocity is that of the last step. The tracker gets
one person at a time, in the order of appearance, and without covariances: it learns the noise of the recording from
earlier people. Its parameters are `PARAMS`. Each later position with a known future counts.
"""
import numpy as np

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.tracker import Tracker, TrackerParams
from ros_3d_bb.tracking.types import CameraView, Detection
from ros_3d_bb_lab.evaluation.tracking.metrics import WITHIN_95

# Defaults, except that true positions are no depth of the background, and all are those of one person.
PARAMS = TrackerParams(outlier_share=0.0, new_target_density=1e-9)
OBSERVED = 8  # steps
HORIZON_S = 2.0
SIZE_M = np.array([0.5, 0.5, 1.7])
MAX_STEP_ERROR_S = 0.05  # largest deviation of the time of a future position


def predictions(sequences):
    """Errors of predictions 2 s ahead for each `trajectories.Sequence`, as written by --json.

    Returns {name: {cv_fde_2s_m, ours_fde_2s_m, ours_coverage_95_2s}}, and their means as 'mean'; None without data.
    """
    scores = {}
    for sequence in sequences:
        tracker = Tracker(PARAMS)
        people = sorted(sequence.pedestrians, key=lambda person: person.start_s)
        rows = [row for person in people for row in _person_errors(tracker, person)]
        cv_m, ours_m, distances = np.reshape(rows, (-1, 3)).T
        scores[sequence.name] = {'cv_fde_2s_m': _mean(cv_m), 'ours_fde_2s_m': _mean(ours_m),
                                 'ours_coverage_95_2s': _mean(distances < WITHIN_95)}
    known = [values for values in scores.values() if values['cv_fde_2s_m'] is not None]
    if known:
        scores['mean'] = {key: _mean([values[key] for values in known]) for key in known[0]}
    return scores


def _mean(values):
    return float(np.mean(values)) if len(values) else None


def _person_errors(tracker, person):
    """Yield the errors of both predictions, metres, and the squared Mahalanobis distance of that of the tracker."""
    times_s, points_m = person.times_s, person.points_m
    for row, track in enumerate(tracked(tracker, times_s, points_m)):
        later = np.flatnonzero(np.abs(times_s - times_s[row] - HORIZON_S) < MAX_STEP_ERROR_S)
        if row + 1 < OBSERVED or not len(later) or track is None:
            continue
        future_m, velocity_mps = points_m[later[0]], step_velocity_mps(times_s, points_m, row, 1)
        mean_m, covariance_m2 = predicted(track)
        error_m = mean_m - future_m
        distance = error_m.dot(np.linalg.solve(covariance_m2, error_m))
        yield (np.linalg.norm(points_m[row] + HORIZON_S * velocity_mps - future_m), np.linalg.norm(error_m), distance)


def tracked(tracker, times_s, points_m):
    """Yield the latest published track, None without one, of a person at times (n,) and places (n, 2), after each."""
    tracker.reset()
    view = CameraView(np.eye(4))
    for time_s, point_m in zip(times_s, points_m):
        detection = Detection(np.append(point_m, SIZE_M[2] / 2), SIZE_M)
        tracks = tracker.update(int(round((time_s - times_s[0] + 1) * NS)), [detection], view)
        yield max(tracks, key=lambda track: track.last_seen_ns) if tracks else None


def predicted(track):
    """Position (2,) and covariance (2, 2) of a TrackedObject after `HORIZON_S`."""
    step = int(round(HORIZON_S / track.prediction_step_s)) - 1
    return track.prediction_m[step, :2], track.prediction_covariance_m2[step, :2, :2]


def step_velocity_mps(times_s, points_m, row, steps):
    """Velocity (2,) over the `steps` before a row of times (n,) and places (n, 2)."""
    return (points_m[row] - points_m[row - steps]) / (times_s[row] - times_s[row - steps])
