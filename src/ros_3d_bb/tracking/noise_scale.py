"""Scale of the noise of boxes without a covariance, learned from innovations.

The innovations of a filter with the right noise are white (Kailath 1968), and their autocorrelation shows what is wrong
(Mehra 1970). With too much noise, the filter lags behind a person who turns, and successive innovations have the same
direction. With too little, it follows the errors of the boxes, and they have opposite directions. The variance is
lowered or raised accordingly. Unlike the size of innovations, their correlation hardly depends on how much people turn.

Errors that last are not in the innovations. The learned noise is that part of `noise_unknown` which changes from image
to image; the rest is added to the published covariances.
"""
import math

import numpy as np

GAIN = 0.2  # change of the logarithm of the variance by a pair of innovations, relative to their correlation
LARGEST = 3.0  # correlations are limited to this multiple of the expected squared innovation
SETTLED_HITS = 3  # innovations of newer tracks show their unknown velocity
MIN_LOG_SCALE, MAX_LOG_SCALE = 2 * math.log(0.05), 2 * math.log(2)  # a twentieth to twice the standard deviation


def widen(log_scale, measurements):
    """Raise the assumed noise of measurements (in place) for the association, to a scale above 1. It is not lowered:
    a scale that is too small must not separate people from their tracks."""
    _scale(max(log_scale, 0), measurements)


def learn(log_scale, tracks, rows, measurements):
    """Learn the scale of the variance from one image, in which `rows` of the tracks match the measurements.

    `tracks` are predicted to the image; their `innovation_m` is replaced by that of this image, or 0 without one. The
    assumed noise of the measurements, which is that for the association, is scaled in place for the update.

    Returns the new logarithm of the scale.
    """
    assumed = measurements['noise_assumed']
    previous_m = tracks['innovation_m'][rows] if assumed.any() else None
    tracks['innovation_m'] = 0
    if previous_m is None:
        return log_scale
    _scale(min(log_scale, 0), measurements)
    innovations_m = (measurements['position_m'] - tracks['mean'][rows, :2]) * assumed[:, None]
    tracks['innovation_m'][rows] = innovations_m
    covariances = tracks['covariance'][rows, :2, :2] + measurements['noise_m2']
    correlations = (previous_m * innovations_m).sum(axis=1) / (covariances[:, 0, 0] + covariances[:, 1, 1])
    correlations = np.minimum(np.maximum(correlations, -LARGEST), LARGEST)[tracks['hits'][rows] >= SETTLED_HITS]
    new = min(max(log_scale - GAIN * float(correlations.sum()), MIN_LOG_SCALE), MAX_LOG_SCALE)
    _scale(new - log_scale, measurements)
    return new


def _scale(log_factor, measurements):
    if log_factor:
        measurements['noise_m2'] *= np.where(measurements['noise_assumed'], math.exp(log_factor), 1)[:, None, None]


def learned_prediction(log_scale, assumed_m, params):
    """Adapt PredictionParams to a learned scale of the variance `assumed_m`².

    If the scale is below 1, the rest of the variance is that of lasting errors, and slow velocities are less noisy.
    """
    if log_scale >= 0:
        return params
    scale = math.exp(log_scale)
    lasting_m = math.sqrt(max(params.position_bias ** 2, assumed_m ** 2 * (1 - scale)))
    return params._replace(position_bias=lasting_m, standing_speed=params.standing_speed * math.sqrt(scale))
