"""The command `./run noise`: the numbers and figures of the thesis, a report and error models.

With ROS_3D_BB_DATA the tables are those of the thesis; otherwise they are generated with its mean errors and standard
deviations.
"""
import json
import os
import re
import sys

import cv2
import pytest

import conftest
from ros_3d_bb.estimation.error_model import read_error_model
from ros_3d_bb_lab.evaluation.noise import __main__ as command
from support.noise_tables import rows_of, write_table

pytestmark = pytest.mark.slow  # each model is fitted many times
FIGURES = ['figure_5_%d.png' % number for number in range(2, 9)]


def run(monkeypatch, *arguments):
    monkeypatch.setattr(sys, 'argv', ['./run noise'] + [str(argument) for argument in arguments])
    command.main()


@pytest.fixture(scope='module')
def out(tmp_path_factory):
    """Output of the command for the tables of the thesis: for z, x, and the variance of x."""
    folder = tmp_path_factory.mktemp('noise') / 'out'
    if conftest.DATA:
        tables = [os.path.join(conftest.DATA, 'data', 'thesis', 'csv', name + '.csv')
                  for name in ('measurements_combined', 'new_measurements', 'measurements_without_edges')]
    else:
        tables = [write_table(tmp_path_factory.mktemp('tables') / 'table.csv', rows_of())] * 3
    with pytest.MonkeyPatch.context() as patch:
        run(patch, '--z', tables[0], '--x', tables[1], '--x-variance', tables[2], '--out', folder,
            '--estimator', 'median', '--camera', 'D435i <&>')
    return folder


def test_the_numbers_are_those_of_the_thesis(out):
    summary = json.loads((out / 'summary.json').read_text())
    assert [round(value, digits) for value, digits in zip(summary['z']['poly'], (2, 2, 3))] == [-0.04, 0.06, 0.008]
    assert [round(value, 3) for value in summary['x']['poly']] == [-0.106, -0.006]
    assert '%.5f %.4f' % (summary['z']['max_variance_m2'], summary['z']['max_sigma_m']) == '0.00225 0.0474'
    assert '%.5f %.3f' % (summary['x']['max_variance_m2'], summary['x']['max_sigma_m']) == '0.00032 0.018'
    assert len(summary['z']['clusters']) in (7, 10) and len(summary['x']['variance_clusters']) == 5
    assert sum(cluster['count'] for cluster in summary['z']['clusters']) in (345, len(rows_of()))
    assert set(summary['z']['clusters'][0]) >= {'truth_m', 'count', 'mean_m', 'variance_m2', 'shapiro_p', 'anderson',
                                                'log_likelihoods'}


def test_the_report_contains_all_figures(out):
    page = (out / 'report.html').read_text(encoding='utf-8')
    assert re.findall('<img src="([^"]*)"', page) == FIGURES
    for name in FIGURES:
        image = cv2.imread(str(out / name))
        assert image.shape[0] > 300 and image.std() > 5
    assert '69°' in page and '614.7 px' in page and 'D435i &lt;&amp;&gt;' in page
    assert '>None' not in page and 'nan' not in page


def test_the_error_models_can_be_read_and_correct_the_bias(out):
    for name in ('error_model.yaml', 'error_model_thesis_form.yaml'):
        model = read_error_model(out / name)
        assert model.corrected([0.0, 0.0, 2.8])[2] == pytest.approx(2.96, abs=0.05)
        assert model.provenance.estimator == 'median' and model.provenance.camera == 'D435i <&>'
        assert '/' not in model.provenance.source
    scores = read_error_model(out / 'error_model.yaml').cross_validated
    assert scores.rmse_plane_m < 0.07 and 0.85 < scores.coverage_95 <= 1


def test_a_session_is_analysed_in_the_same_way(session_folder, tmp_path, monkeypatch, capsys):
    run(monkeypatch, session_folder, '--out', tmp_path / 'out', '--estimator', 'recorded')
    model = read_error_model(tmp_path / 'out' / 'error_model.yaml')
    assert model.provenance.measurements in (110, 85) and model.provenance.estimator == 'recorded'
    assert 'report.html' in capsys.readouterr().out


def test_without_positions_in_both_axes_the_model_has_the_form_of_the_thesis(tmp_path, monkeypatch):
    z = write_table(tmp_path / 'z.csv', [['', '', row[2], row[3]] for row in rows_of(3)])
    x = write_table(tmp_path / 'x.csv', [[row[0], row[1], '', ''] for row in rows_of(3)])
    run(monkeypatch, '--z', z, '--x', x, '--out', tmp_path / 'out')
    assert read_error_model(tmp_path / 'out' / 'error_model.yaml').cross_validated is None
    assert 'No cross-validated model: measurements at 0 different x' in (tmp_path / 'out' / 'report.html').read_text(
        encoding='utf-8')


@pytest.mark.parametrize('arguments,reason', [
    (['--z', 'no.csv', '--x', 'no.csv'], 'no.csv: cannot be read as a table'),
    (['no_session'], 'no_session: not a measurement session')])
def test_invalid_input_is_named_and_leaves_no_folder(tmp_path, monkeypatch, arguments, reason):
    with pytest.raises(SystemExit, match='./run noise: ' + reason):
        run(monkeypatch, *arguments + ['--out', tmp_path / 'out'])
    assert not (tmp_path / 'out').exists()


@pytest.mark.parametrize('arguments', [[], ['--z', 'z.csv'], ['session', '--z', 'z.csv', '--x', 'x.csv']])
def test_incomplete_arguments_are_rejected(tmp_path, monkeypatch, capsys, arguments):
    with pytest.raises(SystemExit):
        run(monkeypatch, *arguments + ['--out', tmp_path / 'out'])
    assert 'expected' in capsys.readouterr().err
