"""Fit of error models to measured positions with ground truth, with cross-validation over positions.

The bias and the law of the standard deviation weight each position equally, independent of the number of its
measurements: repeated measurements share the error of where the person stood. The inflation of the standard deviations
and the scores weight each measurement equally.
"""
from typing import NamedTuple

import numpy as np

from ros_3d_bb.estimation.error_model import ErrorModel, MeasuredRange, Provenance, Scores, Spread, XBias, checked
from ros_3d_bb.sessions.plausibility import likely_errors

DEGREES = (0, 1, 2, 3)  # of the polynomial z_bias
X_TERMS = ((False, True), (True, False), (True, True))  # whether x_bias has the terms slope and per_angle_m
BETTER = 0.95  # maximum cost ratio for accepting a model with more coefficients
LEAST_SIGMA_M = 0.001
Y_SIGMA_M = 0.1  # centre of a box whose top or bottom is off by 0.2 m
LIKELIER = 2.0  # minimum gain in log-likelihood for accepting a term that decreases with range
RATIOS = np.concatenate(([0], 2.0 ** np.arange(-7, 8)))  # of a variance component to the constant component
SHARES = np.array([(far / (1 + far + near), near / (1 + far + near)) for far in RATIOS for near in RATIOS])
GROWTH_OUTSIDE = 0.2  # approximately the steepest bias in the thesis' data
OFF_THE_MIDDLE_M = 0.1
CHI_SQUARE_68_95 = -2 * np.log(1 - np.array([0.68, 0.95]))  # 2 degrees of freedom
UNKNOWN = Provenance('', '', '', '', 0, 0)


class Data(NamedTuple):
    """Measured positions (n, 3), true (x, z) (n, 2), both in metres, and indices of the true positions, or of the
    groups of measurements, (n,)."""

    measured_m: np.ndarray
    truth_m: np.ndarray
    position: np.ndarray

    def weights(self):
        """Weights of the measurements, (n,). The weights of each position sum to 1."""
        return 1.0 / np.bincount(self.position)[self.position]


def fit_error_model(measured_m, truth_m, source='', estimator='', camera='', date='', groups=None):
    """Fit an ErrorModel. More coefficients are selected only if they predict held-out positions clearly better.

    `measured_m` (n, 3) are the estimated x, y, z and `truth_m` (n, 2) the true x, z in metres. Measurements with equal
    truth are repetitions at one position; `groups` (n,) replaces positions, as by the people of a recording, who move.
    Measurements with an implausible truth are left out (`plausibility`). Raises ValueError if there are too few
    positions, if all have the same range or the same x, or if the bias is too steep to be inverted.
    """
    data = _without_outliers(data_of(measured_m, truth_m, groups))
    model = _fit(data)
    corrected_m, covariances = held_out(data)
    provenance = Provenance(source, estimator, camera, date, len(data.truth_m), len(np.unique(data.position)))
    scores = scores_of(corrected_m, covariances, data.truth_m)
    return checked(model._replace(provenance=provenance, cross_validated=scores))


def data_of(measured_m, truth_m, groups=None):
    """Validate measurements and index their positions, or `groups` (n,). Raises ValueError."""
    measured_m, truth_m = np.asarray(measured_m, float), np.asarray(truth_m, float)
    if measured_m.shape != (len(truth_m), 3) or truth_m.shape != (len(truth_m), 2):
        raise ValueError('measured %s and truth %s; (n, 3) and (n, 2) expected' % (measured_m.shape, truth_m.shape))
    if not np.isfinite(measured_m).all() or not np.isfinite(truth_m).all():
        raise ValueError('a measurement is not finite')
    if not (truth_m[:, 1] > 0).all():
        raise ValueError('true z is %g m; more than 0 expected' % truth_m[:, 1].min())
    for axis, name in enumerate('xz'):
        if len(np.unique(truth_m[:, axis])) < 3:
            raise ValueError('measurements at %d different %s; at least 3 expected'
                             % (len(np.unique(truth_m[:, axis])), name))
    _positions, position = np.unique(truth_m, axis=0, return_inverse=True)
    if groups is not None:
        _groups, position = np.unique(groups, return_inverse=True)
    return Data(measured_m, truth_m, position.reshape(-1))


def _without_outliers(data):
    measured_m = data.measured_m[:, [0, 2]]
    plausible = likely_errors(measured_m, data.truth_m).are_plausible(measured_m, data.truth_m)
    return data_of(data.measured_m[plausible], data.truth_m[plausible], data.position[plausible])


def held_out(data):
    """Correct the measurements of each position by a model fitted to all other positions.

    Returns corrected positions (n, 3) and their covariances (n, 3, 3).
    """
    count = len(data.truth_m)
    corrected_m, covariances = np.empty((count, 3)), np.empty((count, 3, 3))
    for held, others in _folds(data):
        model = _fit(others)
        corrected_m[held] = model.corrected(data.measured_m[held])
        covariances[held] = model.covariance(corrected_m[held])
    return corrected_m, covariances


def scores_of(corrected_m, covariances, truth_m):
    """Scores of corrected positions (n, 3) with covariances (n, 3, 3) against the truth (n, 2)."""
    error_m = corrected_m[:, [0, 2]] - truth_m
    shares = coverage(error_m, covariances)
    rmse_m = np.sqrt((error_m ** 2).mean(axis=0))
    return Scores(*(float(value) for value in (rmse_m[0], rmse_m[1], np.hypot(*rmse_m), shares[0], shares[1])))


def coverage(error_m, covariances):
    """Shares (2,) of the errors (n, 2) in x and z within the 68 % and 95 % ellipses of covariances (n, 3, 3)."""
    in_plane = covariances[:, [0, 2]][:, :, [0, 2]]
    distances = np.einsum('ni,nij,nj->n', error_m, np.linalg.inv(in_plane), error_m)
    return (distances[:, np.newaxis] <= CHI_SQUARE_68_95).mean(axis=0)


def _folds(data):
    """Yield the mask (n,) of the measurements of each position, and the data of all other positions."""
    for position in np.unique(data.position):
        held = data.position == position
        yield held, Data(*(values[~held] for values in data))


def _fit(data):
    degrees = [degree for degree in DEGREES if degree + 2 <= len(np.unique(data.truth_m[:, 1]))]
    degree = _simplest([(degree, _residuals(data, degree, X_TERMS[0])[:, 1]) for degree in degrees], data)
    terms = _simplest([(terms, _residuals(data, degree, terms)[:, 0]) for terms in X_TERMS], data)
    residuals_m = _residuals(data, degree, terms)
    x_sigma, z_sigma = (_fit_spread(residuals_m[:, axis], data) for axis in (0, 1))
    sigmas_m = np.stack([spread.at(data.truth_m[:, 1]) for spread in (x_sigma, z_sigma)], axis=1)
    widening = _widening(sigmas_m, residuals_m, len(np.unique(data.position)))
    x_sigma, z_sigma = (Spread(*(widening * part for part in spread)) for spread in (x_sigma, z_sigma))
    return _fit_bias(data, degree, terms)._replace(x_sigma=x_sigma, z_sigma=z_sigma)


def _simplest(candidates, data):
    """Select the simplest of the candidates (value, residuals), ordered by complexity, with nearly the best cost."""
    costs = [np.sqrt(np.average(residuals_m ** 2, weights=data.weights())) for _what, residuals_m in candidates]
    best = 0
    for number, cost in enumerate(costs):
        if cost < BETTER * costs[best]:
            best = number
    return candidates[best][0]


def _residuals(data, degree, terms):
    """Residuals (n, 2) in x and z at each position after correction by the bias fitted to all other positions."""
    residuals_m = np.empty_like(data.truth_m)
    for held, others in _folds(data):
        corrected_m = _fit_bias(others, degree, terms).corrected(data.measured_m[held])
        residuals_m[held] = corrected_m[:, [0, 2]] - data.truth_m[held]
    return residuals_m


def _fit_bias(data, degree, terms):
    x_m, z_m = data.truth_m.T
    roots = np.sqrt(data.weights())
    z_bias = np.polyfit(z_m, data.measured_m[:, 2] - z_m, degree, w=roots)
    columns = np.stack((x_m * terms[0], x_m / z_m * terms[1], np.ones_like(x_m)), axis=1)
    x_bias = np.linalg.lstsq(columns * roots[:, np.newaxis], (data.measured_m[:, 0] - x_m) * roots, rcond=1e-9)[0]
    aside = np.abs(x_m) > OFF_THE_MIDDLE_M
    limits = MeasuredRange(*(float(value) for value in (
        z_m.min(), z_m.max(), np.abs(x_m).max(), z_m[aside].min() if aside.any() else z_m.min())))
    spread = Spread(LEAST_SIGMA_M, 0.0, 0.0)
    return ErrorModel(tuple(z_bias.tolist()), XBias(*x_bias.tolist()), spread, spread, Y_SIGMA_M, limits,
                      GROWTH_OUTSIDE, UNKNOWN, None)


def _widening(sigmas_m, residuals_m, positions):
    """Inflation factor, at least 1, with which the 95 % ellipses contain 95 % of the residuals (n, 2).

    The errors have longer tails than a Gaussian, and planners rely on the 95 % ellipse. The quantile is slightly above
    95 %, as in conformal prediction, to account for the finite number of positions.
    """
    distances = ((residuals_m / sigmas_m) ** 2).sum(axis=1)
    quantile = np.percentile(distances, min(100, 95.0 * (positions + 1) / positions))
    return max(1.0, float(np.sqrt(quantile / CHI_SQUARE_68_95[1])))


def _fit_spread(residuals_m, data):
    """Fit the Spread of residuals (n,) of one axis, selecting its terms by the log-likelihood of held-out positions."""
    z_m, weights = data.truth_m[:, 1], data.weights()
    likelihoods = [0.0, 0.0]
    for with_near in (False, True):
        for held, _others in _folds(data):
            sigma_m = _spread_of(residuals_m[~held], z_m[~held], weights[~held], with_near).at(z_m[held])
            likelihoods[with_near] -= np.mean(np.log(sigma_m) + (residuals_m[held] / sigma_m) ** 2 / 2)
    return _spread_of(residuals_m, z_m, weights, likelihoods[True] > likelihoods[False] + LIKELIER)


def _spread_of(residuals_m, z_m, weights, with_near):
    """Maximum-likelihood Spread of weighted Gaussian residuals, by grid search over the shares of its components."""
    shares = SHARES if with_near else SHARES[SHARES[:, 1] == 0]
    far, near = shares.T[..., np.newaxis]
    nearest_m, farthest_m = z_m.min(), z_m.max()
    shapes = 1 - far - near + far * (z_m / farthest_m) ** 4 + near * (nearest_m / z_m) ** 2
    variances_m2 = np.maximum(LEAST_SIGMA_M ** 2, np.average(residuals_m ** 2 / shapes, axis=1, weights=weights))
    costs = np.log(variances_m2) + np.average(np.log(shapes), axis=1, weights=weights)
    best = int(np.argmin(costs))
    constant_m, far_m, near_m = np.sqrt(variances_m2[best] * np.array([1 - shares[best].sum(), *shares[best]]))
    return Spread(float(max(constant_m, LEAST_SIGMA_M)), float(far_m / farthest_m ** 2), float(near_m * nearest_m))
