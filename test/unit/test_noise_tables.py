import numpy as np
import pytest

from ros_3d_bb.camera.camera_model import transform_points
from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.sessions.plausibility import likely_errors
from ros_3d_bb.sessions.session_writer import append
from ros_3d_bb.sessions.snapshots import ColorImage, Snapshot
from ros_3d_bb_lab.evaluation.noise.analysis import Inputs, analyse
from ros_3d_bb_lab.evaluation.noise.tables import MeasurementTable, read_session_measurements, read_table
from ros_3d_bb_lab.simulation.scenario import scenario_from
from ros_3d_bb_lab.simulation.simulator import Simulator
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


def test_people_stand_upright_before_a_tilted_camera(tmp_path):
    simulator = Simulator(scenario_from({
        'duration': 0.1, 'rate': 10.0, 'robot': {'mount': [0.0, 0.0, 1.8], 'pitch': np.radians(30)},
        'people': [{'start': [1.7, 0.3]}]}))
    frame = simulator.frame(0)
    camera_from_map, (person,) = np.linalg.inv(frame.poses.map_from_camera), frame.people
    depth, color = DepthImage(frame.depth_mm, 0.001), ColorImage(frame.color, 'optical')
    append(str(tmp_path), Snapshot(0, color, depth, simulator.camera, (tuple(person.box_px),), None,
                                   camera_from_map[:3, 2]))
    x, _y, z = transform_points(camera_from_map, person.position_m)
    change_json(str(tmp_path), lambda content: content['frames'][0].update(truth_mm={'x': 1000 * x, 'z': 1000 * z}))
    table = read_session_measurements(str(tmp_path), 'foreground')
    np.testing.assert_allclose(table.measured_m[:, [0, 2]], table.truth_m, atol=0.06)
    change_json(str(tmp_path), lambda content: content['frames'][0].pop('up'))
    table = read_session_measurements(str(tmp_path), 'foreground')
    assert np.abs(table.measured_m[:, 2] - table.truth_m[:, 1]) > 0.1  # as if the camera were level


def test_a_campaign_whose_people_at_the_sides_are_all_truncated_is_named():
    truth_m = np.repeat([(x, z) for x in (-0.5, 0.0, 0.5) for z in (1.0, 1.5, 2.0)], 3, axis=0)
    table = MeasurementTable('made', np.insert(truth_m, 1, 0, axis=1), truth_m, truth_m[:, 0] != 0,
                             tuple(map(str, range(len(truth_m)))))
    with pytest.raises(ValueError, match='2 values of X true needed; there are 9 at 0 m, without people who are trunc'):
        analyse(Inputs.of(table, table, table, 'foreground', 'none'))


SLIP_M = 0.3 + 1e-9  # larger slips must be found
FACTORS = 1000.0, 100.0, 10.0, 0.1, 0.01, 0.001  # of a wrong unit, or of a lost zero


@pytest.fixture(scope='module', params=['foreground', 'recorded'])
def table(request, session_folder):
    return read_session_measurements(session_folder, request.param)


def positions_of(table):
    return table.measured_m[:, [0, 2]], table.truth_m


def slips_of(truth_m, marks_m):
    """True positions (x, z) that a slip could turn into others: digits lost, units, sign, next marks."""
    for axis in (0, 1):
        digits = '%d' % round(1000 * abs(truth_m[axis]))
        values_mm = [float(digits[:place] + digits[place + 1:] or 0) for place in range(len(digits))]
        for value_m in [np.copysign(value_mm / 1000, truth_m[axis]) for value_mm in values_mm] + [
                factor * truth_m[axis] for factor in FACTORS]:
            yield np.where(np.arange(2) == axis, value_m, truth_m)
    yield from (factor * truth_m for factor in FACTORS)
    yield truth_m * (-1, 1)
    yield from marks_m


def test_every_slip_of_more_than_0_3_m_is_found_and_no_true_position_is(table):
    measured_m, truth_m = positions_of(table)
    marks_m, count = np.unique(truth_m, axis=0), 0
    for number in range(len(truth_m)):
        others = np.arange(len(truth_m)) != number
        likely = likely_errors(measured_m[others], truth_m[others])
        assert likely.are_plausible(measured_m[number], truth_m[number])
        slips_m = np.array([slip_m for slip_m in slips_of(truth_m[number], marks_m)
                            if np.hypot(*(slip_m - truth_m[number])) > SLIP_M])
        missed = likely.are_plausible(np.broadcast_to(measured_m[number], slips_m.shape), slips_m)
        assert not missed.any(), (truth_m[number], slips_m[missed])
        count += len(slips_m)
    assert count > 25 * len(truth_m)


def made(count, seed=0, noise_m=0.01):
    """Measured and true positions with the errors 0.1 - 0.05 z in z and -0.1 x in x."""
    random = np.random.RandomState(seed)
    truth_m = np.stack((random.uniform(-1, 1, count), random.uniform(1, 4, count)), axis=1)
    error_m = np.stack((-0.1 * truth_m[:, 0], 0.1 - 0.05 * truth_m[:, 1]), axis=1)
    return truth_m + error_m + noise_m * random.normal(size=truth_m.shape), truth_m
