"""The benchmark of predictions by kind of motion."""
import json

import numpy as np
import pytest

from ros_3d_bb_lab.evaluation import __main__ as command
from ros_3d_bb_lab.evaluation.tracking.prediction_benchmark import scores_of

TIMES_S = np.arange(0, 6, 0.02)


def clip_of(x_m, y_m):
    return TIMES_S, np.column_stack((np.broadcast_to(x_m, TIMES_S.shape), np.broadcast_to(y_m, TIMES_S.shape)))


WALK = clip_of(1.2 * TIMES_S, 1.0)
STOP = clip_of(1.2 * np.minimum(TIMES_S, 2.5), 0.0)


@pytest.mark.parametrize('rate_hz', [3, 10])
def test_people_who_walk_on_are_predicted_at_any_rate(rate_hz):
    scores = scores_of([WALK], rate_hz)
    assert scores['cv_fde_2s_m'] == pytest.approx(0, abs=1e-6)
    assert scores['ours_fde_2s_m'] < 0.1 and scores['coverage_95_2s'] == scores['plain_coverage_95_2s'] == 1


def test_people_who_stop_are_harder_to_predict():
    walk, stop = (scores_of([clip], 10) for clip in (WALK, STOP))
    for key in ('ours_fde_2s_m', 'plain_fde_2s_m', 'cv_fde_2s_m'):
        assert stop[key] > walk[key] + 0.3
    assert stop['coverage_95_2s'] < 1


def test_noise_is_reproducible():
    noisy = [scores_of([WALK], 5, 0.05, seed) for seed in (1, 1, 2)]
    assert noisy[0] == noisy[1] != noisy[2] and noisy[0]['cv_fde_2s_m'] > 0.1


def test_clips_that_are_too_short_have_no_scores():
    assert set(scores_of([(TIMES_S[:60], WALK[1][:60])], 10).values()) == {None}


def test_the_command_writes_scores_by_kind(tmp_path):
    (tmp_path / 'walking').mkdir()
    lines = ['%d,%g,%g,%g' % ((row, time_s) + tuple(point_m)) for row, (time_s, point_m)
             in enumerate(zip(*WALK))]
    (tmp_path / 'walking' / '1.csv').write_text('\n'.join([',timestamp,x,y'] + lines))
    command.main(['prediction', '--data', str(tmp_path), '--json', str(tmp_path / 'scores.json')])
    scores = json.loads((tmp_path / 'scores.json').read_text())['walking']
    assert {'coverage_95_2s', 'ours_fde_2s_m', 'cv_fde_2s_m', 'area_95_2s_m2'} <= set(scores)
    assert set(scores['rates']) == {'30', '15', '10', '5', '3'}
    assert scores['rates']['10']['true']['ours_fde_2s_m'] == scores['ours_fde_2s_m'] < 0.1
    assert scores['rates']['10']['noise_5cm']['ours_fde_2s_m'] > scores['ours_fde_2s_m']


@pytest.mark.parametrize('text,message', [(None, 'no folder with .csv files'), ('t,x,y\n0,0,0', 'timestamp'),
                                          ('timestamp,x,y\n0,0,0', 'increasing timestamp'),
                                          ('timestamp,x,y\n0,a,0', 'line 2: 0,a,0; a number')])
def test_unusable_data_is_named(tmp_path, text, message):
    if text is not None:
        (tmp_path / 'walking').mkdir()
        (tmp_path / 'walking' / '1.csv').write_text(text)
    with pytest.raises(SystemExit, match=message):
        command.main(['prediction', '--data', str(tmp_path)])


def test_the_command_needs_data(monkeypatch):
    monkeypatch.delenv('ROS_3D_BB_DATA', raising=False)
    with pytest.raises(SystemExit, match='--data DIR or ROS_3D_BB_DATA expected'):
        command.main(['prediction'])
