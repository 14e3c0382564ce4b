"""Statistics of clusters of errors: moments and a normality test."""
from typing import NamedTuple, Optional

import numpy as np
from scipy import stats

SIGNIFICANCE = 0.05
LEAST_TO_TEST = 8  # measurements


class ClusterStatistics(NamedTuple):
    """Statistics of one cluster, in metres.

    `variance_m2` is divided by n, as in the thesis. `shapiro_p` is the result of the Shapiro-Wilk test; None if all
    errors are equal, or if there are fewer than 8.
    """

    truth_m: float
    count: int
    mean_m: float
    variance_m2: float
    rms_m: float
    shapiro_p: Optional[float] = None

    @property
    def sigma_m(self):
        return float(np.sqrt(self.variance_m2))

    @property
    def tested(self):
        """Whether there were enough measurements for the test."""
        return self.shapiro_p is not None

    @property
    def looks_gaussian(self):
        """Whether the test does not reject a Gaussian at 5 %."""
        return self.tested and self.shapiro_p >= SIGNIFICANCE


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


def cluster_statistics(cluster):
    error_m = cluster.error_m
    found = ClusterStatistics(cluster.truth_m, len(error_m), float(error_m.mean()), float(error_m.var()),
                              float(np.sqrt((error_m ** 2).mean())))
    if len(error_m) < LEAST_TO_TEST or np.ptp(error_m) == 0:
        return found
    return found._replace(shapiro_p=float(stats.shapiro(error_m)[1]))
