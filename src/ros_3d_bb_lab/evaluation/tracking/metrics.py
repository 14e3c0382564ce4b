"""Tracking metrics on a run: HOTA, CLEAR and identity scores by TrackEval, errors, and coverage of the covariances.

Scored are the people that are VISIBLE in an image, and all tracks published for it, independent of their status. Tracks
and people within `PAIRED_M` are matched one to one: as many as possible, with the least sum of distances. A track
farther than `MATCHED_M` from every person is a false positive. It is ignored if the camera cannot decide this: at the
borders of the field of view, and near people that are not scored. TrackEval's similarity falls from 1 at distance 0 to
0 at `PAIRED_M`; a match requires 0.5, which corresponds to `MATCHED_M`. Errors of velocities, predictions and
covariances are computed from the matched pairs.
"""
import contextlib
import io
from typing import List, NamedTuple, Optional

import numpy as np
from scipy.optimize import linear_sum_assignment

from ros_3d_bb.tracking.association import plane_distances
from ros_3d_bb.tracking.types import VISIBLE
from ros_3d_bb_lab.evaluation.tracking.robot_motion import bearing_of, to_frame
from ros_3d_bb_lab.evaluation.tracking.run_generator import HORIZONS_S

PAIRED_M, MATCHED_M = 1.0, 0.5
FAR_M = 1e3  # cost of an impossible pair
NOT_ASKED_M = 0.75  # a track within this distance of a person that is not scored most likely belongs to that person
BORDER, BORDER_M, NEAREST_M = 0.04, 0.15, 0.5  # margins of the field of view: radians, far end, near end
WITHIN_95 = 5.991  # 95 % quantile of chi squared with 2 degrees of freedom


class Errors(NamedTuple):
    """Errors of the n matched tracks of a run, with squared Mahalanobis distances.

    Position (n, 2), velocity (n, 2) and prediction (n, horizons, 2); their distances are (n,), (n,) and (n, horizons).
    Predictions are NaN if the truth is unknown. All distances are NaN for tracks without covariance.
    """

    position_m: np.ndarray
    velocity_mps: np.ndarray
    prediction_m: np.ndarray
    position_distance: np.ndarray
    velocity_distance: np.ndarray
    prediction_distance: np.ndarray


class Scored(NamedTuple):
    """One image: IDs of the scored people and tracks, and their similarity (people, tracks)."""

    people: np.ndarray
    tracks: np.ndarray
    similarity: np.ndarray


class RunScore(NamedTuple):
    """TrackEval's results of a run, and the errors."""

    name: str
    hota: dict
    clear: dict
    identity: dict
    errors: Errors


def score_run(run, outputs):
    """Score a tracker on a run.

    Parameters
    ----------
    run : run_generator.Run
    outputs : list of list of TrackedObject
        Tracks published after each image.

    Returns
    -------
    RunScore
    """
    images, errors = [], []
    for image, objects in zip(run.images, outputs):
        scored, image_errors = _score_image(image.truth, objects, run.camera)
        images.append(scored)
        errors += image_errors
    hota, clear, identity = _metrics()
    data = _data_of(images)
    with contextlib.redirect_stdout(io.StringIO()):
        results = [metric.eval_sequence(data) for metric in (hota, clear, identity)]
    return RunScore(run.name, *results, errors=_stacked(errors))


def scores_of(run_scores):
    """Combine the scores of all runs to a dictionary, without `cpu_ms`.

    Scores are in percent, lengths in metres, and coverage is a share 0..1. Values without data are None.
    """
    combined = [metric.combine_sequences({'%d' % number: results[number] for number in range(len(results))})
                for metric, results in zip(_metrics(), zip(*(score[1:4] for score in run_scores)))]
    hota, clear, identity = combined
    scores = {'hota': 100 * float(np.mean(hota['HOTA'])), 'assa': 100 * float(np.mean(hota['AssA'])),
              'deta': 100 * float(np.mean(hota['DetA'])), 'mota': 100 * float(clear['MOTA']),
              'idf1': 100 * float(identity['IDF1']), 'id_switches': int(clear['IDSW']),
              'fragmentations': int(clear['Frag']), 'recall': 100 * float(clear['CLR_Re']),
              'precision': 100 * float(clear['CLR_Pr'])}
    errors = Errors(*(np.concatenate(parts) for parts in zip(*(score.errors for score in run_scores))))
    scores.update(error_scores(errors))
    return scores


def error_scores(errors):
    """Scores of errors, in the format of `scores_of`."""
    off_m = np.linalg.norm(errors.prediction_m, axis=2)
    one, two = (int(np.flatnonzero(HORIZONS_S == seconds)[0]) for seconds in (1, 2))
    return {'position_rmse_m': _rms(errors.position_m), 'velocity_rmse_mps': _rms(errors.velocity_mps),
            'ade_1s_m': _mean(off_m[:, :one + 1]), 'fde_1s_m': _mean(off_m[:, one]),
            'ade_2s_m': _mean(off_m[:, :two + 1]), 'fde_2s_m': _mean(off_m[:, two]),
            'coverage_95_position': _coverage(errors.position_distance),
            'coverage_95_velocity': _coverage(errors.velocity_distance),
            'coverage_95_1s': _coverage(errors.prediction_distance[:, one]),
            'coverage_95_2s': _coverage(errors.prediction_distance[:, two])}


def _score_image(truth, objects, camera):
    """Scores of one image, as Scored, and the errors of each matched pair, as Errors without the first axis."""
    counts = truth.status == VISIBLE
    people, rows = truth.ids[counts], np.flatnonzero(counts)
    places_m = np.array([thing.position_m[:2] for thing in objects]).reshape(-1, 2)
    distances_m = plane_distances(truth.position_m[counts].reshape(-1, 2), places_m)
    near = distances_m <= PAIRED_M
    pairs = [pair for pair in zip(*linear_sum_assignment(np.where(near, distances_m, FAR_M))) if near[pair]]
    asked = _asked_for(places_m, truth, camera)
    for row, column in pairs:
        asked[column] |= distances_m[row, column] <= MATCHED_M
    similarity = np.maximum(0, 1 - distances_m[:, asked] / PAIRED_M)
    scored = Scored(people, np.array([thing.id for thing in objects], int)[asked], similarity)
    return scored, [_errors(truth, rows[row], objects[column]) for row, column in pairs]


def _asked_for(places_m, truth, camera):
    """Mask (n,) of the positions (n, 2) at which a track would be a false positive if no person is there."""
    local_m = to_frame(truth.pose, places_m)
    range_m = np.linalg.norm(local_m, axis=1)
    asked = ((np.abs(bearing_of(local_m)) <= camera.field_of_view / 2 - BORDER) & (range_m >= NEAREST_M)
             & (range_m <= camera.farthest_m - BORDER_M))
    others_m = truth.position_m[truth.status != VISIBLE]
    if len(others_m) and len(places_m):
        asked &= plane_distances(places_m, others_m).min(axis=1) >= NOT_ASKED_M
    return asked


def _errors(truth, row, thing):
    steps = np.rint(HORIZONS_S / thing.prediction_step_s).astype(int)
    if np.any(np.abs(steps * thing.prediction_step_s - HORIZONS_S) > 1e-6) or steps[-1] > len(thing.prediction_m):
        raise ValueError('%d predictions %g s apart do not hold those for %s s'
                         % (len(thing.prediction_m), thing.prediction_step_s, HORIZONS_S.tolist()))
    position_m = thing.position_m[:2] - truth.position_m[row]
    velocity_mps = thing.velocity_mps[:2] - truth.velocity_mps[row]
    prediction_m = thing.prediction_m[steps - 1, :2] - truth.future_m[row]
    if thing.covariance is None:
        return Errors(position_m, velocity_mps, prediction_m, np.nan, np.nan, np.full(len(steps), np.nan))
    return Errors(position_m, velocity_mps, prediction_m, _distance(position_m, thing.covariance[:2, :2]),
                  _distance(velocity_mps, thing.covariance[3:5, 3:5]),
                  _distance(prediction_m, thing.prediction_covariance_m2[steps - 1, :2, :2]))


def _distance(errors, covariances):
    """Squared Mahalanobis distances of errors (..., 2) with covariances (..., 2, 2)."""
    return np.sum(errors * np.linalg.solve(covariances, errors[..., np.newaxis])[..., 0], axis=-1)


def _stacked(errors):
    if errors:
        return Errors(*(np.array(part) for part in zip(*errors)))
    steps = len(HORIZONS_S)
    return Errors(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, steps, 2)), np.zeros(0), np.zeros(0),
                  np.zeros((0, steps)))


def _rms(errors):
    return float(np.sqrt(np.mean(np.sum(errors ** 2, axis=1)))) if len(errors) else None


def _mean(values):
    known = values[np.isfinite(values)]
    return float(known.mean()) if known.size else None


def _coverage(distances) -> Optional[float]:
    return _mean(np.where(np.isfinite(distances), distances < WITHIN_95, np.nan))


def _metrics():
    """TrackEval's HOTA, CLEAR and Identity metrics. Raises ValueError if TrackEval is not installed."""
    try:
        with contextlib.redirect_stdout(io.StringIO()):  # it prints the data sets that it cannot import
            from trackeval.metrics import CLEAR, HOTA, Identity
    except ImportError as error:
        raise ValueError('TrackEval cannot be imported (%s); install it: pip install --no-deps trackeval' % error)
    threshold = {'THRESHOLD': 1 - MATCHED_M / PAIRED_M, 'PRINT_CONFIG': False}
    return HOTA(), CLEAR(threshold), Identity(threshold)


def _data_of(images: List[Scored]):
    """Input of TrackEval's metrics, with consecutive IDs from 0. Raises ValueError if there are no images."""
    if not images:
        raise ValueError('a run without images; it is too short')
    people, tracks = (np.unique(np.concatenate([image[part] for image in images])) for part in (0, 1))
    return {'gt_ids': [np.searchsorted(people, image.people) for image in images],
            'tracker_ids': [np.searchsorted(tracks, image.tracks) for image in images],
            'similarity_scores': [image.similarity for image in images],
            'num_gt_dets': sum(len(image.people) for image in images),
            'num_tracker_dets': sum(len(image.tracks) for image in images),
            'num_gt_ids': len(people), 'num_tracker_ids': len(tracks), 'num_timesteps': len(images)}
