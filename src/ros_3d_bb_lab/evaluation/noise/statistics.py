"""Statistics of clusters of errors: moments, normality tests, and held-out likelihoods of distributions."""
from typing import NamedTuple, Optional

import numpy as np
from scipy import stats

from ros_3d_bb_lab.evaluation.noise.tables import AXES

LEAST_SCALE_M = 0.001  # values are rounded to millimetres: limits the density to what this resolution supports
FOLDS = 5
EM_STEPS = 60
FREEDOMS = (1, 2, 4, 8, 16, 64)  # of Student's t distribution, from heavy tails to nearly Gaussian
NARROWEST_PART = 0.25  # of a mixture, relative to the total standard deviation; prevents a collapse to one value
SIGNIFICANCE = 0.05
LEAST_TO_TEST = 8  # measurements; the critical values of Anderson-Darling are undefined below


class ClusterStatistics(NamedTuple):
    """Statistics of one cluster, in metres.

    `variance_m2` is divided by n, as in the thesis. The other fields are results of the Shapiro-Wilk and
    Anderson-Darling tests and held-out log-likelihoods per measurement; None if all errors are equal, or if there are
    fewer than 8.
    """

    truth_m: float
    count: int
    mean_m: float
    variance_m2: float
    rms_m: float
    shapiro_p: Optional[float] = None
    anderson: Optional[float] = None
    anderson_critical: Optional[float] = None
    log_likelihoods: Optional[dict] = None

    @property
    def sigma_m(self):
        return float(np.sqrt(self.variance_m2))

    @property
    def tested(self):
        """Whether there were enough measurements for the tests."""
        return self.shapiro_p is not None

    @property
    def looks_gaussian(self):
        """Whether neither test rejects a Gaussian at 5 %."""
        return self.tested and self.shapiro_p >= SIGNIFICANCE and self.anderson < self.anderson_critical


class AxisStatistics(NamedTuple):
    """Clusters of one axis, and the polynomial of their mean error by true value, highest power first."""

    poly: tuple
    clusters: tuple

    @property
    def max_variance_m2(self):
        return max(cluster.variance_m2 for cluster in self.clusters)

    @property
    def max_sigma_m(self):
        return float(np.sqrt(self.max_variance_m2))


def axis_statistics(clusters, degree):
    """Compute the statistics of clusters, and fit a polynomial to their means with equal weights (as in the thesis)."""
    if len(clusters) <= degree:
        raise ValueError('%d clusters; at least %d needed for a polynomial of degree %d'
                         % (len(clusters), degree + 1, degree))
    described = tuple(cluster_statistics(cluster) for cluster in clusters)
    poly = np.polyfit([cluster.truth_m for cluster in described], [cluster.mean_m for cluster in described], degree)
    return AxisStatistics(tuple(poly.tolist()), described)


def share_between_positions(measurements, axis):
    """Share 0..1 of the variance within the clusters of an axis that is between positions on the other axis.

    None if no measurement has both.
    """
    known = measurements.complete()
    number = AXES.index(axis)
    error_m = known.measured_m[:, 2 * number] - known.truth_m[:, number]
    if not len(error_m):
        return None
    clusters, positions = (np.unique(truth, axis=0, return_inverse=True)[1].reshape(-1)
                           for truth in (known.truth_m[:, [number]], known.truth_m))
    whole, within = (_variance_within(error_m, group) for group in (clusters, positions))
    return float(1 - within / whole) if whole > 0 else None


def _variance_within(values, group):
    """Mean squared deviation of values (n,) from the mean of their group (n,)."""
    counts = np.bincount(group)
    return float(np.mean((values - (np.bincount(group, values) / counts)[group]) ** 2))


def cluster_statistics(cluster):
    error_m = cluster.error_m
    found = ClusterStatistics(cluster.truth_m, len(error_m), float(error_m.mean()), float(error_m.var()),
                              float(np.sqrt((error_m ** 2).mean())))
    if len(error_m) < LEAST_TO_TEST or np.ptp(error_m) == 0:
        return found
    anderson = stats.anderson(error_m, 'norm')
    return found._replace(
        shapiro_p=float(stats.shapiro(error_m)[1]), anderson=float(anderson[0]),
        anderson_critical=float(anderson[1][list(anderson[2]).index(5.0)]),
        log_likelihoods={name: held_out_log_likelihood(error_m, fit) for name, fit in DISTRIBUTIONS})


def held_out_log_likelihood(values_m, fit):
    """Mean log-density of values under the distributions that `fit` estimates by five-fold cross-validation."""
    fold = np.random.RandomState(0).permutation(len(values_m)) % FOLDS
    total = sum(fit(values_m[fold != number])(values_m[fold == number]).sum() for number in np.unique(fold))
    return float(total / len(values_m))


def fit_gaussian(values_m):
    """Log-density function of the maximum-likelihood Gaussian."""
    return stats.norm(values_m.mean(), max(values_m.std(), LEAST_SCALE_M)).logpdf


def fit_laplace(values_m):
    """Log-density function of the maximum-likelihood Laplace distribution."""
    location, scale = stats.laplace.fit(values_m)
    return stats.laplace(location, max(scale, LEAST_SCALE_M)).logpdf


def fit_student(values_m):
    """Log-density function of the maximum-likelihood Student t distribution."""
    candidates = [stats.t(freedom, *_student_location_scale(values_m, freedom)).logpdf for freedom in FREEDOMS]
    return max(candidates, key=lambda density: density(values_m).sum())


def _student_location_scale(values_m, freedom):
    """Maximum-likelihood location and scale for given degrees of freedom, by expectation maximisation."""
    location_m, scale_m = np.median(values_m), max(values_m.std(), LEAST_SCALE_M)
    for _ in range(EM_STEPS):
        weights = (freedom + 1) / (freedom + ((values_m - location_m) / scale_m) ** 2)
        location_m = (weights * values_m).sum() / weights.sum()
        scale_m = max(np.sqrt((weights * (values_m - location_m) ** 2).mean()), LEAST_SCALE_M)
    return location_m, scale_m


def fit_mixture(values_m):
    """Log-density function of a mixture of two Gaussians, fitted by expectation maximisation from both halves."""
    upper = values_m > np.median(values_m)
    narrowest_m = max(LEAST_SCALE_M, NARROWEST_PART * values_m.std())
    share = np.stack((~upper, upper)).astype(float)  # (2, n): responsibilities
    for _ in range(EM_STEPS):
        weights = np.maximum(share.mean(axis=1), 1e-6)
        means_m = (share * values_m).sum(axis=1) / (weights * len(values_m))
        deviations_m2 = (values_m - means_m[:, np.newaxis]) ** 2
        sigmas_m = np.maximum(np.sqrt((share * deviations_m2).sum(axis=1) / (weights * len(values_m))), narrowest_m)
        parts = _log_parts(values_m, weights, means_m, sigmas_m)
        share = np.exp(parts - np.logaddexp(*parts))
    return lambda at_m: np.logaddexp(*_log_parts(at_m, weights, means_m, sigmas_m))


def _log_parts(values_m, weights, means_m, sigmas_m):
    deviations = (values_m - means_m[:, np.newaxis]) / sigmas_m[:, np.newaxis]
    return np.log(weights / (np.sqrt(2 * np.pi) * sigmas_m))[:, np.newaxis] - deviations ** 2 / 2


DISTRIBUTIONS = (('Gaussian', fit_gaussian), ('Laplace', fit_laplace), ('Student t', fit_student),
                 ('two Gaussians', fit_mixture))
