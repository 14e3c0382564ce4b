"""Predictions from true positions."""
import numpy as np
import pytest

from ros_3d_bb_lab.evaluation.tracking.prediction_benchmark import predictions
from ros_3d_bb_lab.evaluation.tracking.trajectories import Sequence, pedestrian_of

PERIOD_S = 0.4


def recording(name, points_m):
    person = pedestrian_of(PERIOD_S * np.arange(len(points_m)), np.asarray(points_m, float))
    return Sequence(name, (person,), person.points_m)


def walk(steps, speed_mps=1.2, stops_at=None):
    walked_s = PERIOD_S * np.arange(steps)
    return np.c_[speed_mps * np.minimum(walked_s, np.inf if stops_at is None else stops_at), np.zeros(steps)]


def test_a_straight_walk_is_predicted_exactly_by_a_constant_velocity():
    scores = predictions([recording('straight', walk(20))])
    assert scores['straight']['cv_fde_2s_m'] == pytest.approx(0, abs=1e-9)
    assert scores['straight']['ours_fde_2s_m'] < 0.1 and scores['straight']['ours_coverage_95_2s'] == 1.0
    assert scores['mean'] == scores['straight']


def test_a_person_who_stops_is_predicted_too_far():
    """The only position with 8 steps and a known future is the last one of the walk, 2 s before the end."""
    scores = predictions([recording('stop', walk(13, stops_at=7 * PERIOD_S))])['stop']
    assert scores['cv_fde_2s_m'] == pytest.approx(1.2 * 2)
    assert 1.8 < scores['ours_fde_2s_m'] < 2.5 and scores['ours_coverage_95_2s'] == 0.0
