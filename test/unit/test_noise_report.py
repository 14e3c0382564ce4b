"""The command `./run noise`: the numbers and figures of the thesis, a report and an error model.

With ROS_3D_BB_DATA the tables are those of the thesis; otherwise they are generated with its mean errors and standard
deviations.
"""
import base64
import json
import os
import re
import shutil
import sys

import cv2
import numpy as np
import pytest

import conftest
from ros_3d_bb.estimation.error_model import read_error_model
from ros_3d_bb_lab.evaluation.noise import __main__ as command
from support.noise_tables import COLUMNS, rows_of, write_table
from support.small_session import change_json
from support.synthetic_session import write_synthetic_session

pytestmark = pytest.mark.slow  # each model is fitted many times
FIGURES = ['z_error', 'z_rms', 'x_error', 'sigma', 'z_distribution', 'x_distribution']


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
    assert set(summary['z']['clusters'][0]) >= {'truth_m', 'count', 'mean_m', 'variance_m2', 'shapiro_p'}


def test_the_report_contains_all_figures(out):
    page = (out / 'report.html').read_text(encoding='utf-8')
    embedded = [base64.b64decode(data) for data in re.findall('<img src="data:image/png;base64,([^"]*)"', page)]
    assert sorted(embedded) == sorted((out / (name + '.png')).read_bytes() for name in FIGURES)
    for data in embedded:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
        assert image.shape[0] > 300 and image.std() > 5
    assert 'D435i &lt;&amp;&gt;' in page
    text = re.sub('base64,[^"]*', '', page)
    assert '>None' not in text and 'nan' not in text and 'src="d' in text and 'href' not in text


def test_the_error_model_can_be_read_and_corrects_the_bias(out):
    model = read_error_model(out / 'error_model.yaml')
    assert model.corrected([0.0, 0.0, 2.8])[2] == pytest.approx(2.96, abs=0.05)
    assert model.provenance.estimator == 'median' and model.provenance.camera == 'D435i <&>'
    assert '/' not in model.provenance.source
    assert model.cross_validated.rmse_plane_m < 0.07 and 0.85 < model.cross_validated.coverage_95 <= 1


def test_without_an_invertible_bias_no_earlier_model_remains(out, tmp_path, monkeypatch, capsys):
    shutil.copy(str(out / 'error_model.yaml'), str(tmp_path))
    rows = [[x, x, 0.3 * z + 600 + 5 * number, z] for z in (1500, 2000, 3000, 4000) for x in (-500, 0, 500)
            for number in range(3)]
    table = write_table(tmp_path / 'steep.csv', rows, COLUMNS[:4])
    run(monkeypatch, '--z', table, '--x', table, '--out', tmp_path)
    assert not list(tmp_path.glob('*.yaml'))
    assert 'no error_model.yaml is written: z_bias changes by 0.7 m a metre' in capsys.readouterr().err
    page = (tmp_path / 'report.html').read_text(encoding='utf-8')
    assert 'No error_model.yaml is written' in page and 'The error model corrects' not in page


def test_what_was_left_out_is_listed_and_does_not_prevent_the_analysis(tmp_path, monkeypatch, capsys):
    folder = write_synthetic_session(str(tmp_path / 'session'))

    def spoil(content):
        frames = content['frames']
        frames[0]['truth_mm']['z'] /= 10
        frames[1]['rejected'] = 'not on the mark'
        del frames[2]['depth']
        os.remove(os.path.join(folder, frames[3]['depth']))
        frames[4]['label'] = 'A1'
        frames[4]['truth_mm']['z'] = 7000
        del frames[5]['truth_mm']
    change_json(folder, spoil)
    run(monkeypatch, folder, '--out', tmp_path / 'out')
    errors = capsys.readouterr().err.splitlines()
    assert [line.split(': ')[1] for line in errors] == ['frame-000', 'frame-004 (A1)']
    assert 'Z 160 mm is implausible' in errors[0]
    summary = json.loads((tmp_path / 'out' / 'summary.json').read_text())
    assert [outlier['name'] for outlier in summary['outliers']] == ['frame-000', 'frame-004 (A1)']
    assert dict(map(tuple, summary['left_out'])).keys() == {'frame-001', 'frame-002', 'frame-003', 'frame-005'}
    page = (tmp_path / 'out' / 'report.html').read_text(encoding='utf-8')
    assert 'rejected: not on the mark' in page and 'no ground truth' in page and 'Z 160 mm' in page
    assert summary['z']['max_sigma_m'] < 0.05
