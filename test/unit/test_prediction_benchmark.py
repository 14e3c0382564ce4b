"""The benchmark of predictions by kind of motion."""
import json

import numpy as np

from ros_3d_bb_lab.evaluation import __main__ as command

TIMES_S = np.arange(0, 6, 0.02)
WALK_M = np.column_stack((1.2 * TIMES_S, np.zeros(len(TIMES_S))))


def test_the_command_writes_scores_by_kind(tmp_path):
    (tmp_path / 'walking').mkdir()
    lines = ['%d,%g,%g,%g' % ((row, time_s) + tuple(point_m)) for row, (time_s, point_m)
             in enumerate(zip(TIMES_S, WALK_M))]
    (tmp_path / 'walking' / '1.csv').write_text('\n'.join([',timestamp,x,y'] + lines))
    command.main(['prediction', '--data', str(tmp_path), '--json', str(tmp_path / 'scores.json')])
    scores = json.loads((tmp_path / 'scores.json').read_text())['walking']
    assert {'coverage_95_2s', 'ours_fde_2s_m', 'cv_fde_2s_m', 'area_95_2s_m2'} <= set(scores)
    assert set(scores['rates']) == {'30', '15', '10', '5', '3'}
    assert scores['rates']['10']['true']['ours_fde_2s_m'] == scores['ours_fde_2s_m'] < 0.1
    assert scores['rates']['10']['noise_5cm']['ours_fde_2s_m'] > scores['ours_fde_2s_m']
