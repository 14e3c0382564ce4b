"""Statistics of clusters of known distributions."""
import numpy as np
import pytest

from ros_3d_bb_lab.evaluation.noise.analysis import Inputs, analyse
from ros_3d_bb_lab.evaluation.noise.statistics import cluster_statistics
from ros_3d_bb_lab.evaluation.noise.tables import Cluster, MeasurementTable


@pytest.mark.parametrize('kind', ['normal', 'laplace', 'standard_cauchy'])
def test_other_distributions_are_no_gaussian(kind):
    drawn = 0.02 * getattr(np.random.RandomState(3), kind)(size=300)
    assert cluster_statistics(Cluster(1.0, drawn)).looks_gaussian == (kind == 'normal')


def test_a_campaign_whose_people_at_the_sides_are_all_truncated_is_named():
    truth_m = np.repeat([(x, z) for x in (-0.5, 0.0, 0.5) for z in (1.0, 1.5, 2.0)], 3, axis=0)
    table = MeasurementTable('made', np.insert(truth_m, 1, 0, axis=1), truth_m, truth_m[:, 0] != 0,
                             tuple(map(str, range(len(truth_m)))))
    with pytest.raises(ValueError, match='2 values of X true needed; there are 9 at 0 m, without people who are trunc'):
        analyse(Inputs.of_session(table, 'foreground', 'none'))
