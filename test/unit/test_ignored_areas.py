import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ros_3d_bb.tracking.ignored_areas import IgnoredAreas, OccupiedCells, polygons_from
from ros_3d_bb.tracking.tracker import Tracker
from support.people import at, ids, play, standing

SQUARE = '[[[3, -0.5], [4, -0.5], [4, 0.5], [3, 0.5]]]'


AREAS = IgnoredAreas(polygons_from(SQUARE))


def marked(*places):
    return [at(*place, is_ignored=AREAS.contains(place, (0, 0))) for place in places]


def test_no_track_starts_in_a_polygon_and_others_do():
    found = play(Tracker(), 2, lambda _time_s: marked((3.5, 0.2), (3.5, 0.8)), 10)
    assert ids(found[-1]) == [1] and found[-1][0].position_m[1] > 0.5


def test_a_tracked_person_who_walks_through_keeps_the_id():
    found = play(Tracker(), 4, lambda time_s: marked((3.5, 1.8 - 0.9 * time_s)), 10)
    assert list(map(ids, found[8:])) == [[1]] * 32


def test_deleted_tracks_do_not_come_back_and_others_keep_their_ids():
    tracker = Tracker()
    play(tracker, 2, standing((3.5, 0.2), (3.5, 1.2)), 10)
    tracker.delete_at(lambda place: AREAS.contains(place, (0, 0)))
    assert list(map(ids, play(tracker, 1, lambda _time_s: marked((3.5, 0.2), (3.5, 1.2)), 10, 2))) == [[2]] * 10


@given(st.floats(-3, 3), st.floats(-5, 5), st.floats(-5, 5), st.integers(0, 11), st.integers(0, 7))
def test_cells_are_found_in_maps_of_any_pose(yaw, x, y, column, row):
    cells = np.zeros((8, 12), bool)
    cells[row, column] = True
    local_m = 0.2 * (np.array([column, row]) + 0.5)
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    center_m = turn.dot(local_m) + (x, y)
    occupied = OccupiedCells(cells, 0.2, (x, y, yaw))
    beside_m = center_m + 0.21 * turn[:, 0]
    assert occupied.at([center_m, beside_m, center_m - 10 * turn[:, 1]]).tolist() == [True, False, False]


@pytest.mark.parametrize('text', ['[[1, 2]]', '[[[1, 2], [3, 4]]]', 'a', '[[[1, 2], [3, 4], [5, NaN]]]', '{}1', '3',
                                  '[[[1, 2, 3], [4, 5, 6], [7, 8, 9]]]', '[[[1, 2], [3, 4], [5]]]'])
def test_other_texts_are_rejected(text):
    with pytest.raises(ValueError, match='ignored_areas'):
        polygons_from(text)
    assert polygons_from('') == []
