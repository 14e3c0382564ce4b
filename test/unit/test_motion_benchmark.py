"""The benchmark of predictions by kind of motion."""
import json
import sys

import numpy as np

from ros_3d_bb_lab.evaluation.tracking import motion_benchmark
from ros_3d_bb_lab.evaluation.tracking.motion_benchmark import Clip

TIMES_S = np.arange(0, 6, 0.02)
WALK, STOP = (Clip(TIMES_S, np.column_stack((1.2 * walking_s, np.zeros(len(TIMES_S)))))
              for walking_s in (TIMES_S, np.minimum(TIMES_S, 2.5)))


def run_command(monkeypatch, *arguments):
    monkeypatch.setattr(sys, 'argv', ['./run bench prediction'] + list(arguments))
    monkeypatch.delenv('ROS_3D_BB_DATA', raising=False)
    motion_benchmark.main()


def test_the_command_writes_scores_by_kind(monkeypatch, tmp_path):
    (tmp_path / 'walking').mkdir()
    lines = ['%d,%g,%g,%g' % ((row, time_s) + tuple(point_m)) for row, (time_s, point_m)
             in enumerate(zip(*WALK))]
    (tmp_path / 'walking' / '1.csv').write_text('\n'.join([',timestamp,x,y'] + lines))
    run_command(monkeypatch, '--data', str(tmp_path), '--json', str(tmp_path / 'scores.json'))
    scores = json.loads((tmp_path / 'scores.json').read_text())['walking']
    assert {'coverage_95_2s', 'ours_fde_2s_m', 'cv_fde_2s_m', 'area_95_2s_m2'} <= set(scores)
    assert set(scores['rates']) == {'30', '15', '10', '5', '3'}
    assert scores['rates']['10']['true']['ours_fde_2s_m'] == scores['ours_fde_2s_m'] < 0.1
    assert scores['rates']['10']['noise_5cm']['ours_fde_2s_m'] > scores['ours_fde_2s_m']
