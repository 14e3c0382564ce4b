"""Scores of costmaps of one person whose marks are known."""
import numpy as np
import pytest

from ros_3d_bb_lab.evaluation.costmap.costmap_score import Costmap, Sighting, score_costmaps

RESOLUTION_M = 0.05
TURNED = np.array([[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 0], [0, 0, 0, 1]], float)  # map_from_costmap


def costmap(time_s, *discs):
    """A costmap around the origin of its frame, which is turned in the map; discs (x, y, radius) of the map are lethal.
    """
    axis_m = (np.arange(400) + 0.5) * RESOLUTION_M - 10
    x, y = np.meshgrid(axis_m, axis_m)
    in_map_x, in_map_y = 1 - y, 2 + x
    lethal = np.zeros((400, 400), bool)
    for disc_x, disc_y, radius_m in discs:
        lethal |= np.hypot(in_map_x - disc_x, in_map_y - disc_y) < radius_m
    return Costmap(time_s, lethal, np.array([-10.0, -10.0]), RESOLUTION_M, TURNED)


def walking(time_s):
    """1 m/s along x."""
    return np.array([[time_s, 0.0]])


def seen(times_s):
    return [Sighting(time_s, np.array([True]), walking(time_s)) for time_s in times_s]


TIMES_S = np.arange(0, 5, 0.1)


def test_a_costmap_that_follows_the_person_is_perfect():
    result = score_costmaps([costmap(time_s, (time_s, 0, 0.3)) for time_s in TIMES_S], seen(TIMES_S), walking)
    assert (result['recall'], result['false_cells']) == (1.0, 0.0) and result['trail_p95_s'] <= 0.1
    assert 46 <= result['people'] <= 47 and result['trails'] > 30


def test_a_costmap_that_lags_leaves_a_trail():
    result = score_costmaps([costmap(time_s, (time_s - 0.5, 0, 0.6)) for time_s in TIMES_S], seen(TIMES_S), walking)
    assert result['trail_p95_s'] == pytest.approx(0.8, abs=0.11)


def test_marks_far_from_the_person_now_and_soon_are_false():
    ahead = [costmap(time_s, (time_s + 1.0, 0, 0.3)) for time_s in TIMES_S]
    beside = [costmap(time_s, (time_s, 0, 0.3), (time_s, 3.0, 0.3)) for time_s in TIMES_S]
    assert score_costmaps(ahead, seen(TIMES_S), walking)['false_cells'] == 0
    assert score_costmaps(ahead, seen(TIMES_S), walking)['recall'] == 0
    assert score_costmaps(beside, seen(TIMES_S), walking)['false_cells'] == pytest.approx(0.5, abs=0.02)
