import csv
import json
import os

import pytest

from ros_3d_bb.estimation.error_model import read_error_model
from ros_3d_bb_annotator.command_line import main
from ros_3d_bb_annotator.export import export
from ros_3d_bb_lab.evaluation.noise.tables import read_table
from support.small_session import NEAR_BOX, change_json, write_small_session
from support.synthetic_session import write_synthetic_session


def test_a_row_contains_box_estimates_and_truth_in_all_axes(document, tmp_path):
    document.set_truths([0], -0.5, 2.1004, 0.01)
    path = str(tmp_path / 'table.csv')
    assert export(document, path, 'foreground') == 1
    with open(path, newline='') as stream:
        row, = csv.DictReader(stream)
    x_m, y_m, z_m = document.estimates.of(0)[0]
    assert (row['id'], row['label'], row['stamp']) == ('m0', 'by the door', '1616161616.000000005')
    assert [int(row[edge]) for edge in ('x1', 'y1', 'x2', 'y2')] == list(NEAR_BOX) and row['implausible'] == ''
    assert [float(row[axis + ' measured']) for axis in 'XYZ'] == pytest.approx(
        [1000 * x_m, 1000 * y_m, 1000 * z_m], abs=0.06)
    assert [float(row[axis + ' recorded']) for axis in 'XYZ'] == [-466.5, 33, 2000]
    assert [float(row[axis + ' true']) for axis in 'XYZ'] == [-500, 10, 2100.4]
    assert float(row['Z error']) == pytest.approx(1000 * z_m - 2100.4, abs=0.06)
    assert read_table(path, 'Z').truth_m.tolist() == [[-0.5, 2.1004]]


@pytest.fixture
def annotated_folder(tmp_path):
    """Session whose truth differs from the estimates by 0.1 m."""
    write_small_session(str(tmp_path))
    change_json(str(tmp_path), lambda content: [entry.update(truth_mm={'x': -466.5, 'z': 2100})
                                                for entry in content['frames']])
    return str(tmp_path)


@pytest.mark.slow
def test_the_output_folder_and_the_estimator_of_the_analysis_can_be_chosen(tmp_path, capsys):
    session, out = write_synthetic_session(str(tmp_path / 'session')), str(tmp_path / 'out')
    assert main(['--analyse', session, '--out', out, '--estimator', 'recorded']) == 0
    text = capsys.readouterr().out
    assert 'f(z) = ' in text and 'report: %s' % os.path.join(out, 'report.html') in text
    assert {'report.html', 'summary.json', 'error_model.yaml', 'z_error.png'} <= set(os.listdir(out))
    with open(os.path.join(out, 'summary.json')) as stream:
        assert len(json.load(stream)['z']['clusters']) == 6
    assert read_error_model(os.path.join(out, 'error_model.yaml')).provenance.estimator == 'recorded'
