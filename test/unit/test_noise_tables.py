"""Reader of measurements for the noise analysis, and statistics of clusters of known distributions."""
import numpy as np
import pytest

from ros_3d_bb_lab.evaluation.noise.analysis import Inputs, analyse
from ros_3d_bb_lab.evaluation.noise.statistics import cluster_statistics
from ros_3d_bb_lab.evaluation.noise.tables import Cluster, MeasurementTable, read_session_measurements, read_table
from support.noise_tables import write_table
from support.small_session import change_json, write_small_session


def test_an_axis_that_was_not_measured_may_be_empty_or_missing(tmp_path):
    empty = read_table(write_table(tmp_path / 'empty.csv', [['', '', 288, 300, '', '', -12, 12]]), 'Z')
    missing = read_table(write_table(tmp_path / 'missing.csv', [[288, 300]], ['Z measured', ' Z true']), 'Z')
    for table in (empty, missing):
        assert np.isnan(table.truth_m[0, 0]) and table.truth_m[0, 1] == 0.3 and len(table.complete().truth_m) == 0


@pytest.mark.parametrize('row,reason', [
    ([0, 0, 'far', 300], 'line 3: "Z measured" is \'far\'; a number of millimetres expected'),
    ([0, 0, 'inf', 300], 'line 3: "Z measured" is \'inf\''),
    ([0, 0, '', 300], 'line 3: "Z measured" is nan and "Z true" is 300; both or none expected'),
    ([0, 0, 288, 300, 0, 0, 12], 'line 3: "Z error" is 12, but measured minus true is -12')])
def test_rows_with_faults_are_named(tmp_path, row, reason):
    with pytest.raises(ValueError) as error:
        read_table(write_table(tmp_path / 'table.csv', [[0, 0, 288, 300], row]), 'Z')
    assert 'table.csv' in str(error.value) and reason in str(error.value)


@pytest.mark.parametrize('axis', 'XZ')
def test_a_table_in_metres_is_rejected(tmp_path, axis):
    path = write_table(tmp_path / 'table.csv', [[-1.152, -1.23, 2.558, 2.7], [0.1, 0, 1.4, 1.5]])
    with pytest.raises(ValueError, match='table.csv: "%s true" is .* seem to be metres' % axis):
        read_table(path, axis)


@pytest.mark.parametrize('content,reason', [
    (b'X measured,X true,Z measured\n', 'no column "Z true"; there are: X measured'),
    (b'\x89PNG\xff\xfe', 'cannot be read'), (b'Z measured,Z true\n', 'without rows')])
def test_files_that_are_not_tables_are_rejected(tmp_path, content, reason):
    (tmp_path / 'table.csv').write_bytes(content)
    with pytest.raises(ValueError, match='table.csv.*' + reason):
        read_table(str(tmp_path / 'table.csv'), 'Z')


def test_an_outlier_does_not_remove_the_other_person_of_its_image(tmp_path):
    folder = write_small_session(str(tmp_path), count=8)

    def annotate(content):
        for entry in content['frames']:
            entry['truth_mm'], entry['detections'][1]['truth_mm'] = {'x': -470, 'z': 2000}, {'x': 700, 'z': 3000}
        content['frames'][3]['detections'][1]['truth_mm']['z'] = 300
    change_json(folder, annotate)
    table = read_session_measurements(folder, 'recorded')
    plausible = table.without(table.outliers())
    assert len(table.ids) == 16 and plausible.ids.count('m3 (by the door)') == 1
    assert sorted(plausible.truth_m[:, 1].tolist()) == 8 * [2.0] + 7 * [3.0]


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
