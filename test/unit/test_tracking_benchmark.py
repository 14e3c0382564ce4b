import json

import numpy as np
import pytest

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb_lab.evaluation import __main__ as command
from ros_3d_bb_lab.evaluation.baselines.original_tracker import OriginalTracker
from ros_3d_bb_lab.evaluation.tracking.robot_motion import DRIVING
from ros_3d_bb_lab.evaluation.tracking.run_generator import simulate
from ros_3d_bb_lab.evaluation.tracking.trajectories import made_sequences
from support.people import at

KEYS = {'hota', 'mota', 'idf1', 'id_switches', 'fragmentations', 'position_rmse_m', 'velocity_rmse_mps', 'ade_1s_m',
        'fde_1s_m', 'ade_2s_m', 'fde_2s_m', 'coverage_95_position', 'coverage_95_velocity', 'coverage_95_1s',
        'coverage_95_2s'}


def test_the_velocity_of_the_original_is_a_step_times_the_rate():
    tracker = OriginalTracker()
    tracker.update(NS, [at(1.0, 0.0)])
    person, = tracker.update(NS + NS // 100, [at(1.1, 0.0)])  # 10 ms later
    assert person.velocity_mps[0] == pytest.approx(0.2 * 10)
    assert person.prediction_m[-1, 0] == pytest.approx(1.1 + 2 * 2)


def test_the_same_seed_gives_the_same_run_and_another_one_another():
    sequence = made_sequences(0, 30)[1]
    first, again, other = (simulate(sequence, DRIVING, seed, seconds=1) for seed in ((3, 0), (3, 0), (3, 1)))
    assert len(first.images) == len(again.images)
    for image, same in zip(first.images, again.images):
        assert image.stamp_ns == same.stamp_ns and len(image.detections) == len(same.detections)
        assert all(np.array_equal(a.position_m, b.position_m) for a, b in zip(image.detections, same.detections))
    assert first.images[0].stamp_ns != other.images[0].stamp_ns


@pytest.mark.slow
@pytest.mark.needs('norfair', 'trackeval')
def test_the_command_writes_settings_and_scores(monkeypatch, tmp_path, capsys):
    monkeypatch.delenv('ROS_3D_BB_DATA', raising=False)
    path = tmp_path / 'scores.json'
    command.main(['tracking', '--seed', '5', '--seconds', '2', '--repetitions', '1', '--json', str(path)])
    result = json.loads(path.read_text())
    assert result['sequences'] == ['made_sparse', 'made_dense'] and result['seed'] == 5 and not result['recorded']
    assert result['command'].startswith('./run bench tracking --seed 5 ')
    assert {'ours', 'thesis', 'library'} <= set(result['trackers'])
    for name, scores in result['trackers'].items():
        assert KEYS <= set(scores)
        for key in ('coverage_95_position', 'coverage_95_velocity', 'coverage_95_1s', 'coverage_95_2s'):
            assert (scores[key] is None) == (name != 'ours')
    assert 'made_dense_driving' in capsys.readouterr().out
