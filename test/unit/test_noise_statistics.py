"""Statistics of clusters of known distributions."""
import numpy as np
import pytest

from ros_3d_bb_lab.evaluation.noise.analysis import Inputs, analyse
from ros_3d_bb_lab.evaluation.noise.statistics import cluster_statistics, share_between_positions
from ros_3d_bb_lab.evaluation.noise.tables import Cluster, MeasurementTable


@pytest.mark.parametrize('kind', ['normal', 'laplace', 'standard_cauchy'])
def test_other_distributions_are_no_gaussian(kind):
    drawn = 0.02 * getattr(np.random.RandomState(3), kind)(size=300)
    assert cluster_statistics(Cluster(1.0, drawn)).looks_gaussian == (kind == 'normal')


def test_variance_between_positions_is_separated_from_that_of_repetitions():
    x_m, z_m = np.repeat([[-1, 0, 1, -1, 0, 1], [1, 1, 1, 2, 2, 2]], 50, axis=1).astype(float)
    error_m = 0.03 * x_m + 0.01 * np.random.RandomState(0).normal(size=len(x_m))
    table = MeasurementTable('made', np.stack((x_m, x_m, z_m + error_m), axis=1), np.stack((x_m, z_m), axis=1), x_m > 9,
                             ('',) * len(x_m))
    assert share_between_positions(table, 'Z') == pytest.approx(6 / 7.0, abs=0.03)
    table.measured_m[:, 0] = np.nan
    assert share_between_positions(table, 'Z') is None


def test_a_campaign_whose_people_at_the_sides_are_all_truncated_is_named():
    truth_m = np.repeat([(x, z) for x in (-0.5, 0.0, 0.5) for z in (1.0, 1.5, 2.0)], 3, axis=0)
    table = MeasurementTable('made', np.insert(truth_m, 1, 0, axis=1), truth_m, truth_m[:, 0] != 0,
                             tuple(map(str, range(len(truth_m)))))
    with pytest.raises(ValueError, match='2 values of X true needed; there are 9 at 0 m, without people who are trunc'):
        analyse(Inputs.of_session(table, 'foreground', 'none'))
