"""Statistics of clusters of errors: moments and normality tests."""
from typing import NamedTuple, Optional

import numpy as np
from scipy import stats

from ros_3d_bb_lab.evaluation.noise.tables import AXES

SIGNIFICANCE = 0.05
LEAST_TO_TEST = 8  # measurements; the critical values of Anderson-Darling are undefined below


class ClusterStatistics(NamedTuple):
    """Statistics of one cluster, in metres.

    `variance_m2` is divided by n, as in the thesis. The other fields are results of the Shapiro-Wilk and
    Anderson-Darling tests; None if all errors are equal, or if there are fewer than 8.
    """

    truth_m: float
    count: int
    mean_m: float
    variance_m2: float
    rms_m: float
    shapiro_p: Optional[float] = None
    anderson: Optional[float] = None
    anderson_critical: Optional[float] = None

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
        anderson_critical=float(anderson[1][list(anderson[2]).index(5.0)]))
