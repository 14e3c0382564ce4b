import json
import os

import numpy as np
import pytest
import yaml

from conftest import DATA
from ros_3d_bb.estimation.box3d_estimator import estimator_named
from ros_3d_bb.sessions.session_reader import read_session
from ros_3d_bb_lab.evaluation import __main__ as command
from ros_3d_bb_lab.evaluation.accuracy import Estimates, compare, scores_of, with_detected_boxes
from ros_3d_bb_lab.evaluation.defaults import scenario_path
from ros_3d_bb_lab.evaluation.simulated_session import write_simulated_session

REAL_WEIGHTS = pytest.mark.needs(*['torch'] * bool(DATA))
PLACES = np.repeat([(0.0, 1.0), (0.5, 2.0), (-1.0, 3.0)], 4, axis=0)


def test_scores_are_those_of_the_errors():
    """Positions at PLACES, shifted, with a spread of 0.02 m in z within each place."""
    position_m = np.c_[PLACES[:, 0], np.zeros(len(PLACES)), PLACES[:, 1]] + (0.1, 0, 0.05)
    position_m[:, 2] += np.tile([-0.02, 0.02, -0.02, 0.02], 3)
    scores = scores_of(Estimates(position_m, position_m, None), PLACES, PLACES[:, 0] < 0)
    assert scores['rmse_x_m'] == pytest.approx(0.1) == scores['rmse_x_truncated_m']
    assert scores['bias_z_m'] == pytest.approx(0.05) and scores['bias_x_m'] == pytest.approx(0.1)
    assert scores['rmse_z_m'] == pytest.approx(np.sqrt(0.05 ** 2 + 0.02 ** 2))
    assert scores['rmse_plane_m'] == pytest.approx(np.hypot(scores['rmse_x_m'], scores['rmse_z_m']))
    assert scores['repeatability_z_m'] == pytest.approx(0.02) and scores['repeatability_x_m'] == pytest.approx(0)
    assert scores['p95_plane_m'] == pytest.approx(np.hypot(0.1, 0.07))
    assert scores['missed'] == 0 and scores['coverage_95'] is None


@pytest.fixture(scope='module')
def result(tmp_path_factory):
    """Result for the real measurements with YOLOv5n's boxes, or for a simulated session with exact boxes."""
    if DATA:
        session = read_session(os.path.join(DATA, 'data', 'thesis'))
        session = with_detected_boxes(session, os.path.join(DATA, 'weights', 'yolov5n.pt'))
    else:
        folder = str(tmp_path_factory.mktemp('session'))
        session = read_session(write_simulated_session(folder, (1.5, 2.5, 3.5), (-0.3, 0.0, 0.3), 4))
    return compare(session, estimator_named('foreground'))[0]


@pytest.mark.slow
@REAL_WEIGHTS
def test_positions_are_accurate(result):
    """Leave-one-position-out; the limits for the simulation are wider than those for the real measurements."""
    ours, thesis = result['ours'], result['thesis']
    assert ours['rmse_plane_m'] <= (0.042 if DATA else 0.08) and ours['p95_plane_m'] <= (0.08 if DATA else 0.15)
    assert ours['rmse_plane_m'] < 0.7 * thesis['rmse_plane_m']
    assert ours['repeatability_z_m'] < 0.6 * thesis['repeatability_z_m']
    assert 0.92 <= ours['coverage_95'] <= (0.98 if DATA else 1.0)
    if DATA:
        assert ours['rmse_x_truncated_m'] <= 0.045 and ours['missed'] <= 3


@pytest.fixture(scope='module')
def simulated(tmp_path_factory):
    return write_simulated_session(str(tmp_path_factory.mktemp('simulated')), (1.5, 2.5, 3.5), (-0.3, 0.0, 0.3), 1)


@pytest.mark.slow
@pytest.mark.parametrize('words, keys', [
    (['speed', '--images', '1'], {'ours', 'thesis', 'ratio'}), (['accuracy'], {'ours', 'thesis', 'recorded'}),
    (['detector'], {'detectors'})])
def test_the_commands_write_their_results(simulated, tmp_path, words, keys):
    path = tmp_path / 'result.json'
    command.main(words + ['--data', simulated, '--json', str(path)])
    assert keys <= set(json.loads(path.read_text()))


@pytest.mark.slow
def test_a_scene_is_scored_with_each_detector(tmp_path):
    with open(scenario_path('empty_room')) as stream:
        scene = dict(yaml.safe_load(stream), duration=0.4, room={}, people=[{'start': [4.0, 0.3]}])
    (tmp_path / 'scene.yaml').write_text(yaml.safe_dump(scene))
    command.main(['scenes', str(tmp_path / 'scene.yaml'), '--json', str(tmp_path / 'result.json')])
    rows = json.loads((tmp_path / 'result.json').read_text())['scenes']
    assert [(row['detector'], row['recall']) for row in rows] == [('depth', 1), ('exact', 1)]
