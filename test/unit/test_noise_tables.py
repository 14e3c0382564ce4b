import numpy as np
import pytest

from ros_3d_bb.camera.camera_model import transform_points
from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.sessions.session_writer import append
from ros_3d_bb.sessions.snapshots import ColorImage, Snapshot
from ros_3d_bb_lab.evaluation.noise.tables import read_session_measurements, read_table
from ros_3d_bb_lab.simulation.scenario import scenario_from
from ros_3d_bb_lab.simulation.simulator import Simulator
from support.noise_tables import write_table
from support.small_session import change_json


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
