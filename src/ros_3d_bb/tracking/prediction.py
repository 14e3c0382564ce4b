"""Current and predicted positions of tracks with their covariances, as they are published."""
from typing import NamedTuple

import numpy as np

from ros_3d_bb.core.params import Param, parameters
from ros_3d_bb.tracking.types import PREDICTION_STEP, PREDICTION_TIME, TrackedObject, prediction_times_s


@parameters('kalman: how certain predictions are')
class PredictionParams(NamedTuple):
    """Parameters of the prediction of tracks."""

    prediction_time: float = PREDICTION_TIME
    prediction_step: float = PREDICTION_STEP
    prediction_acceleration: float = Param(
        0.03, 'How much more people turn than the filter models: density of a white acceleration.', 'm²/s³',
        live=(0, 1))
    standing_speed: float = Param(
        0.15, 'A velocity much lower than this is not extrapolated: it is mostly noise.', 'm/s', live=(0, 1))
    position_bias: float = Param(
        0.05, 'Standard deviation added for errors that stay the same for seconds.', 'm', live=(0, 0.5))


def objects_of(tracks, params):
    """Convert tracks to the published objects, with predictions at constant velocity.

    A low velocity is mostly noise of a standing person. The predicted velocity v is therefore scaled by
    v² / (v² + standing_speed²). The covariance of the filter does not include errors that stay constant for seconds,
    such as those of a wrong calibration; `position_bias` is added for them. `prediction_acceleration` accounts for
    turns.

    Parameters
    ----------
    tracks : numpy.ndarray of track.TRACK, (n,)
    params : PredictionParams

    Returns
    -------
    list of TrackedObject, n
    """
    times_s = prediction_times_s(params.prediction_time, params.prediction_step)
    velocity_mps, level = tracks['mean'][:, 2:], np.eye(3)[:, :2]
    speed2 = (velocity_mps ** 2).sum(axis=1, keepdims=True)
    carried_mps = velocity_mps * speed2 / (speed2 + params.standing_speed ** 2 + 1e-12)
    positions_m = np.column_stack((tracks['mean'][:, :2], tracks['z_m']))
    predictions_m = positions_m[:, None] + times_s[:, None] * carried_mps.dot(level.T)[:, None]
    predictions_m2 = level @ _ahead(tracks['covariance'], times_s, params) @ level.T
    predictions_m2[..., 2, 2] = tracks['z_m2'][:, None]
    covariances = np.zeros((len(tracks), 6, 6))
    for rows, kept in ((0, np.s_[:2]), (3, np.s_[2:])):
        for columns, others in ((0, np.s_[:2]), (3, np.s_[2:])):
            covariances[:, rows:rows + 2, columns:columns + 2] = tracks['covariance'][:, kept, others]
    covariances[:, [0, 1], [0, 1]] += params.position_bias ** 2
    covariances[:, 2, 2] = tracks['z_m2']
    velocities_mps = velocity_mps.dot(level.T)
    known = (tracks[name].tolist() for name in ('id', 'status', 'moving', 'first_ns', 'last_ns'))
    return [TrackedObject(number, position_m, size_m, velocity_mps, velocity_mps, status, moving, first_ns, last_ns,
                          prediction_m, params.prediction_step, covariance, predicted_m2)
            for number, status, moving, first_ns, last_ns, position_m, size_m, velocity_mps, prediction_m, covariance,
            predicted_m2 in zip(*known, positions_m, tracks['size_m'].copy(), velocities_mps, predictions_m,
                                covariances, predictions_m2)]


def _ahead(covariance, times_s, params):
    """Covariances (n, steps, 2, 2) of the predicted positions."""
    position, velocity, both = covariance[:, None, :2, :2], covariance[:, None, 2:, 2:], covariance[:, None, :2, 2:]
    times = times_s[:, None, None]
    wandered = params.prediction_acceleration * times ** 3 / 3 + params.position_bias ** 2
    return (position + times * (both + both.transpose(0, 1, 3, 2)) + times ** 2 * velocity + wandered * np.eye(2))
