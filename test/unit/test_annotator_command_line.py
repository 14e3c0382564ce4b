"""Annotator on the command line: export, analysis and validation without a window, Qt and ROS."""
import json
import os

import pytest

from ros_3d_bb.estimation.error_model import read_error_model
from ros_3d_bb_annotator.command_line import main
from support.small_session import change_json, write_small_session
from support.synthetic_session import write_synthetic_session


@pytest.fixture
def folder(tmp_path):
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


@pytest.mark.parametrize('break_it,problem', [
    (lambda entry: entry['detections'][0].update(box=[10, 4, 26, 49]), 'box (10, 4, 26, 49) is not inside the image'),
    (lambda entry: entry['detections'][1].update(box=[26, 4, 10, 44]), 'is not inside the image'),
    (lambda entry: entry.update(truth_mm={'x': -466.5, 'z': 3600}), 'is implausible'),
    (lambda entry: entry.update(truth_mm={'x': 2000, 'z': 2000}), 'outside the image'),
    (lambda entry: entry.update(truth_mm={'x': 0, 'z': -2000}), 'truth z is -2 m'),
    (lambda entry: entry.update(detections=[]), 'nobody was found')])
def test_problems_are_listed(folder, capsys, break_it, problem):
    change_json(folder, lambda content: break_it(content['frames'][1]))
    assert main(['--validate', folder]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith('m1: ') and problem in '\n'.join(lines)
    assert lines[-1].endswith((' 1 problem', ' 2 problems'))


def test_a_session_without_problems_is_valid(folder, capsys):
    assert main(['--validate', folder]) == 0
    assert ', 0 problems' in capsys.readouterr().out


@pytest.mark.parametrize('arguments', [['--validate'], ['--export', 'a.csv'], ['--analyse', '--validate', 'x'],
                                       ['--out', 'x', 'y'], ['--analyse', 'x', '--estimator', 'mean']])
def test_incompatible_arguments_are_rejected(arguments, capsys):
    with pytest.raises(SystemExit) as error:
        main(arguments)
    assert error.value.code == 2 and 'usage: annotator' in capsys.readouterr().err
