"""A constant-velocity Kalman filter in the plane, for many objects at once, that expects outliers behind the object.

Convention: a state is (x, y, vx, vy), metres and m/s, in the fixed frame; `mean` is (n, 4), `covariance` (n, 4, 4).
What is measured is (x, y). Where the depth of a box is not the person's but the background's, the measurement lies
behind the person on the camera's ray: its error is a mixture of two Gaussians, one of them shifted along the ray.
"""
from typing import NamedTuple

import numpy as np


class Measurements(NamedTuple):
    """Positions (m, 2) seen in one image, their covariances (m, 2, 2), and the directions (m, 2) in which the camera
    looked at them, of length 1."""

    positions_m: np.ndarray
    noise_m2: np.ndarray
    rays: np.ndarray


class Outliers(NamedTuple):
    """Share of measurements that lie behind the object, and how far behind: mean and standard deviation, metres."""

    probability: float = 0.1
    offset: float = 0.45
    spread: float = 0.3

    def components(self):
        """(weight, offset_m, spread_m) of the measurements as they should be, and of the outliers."""
        return (1 - self.probability, 0.0, 0.0), (self.probability, self.offset, self.spread)


def predict(mean, covariance, elapsed_s, density):
    """The states after `elapsed_s` with velocities that wander: white acceleration of `density` m²/s³.

    Returns
    -------
    mean, covariance : numpy.ndarray
    """
    step = np.eye(4)
    step[0, 2] = step[1, 3] = elapsed_s
    return mean.dot(step.T), step.dot(covariance).transpose(1, 0, 2).dot(step.T) + density * _white(elapsed_s)


def _white(elapsed_s):
    """Covariance (4, 4) that white acceleration of density 1 adds in `elapsed_s` (Bar-Shalom et al., 2001, 6.2.2)."""
    block = [[elapsed_s ** 3 / 3, elapsed_s ** 2 / 2], [elapsed_s ** 2 / 2, elapsed_s]]
    return np.kron(block, np.eye(2))


def unlikeliness(mean, covariance, measurements, outliers):
    """How well each measurement fits each object.

    Returns
    -------
    numpy.ndarray, (n, m)
        -2 log (2 pi times the density, per m², of the measurement if it is of that object).
    """
    return -2 * np.logaddexp(*(_fit(mean[:, None], covariance[:, None], measurements, component)[0]
                               for component in outliers.components()))


def update(mean, covariance, measurements, outliers):
    """The states after one measurement each: the mixture of what both components say, as one Gaussian.

    Returns
    -------
    mean, covariance : numpy.ndarray
    """
    means, covariances, logs = [], [], []
    for component in outliers.components():
        log, innovation, inverse = _fit(mean, covariance, measurements, component)
        gain = covariance[:, :, :2] @ inverse
        means.append(mean + (gain @ innovation[..., None])[..., 0])
        covariances.append(covariance - gain @ covariance[:, :2])
        logs.append(log)
    share = np.exp(logs[1] - np.logaddexp(*logs))
    shift = means[1] - means[0]
    mixed = covariances[0] + share[:, None, None] * (covariances[1] - covariances[0])
    mixed += (share * (1 - share))[:, None, None] * shift[:, :, None] * shift[:, None, :]
    return means[0] + share[:, None] * shift, (mixed + mixed.transpose(0, 2, 1)) / 2


def _fit(mean, covariance, measurements, component):
    """Log likelihood, innovation, and its inverse covariance, of one component."""
    weight, offset_m, spread_m = component
    rays = measurements.rays
    innovation = measurements.positions_m - offset_m * rays - mean[..., :2]
    spread = covariance[..., :2, :2] + measurements.noise_m2
    if spread_m:
        spread = spread + spread_m ** 2 * rays[..., :, None] * rays[..., None, :]
    inverse, determinant = _inverse(spread)
    distance = ((inverse @ innovation[..., None])[..., 0] * innovation).sum(axis=-1)
    return np.log(max(weight, 1e-12)) - (distance + np.log(determinant)) / 2, innovation, inverse


def _inverse(matrices):
    """Inverses and determinants of matrices (..., 2, 2)."""
    a, b, c, d = (matrices[..., i, j] for i in (0, 1) for j in (0, 1))
    determinant = a * d - b * c
    inverse = np.stack((np.stack((d, -b), axis=-1), np.stack((-c, a), axis=-1)), axis=-2)
    return inverse / determinant[..., None, None], determinant
