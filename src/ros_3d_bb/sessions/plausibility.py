"""Plausibility of true positions: whether the error of a measurement is one that the other measurements make likely.

Positions are (x, z) in the camera optical frame, metres; error = measured - true. The likely error of an axis is a line
over the MEASURED position, which a slip in the truth does not move. The line is fitted with Tukey's biweight, so that
slips among the measurements have no influence on it.
"""
from typing import NamedTuple

import numpy as np

LEAST_MEASUREMENTS = 8  # fewer do not show which errors are likely
UNKNOWN_LIMIT_M, UNKNOWN_SHARE = 0.3, 0.15  # of the error without them: the larger of a distance and a share of z
LIMIT_M, LIMIT_SIGMAS = 0.2, 6.0  # of the deviation with them: the larger of a distance and standard deviations
GROWTH_OUTSIDE = 0.2  # of the limit, per metre outside the other measurements
TWICE_THE_VARIANCE_M = 3.0  # range at which stereo noise has doubled the variance of near people
TUKEY, MAD_TO_SIGMA, LEAST_SIGMA_M, STEPS = 4.685, 1.4826, 0.02, 30
CONVERGED = 1e-4  # metres, and metres per metre


class LikelyErrors(NamedTuple):
    """Errors that a set of measurements makes likely.

    `line` (2, 2) contains offset and slope of the errors in x and z, `sigma_m` (2,) the standard deviation of the
    errors of near people, `low_m` and `high_m` (2,) the limits of the measured positions. `is_known` is whether there
    are enough measurements; otherwise the likely error is 0.
    """

    line: np.ndarray
    sigma_m: np.ndarray
    low_m: np.ndarray
    high_m: np.ndarray
    is_known: bool

    def at(self, measured_m):
        """Likely error (..., 2) at measured positions (..., 2). It is constant outside the measurements."""
        return self.line[0] + self.line[1] * np.clip(measured_m, self.low_m, self.high_m)

    def limit_m(self, measured_m):
        """Largest plausible deviation from the likely error (..., 2) at measured positions (..., 2)."""
        measured_m = np.asarray(measured_m, float)
        if not self.is_known:
            return np.maximum(UNKNOWN_LIMIT_M, UNKNOWN_SHARE * measured_m[..., 1:]) * np.ones(2)
        outside_m = np.abs(measured_m - np.clip(measured_m, self.low_m, self.high_m)).sum(axis=-1, keepdims=True)
        sigma_m = self.sigma_m * _noise_at(measured_m[..., 1:])
        return np.maximum(LIMIT_M, LIMIT_SIGMAS * sigma_m) + GROWTH_OUTSIDE * outside_m

    def are_plausible(self, measured_m, truth_m):
        """Whether true positions (..., 2) are plausible for measured positions (..., 2)."""
        deviation_m = np.asarray(measured_m, float) - truth_m - self.at(measured_m)
        return (np.abs(deviation_m) <= self.limit_m(measured_m)).all(axis=-1)


def likely_errors(measured_m, truth_m):
    """Errors that measured positions (n, 2) with their true positions (n, 2) make likely, as LikelyErrors."""
    measured_m, truth_m = (np.reshape(positions_m, (-1, 2)).astype(float) for positions_m in (measured_m, truth_m))
    if len(measured_m) < LEAST_MEASUREMENTS:
        return LikelyErrors(np.zeros((2, 2)), np.zeros(2), np.zeros(2), np.zeros(2), False)
    noise, weights = _noise_at(measured_m[:, 1]), _weights_of(truth_m)
    lines, sigmas_m = zip(*(_robust_line(values_m, error_m, noise, weights)
                            for values_m, error_m in zip(measured_m.T, (measured_m - truth_m).T)))
    return LikelyErrors(np.stack(lines, axis=1), np.array(sigmas_m), measured_m.min(axis=0), measured_m.max(axis=0),
                        True)


def _noise_at(range_m):
    """Standard deviation relative to that of near people."""
    return np.sqrt(1 + (range_m / TWICE_THE_VARIANCE_M) ** 4)


def _weights_of(truth_m):
    """Weights (n,) of measurements: less for repetitions at a position, but more for a position than for a slip."""
    _positions, position = np.unique(truth_m, axis=0, return_inverse=True)
    position = position.reshape(-1)
    return 1 / np.sqrt(np.bincount(position)[position])


def _robust_line(values_m, error_m, noise, weights):
    """Offset and slope (2,) of errors (n,) over values (n,), and the standard deviation, by reweighted least squares.

    `noise` (n,) are the relative standard deviations of the errors.
    """
    columns, scaled_m = np.stack((np.ones_like(values_m), values_m), axis=1) / noise[:, np.newaxis], error_m / noise
    line = np.array([_weighted_median(error_m, weights), 0.0])
    for _ in range(STEPS):
        residuals_m = scaled_m - columns.dot(line)
        sigma_m = max(MAD_TO_SIGMA * _weighted_median(np.abs(residuals_m), weights), LEAST_SIGMA_M)
        roots = np.sqrt(weights) * np.maximum(0, 1 - (residuals_m / (TUKEY * sigma_m)) ** 2)
        previous, line = line, np.linalg.lstsq(columns * roots[:, np.newaxis], scaled_m * roots, rcond=1e-9)[0]
        if np.abs(line - previous).max() < CONVERGED:
            break
    return line, sigma_m


def _weighted_median(values, weights):
    order = np.argsort(values)
    totals = np.cumsum(weights[order])
    return values[order][np.searchsorted(totals, totals[-1] / 2)]


class Outlier(NamedTuple):
    """Measurement with an implausible truth: its name, measured and true (x, z) in metres."""

    name: str
    measured_m: np.ndarray
    truth_m: np.ndarray

    def __str__(self):
        return '%s: %s' % (self.name, self.description)

    @property
    def description(self):
        return 'the true position %s is implausible, the estimate is %s (wrong unit, lost digit or sign?)' % (
            position_text(self.truth_m), position_text(self.measured_m))


def outlier_of(name, likely, measured_m, truth_m):
    """Outlier of a position (x, z), or None if its truth is plausible with these LikelyErrors."""
    if likely.are_plausible(measured_m, truth_m):
        return None
    return Outlier(name, np.asarray(measured_m), np.asarray(truth_m))


def outliers_of(names, measured_m, truth_m):
    """Outlier or None of each position among measured positions (n, 2) with true positions (n, 2)."""
    likely = likely_errors(measured_m, truth_m)
    plausible = likely.are_plausible(measured_m, truth_m)
    return [None if is_plausible else outlier_of(name, likely, *positions_m)
            for is_plausible, name, *positions_m in zip(plausible, names, measured_m, truth_m)]


def position_text(position_m):
    """Format a position (x, z) in millimetres."""
    return ('X %.0f, Z %.0f mm' % tuple(1000 * np.asarray(position_m, float) + 0.0)).replace('-', '\u2212')
