"""Tracking metrics on a run: HOTA, CLEAR and identity scores by TrackEval, errors, and coverage of the covariances.

Scored are the people that are VISIBLE in an image, and all tracks published for it, independent of their status. Tracks
and people within `PAIRED_M` are matched one to one: as many as possible, with the least sum of distances. A track
farther than `MATCHED_M` from every person is a false positive, except outside of the scored area of the run, where this
cannot be decided. TrackEval's similarity falls from 1 at distance 0 to 0 at `PAIRED_M`; a match requires 0.5, which
corresponds to `MATCHED_M`. Errors of velocities, predictions and covariances are computed from the matched pairs.
"""
import contextlib
import io

import numpy as np

from ros_3d_bb.tracking.types import VISIBLE
from ros_3d_bb_lab.evaluation.matching import assign, plane_distances
from ros_3d_bb_lab.evaluation.tracking.run_generator import HORIZONS_S

PAIRED_M, MATCHED_M = 1.0, 0.5
WITHIN_95 = 5.991  # 95 % quantile of chi squared with 2 degrees of freedom


def score_run(run, outputs):
    """Score a tracker on a run_generator.Run, with a list of TrackedObject after each image.

    Returns the results of TrackEval's HOTA, CLEAR and Identity metrics, and the errors (n, 2 + horizons, 3) of the n
    matched tracks in position, velocity and the predictions for `HORIZONS_S`. An error is x and y, NaN if the truth is
    unknown, and the squared Mahalanobis distance, NaN for tracks without covariance.
    """
    people, tracks, similarities, errors = [], [], [], []
    for image, objects in zip(run.images, outputs):
        person_ids, track_ids, similarity, image_errors = _score_image(
            image.truth, objects, run.in_scored_area(image, objects))
        people.append(person_ids)
        tracks.append(track_ids)
        similarities.append(similarity)
        errors += image_errors
    return trackeval_results(people, tracks, similarities), np.reshape(errors, (-1, 2 + len(HORIZONS_S), 3))


def scores_of(run_scores):
    """Combine the scores of all runs, from `score_run`, to a dictionary.

    Scores are in percent, lengths in metres, and coverage is a share 0..1. Values without data are None.
    """
    results_of_runs, errors_of_runs = zip(*run_scores)
    combined = []
    for metric, results in zip(trackeval_metrics(), zip(*results_of_runs)):
        combined.append(metric.combine_sequences({str(number): result for number, result in enumerate(results)}))
    hota, clear, identity = combined
    scores = {'hota': 100 * float(np.mean(hota['HOTA'])), 'assa': 100 * float(np.mean(hota['AssA'])),
              'deta': 100 * float(np.mean(hota['DetA'])), 'mota': 100 * float(clear['MOTA']),
              'idf1': 100 * float(identity['IDF1']), 'id_switches': int(clear['IDSW']),
              'fragmentations': int(clear['Frag']), 'recall': 100 * float(clear['CLR_Re']),
              'precision': 100 * float(clear['CLR_Pr'])}
    errors = np.concatenate(errors_of_runs)
    lengths, distances = np.linalg.norm(errors[..., :2], axis=2), errors[..., 2]
    scores.update(position_rmse_m=_rms(errors[:, 0, :2]), velocity_rmse_mps=_rms(errors[:, 1, :2]),
                  coverage_95_position=_coverage(distances[:, 0]), coverage_95_velocity=_coverage(distances[:, 1]))
    for horizon_s in (1, 2):
        last = 2 + int(np.flatnonzero(HORIZONS_S == horizon_s)[0])
        scores.update({'ade_%ds_m' % horizon_s: _mean(lengths[:, 2:last + 1]),
                       'fde_%ds_m' % horizon_s: _mean(lengths[:, last]),
                       'coverage_95_%ds' % horizon_s: _coverage(distances[:, last])})
    return scores


def _score_image(truth, objects, counted):
    """IDs of the scored people and tracks, their similarity (people, tracks), and the errors of each pair.

    `counted` (n,) masks the tracks that are false positives without a person.
    """
    counts = truth.status == VISIBLE
    places_m = np.array([thing.position_m[:2] for thing in objects]).reshape(-1, 2)
    distances_m = plane_distances(truth.position_m[counts].reshape(-1, 2), places_m)
    near = distances_m <= PAIRED_M
    pairs = list(zip(*assign(np.where(near, distances_m, np.inf))))
    for row, column in pairs:
        counted[column] |= distances_m[row, column] <= MATCHED_M
    similarity = np.maximum(0, 1 - distances_m[:, counted] / PAIRED_M)
    rows = np.flatnonzero(counts)
    return (truth.ids[counts], np.array([thing.id for thing in objects], int)[counted], similarity,
            [_errors(truth, rows[row], objects[column]) for row, column in pairs])


def _errors(truth, row, thing):
    steps = np.rint(HORIZONS_S / thing.prediction_step_s).astype(int)
    if np.any(np.abs(steps * thing.prediction_step_s - HORIZONS_S) > 1e-6) or steps[-1] > len(thing.prediction_m):
        raise ValueError('%d predictions at intervals of %g s; predictions for %s s expected'
                         % (len(thing.prediction_m), thing.prediction_step_s, HORIZONS_S.tolist()))
    vectors = np.vstack((thing.position_m[:2] - truth.position_m[row], thing.velocity_mps[:2] - truth.velocity_mps[row],
                         thing.prediction_m[steps - 1, :2] - truth.future_m[row]))
    if thing.covariance is None:
        return np.column_stack((vectors, np.full(len(vectors), np.nan)))
    covariances = np.concatenate(([thing.covariance[:2, :2], thing.covariance[3:5, 3:5]],
                                  thing.prediction_covariance_m2[steps - 1, :2, :2]))
    distances = np.sum(vectors * np.linalg.solve(covariances, vectors[..., np.newaxis])[..., 0], axis=1)
    return np.column_stack((vectors, distances))


def _rms(errors):
    known = errors[np.isfinite(errors).all(axis=1)]
    return float(np.sqrt(np.mean(np.sum(known ** 2, axis=1)))) if len(known) else None


def _mean(values):
    known = values[np.isfinite(values)]
    return float(known.mean()) if known.size else None


def _coverage(distances):
    return _mean(np.where(np.isfinite(distances), distances < WITHIN_95, np.nan))


def trackeval_metrics():
    """TrackEval's HOTA, CLEAR and Identity metrics. Raises ValueError if TrackEval is not installed."""
    try:
        with contextlib.redirect_stdout(io.StringIO()):  # it prints the data sets that it cannot import
            from trackeval.metrics import CLEAR, HOTA, Identity
    except ImportError as error:
        raise ValueError('TrackEval cannot be imported (%s); install it: pip install --no-deps trackeval' % error)
    threshold = {'THRESHOLD': 1 - MATCHED_M / PAIRED_M, 'PRINT_CONFIG': False}
    return HOTA(), CLEAR(threshold), Identity(threshold)


def trackeval_results(people, tracks, similarities):
    """Results of `trackeval_metrics`, given person and track IDs, and similarities of each image.

    Raises ValueError if there are no images.
    """
    if not people:
        raise ValueError('a run has no images; a longer run is required')
    data = {'similarity_scores': similarities, 'num_timesteps': len(similarities)}
    for name, ids in (('gt', people), ('tracker', tracks)):
        known = np.unique(np.concatenate(ids))  # consecutive IDs from 0 are required
        data['%s_ids' % name] = [np.searchsorted(known, image_ids) for image_ids in ids]
        data['num_%s_ids' % name] = len(known)
        data['num_%s_dets' % name] = sum(len(image_ids) for image_ids in ids)
    with contextlib.redirect_stdout(io.StringIO()):
        return [metric.eval_sequence(data) for metric in trackeval_metrics()]
