"""Statistics of clusters of known distributions."""
import numpy as np
import pytest

from ros_3d_bb_lab.evaluation.noise.analysis import Inputs, analyse
from ros_3d_bb_lab.evaluation.noise.statistics import cluster_statistics
from ros_3d_bb_lab.evaluation.noise.tables import Cluster, MeasurementTable


def drawn(kind, count=300):
    random = np.random.RandomState(3)
    return 0.02 * {'Gaussian': random.normal, 'Laplace': random.laplace,
                   'Student t': lambda size: random.standard_t(1.5, size),
                   'two Gaussians': lambda size: random.normal(size=size) + 8 * (random.random_sample(size) < 0.4),
                   }[kind](size=count)


@pytest.mark.parametrize('kind', ['Laplace', 'Student t', 'two Gaussians'])
def test_other_distributions_are_no_gaussian(kind):
    assert not cluster_statistics(Cluster(1.0, drawn(kind))).looks_gaussian


def test_a_gaussian_is_not_rejected():
    assert cluster_statistics(Cluster(1.0, drawn('Gaussian'))).looks_gaussian


def test_moments_are_those_of_the_thesis():
    found = cluster_statistics(Cluster(1.0, np.array([0.01, 0.02, 0.06])))
    assert found.mean_m == pytest.approx(0.03) and found.rms_m == pytest.approx(np.sqrt(0.0041 / 3))
    assert found.variance_m2 == pytest.approx(0.0014 / 3)  # divided by n


def test_a_campaign_whose_people_at_the_sides_are_all_truncated_is_named():
    truth_m = np.repeat([(x, z) for x in (-0.5, 0.0, 0.5) for z in (1.0, 1.5, 2.0)], 3, axis=0)
    table = MeasurementTable('made', np.insert(truth_m, 1, 0, axis=1), truth_m, truth_m[:, 0] != 0,
                             tuple(map(str, range(len(truth_m)))))
    with pytest.raises(ValueError, match='2 values of X true needed; there are 9 at 0 m, without people who are trunc'):
        analyse(Inputs.of_session(table, 'foreground', 'none'))
