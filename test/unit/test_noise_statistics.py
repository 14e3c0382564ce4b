"""Statistics of clusters of known distributions."""
import numpy as np
import pytest

from ros_3d_bb_lab.evaluation.noise import theory
from ros_3d_bb_lab.evaluation.noise.statistics import (DISTRIBUTIONS, axis_statistics, cluster_statistics,
                                                       held_out_log_likelihood, share_between_positions)
from ros_3d_bb_lab.evaluation.noise.tables import Cluster, MeasurementTable


def drawn(kind, count=300):
    random = np.random.RandomState(3)
    return 0.02 * {'Gaussian': random.normal, 'Laplace': random.laplace,
                   'Student t': lambda size: random.standard_t(1.5, size),
                   'two Gaussians': lambda size: random.normal(size=size) + 8 * (random.random_sample(size) < 0.4),
                   }[kind](size=count)


@pytest.mark.parametrize('kind', ['Laplace', 'Student t', 'two Gaussians'])
def test_the_distribution_that_made_the_errors_predicts_them_best(kind):
    found = cluster_statistics(Cluster(1.0, drawn(kind)))
    assert max(found.log_likelihoods, key=found.log_likelihoods.get) == kind
    assert not found.looks_gaussian


def test_no_distribution_predicts_a_gaussian_much_better_than_a_gaussian():
    found = cluster_statistics(Cluster(1.0, drawn('Gaussian')))
    assert found.looks_gaussian and found.shapiro_p > 0.05 and found.anderson < found.anderson_critical
    assert max(found.log_likelihoods.values()) - found.log_likelihoods['Gaussian'] < 0.02
    assert found.log_likelihoods['Gaussian'] == pytest.approx(-0.5 * np.log(2 * np.pi * np.e * 0.02 ** 2), abs=0.1)


@pytest.mark.parametrize('name,fit', DISTRIBUTIONS)
def test_densities_integrate_to_one_and_are_limited_for_equal_values(name, fit):
    at_m = np.linspace(-20, 20, 400001)
    assert np.trapz(np.exp(fit(drawn('Gaussian', 60))(at_m)), at_m) == pytest.approx(1, abs=0.01)
    assert held_out_log_likelihood(np.array([0.01] * 9 + [0.02]), fit) < np.log(1 / 0.001)


def test_moments_are_those_of_the_thesis():
    found = cluster_statistics(Cluster(1.0, np.array([0.01, 0.02, 0.06])))
    assert found.mean_m == pytest.approx(0.03) and found.rms_m == pytest.approx(np.sqrt(0.0041 / 3))
    assert found.variance_m2 == pytest.approx(0.0014 / 3)  # divided by n


def test_equal_or_few_errors_are_not_tested():
    equal, few = (cluster_statistics(Cluster(1.0, np.array(values))) for values in ([0.01] * 9, [0.01, 0.02, 0.05]))
    assert equal.variance_m2 == 0 and few.variance_m2 > 0
    for found in (equal, few):
        assert found.shapiro_p is None and not found.tested and not found.looks_gaussian


def test_each_cluster_has_the_same_weight_in_the_polynomial():
    clusters = [Cluster(x_m, x_m / 10 + 0.01 * np.tile([-1, 0, 1], int(4 * x_m))) for x_m in (1.0, 2.0, 3.0)]
    clusters.append(Cluster(4.0, np.array([0.39, 0.4, 0.41])))
    found = axis_statistics(clusters, 1)
    assert found.poly == pytest.approx((0.1, 0.0), abs=1e-9)
    assert found.max_sigma_m == pytest.approx(np.sqrt(2 / 3.0) / 100)
    with pytest.raises(ValueError, match='2 clusters; at least 3'):
        axis_statistics(clusters[:2], 2)


def test_variance_between_positions_is_separated_from_that_of_repetitions():
    x_m, z_m = np.repeat([[-1, 0, 1, -1, 0, 1], [1, 1, 1, 2, 2, 2]], 50, axis=1).astype(float)
    error_m = 0.03 * x_m + 0.01 * np.random.RandomState(0).normal(size=len(x_m))
    table = MeasurementTable('made', np.stack((x_m, x_m, z_m + error_m), axis=1), np.stack((x_m, z_m), axis=1), x_m > 9,
                             ('',) * len(x_m))
    assert share_between_positions(table, 'Z') == pytest.approx(6 / 7.0, abs=0.03)
    table.measured_m[:, 0] = np.nan
    assert share_between_positions(table, 'Z') is None


def test_stereo_theory():
    assert theory.focal_px(90, 640) == pytest.approx(320) and theory.fov_deg(320, 640) == pytest.approx(90)
    assert theory.focal_px(69, 640) == pytest.approx(465.6, abs=0.1)  # the thesis'
    assert theory.fov_deg(614.686, 640) == pytest.approx(55.0, abs=0.05)  # of its camera
    assert theory.stereo_rms_m([1, 2, 3], 20.0, 0.1) == pytest.approx([0.005, 0.02, 0.045])
