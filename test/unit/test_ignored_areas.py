import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ros_3d_bb.tracking.ignored_areas import OccupiedCells, polygons_from
from ros_3d_bb.tracking.measurement_model import NoiseParams
from ros_3d_bb.tracking.track import PredictionParams
from ros_3d_bb.tracking.tracker import Tracker, TrackerParams
from support.people import at, ids, play, standing

SQUARE = '[[[3, -0.5], [4, -0.5], [4, 0.5], [3, 0.5]]]'


def ids_among(tracker, start_s, seconds, *places):
    """IDs of the tracks in each image, 10 times per second, of people who stand at places (x, y)."""
    return list(map(ids, play(tracker, seconds, standing(*places), 10, start_s)))


def test_no_track_starts_in_a_polygon_and_others_do():
    assert ids_among(Tracker(TrackerParams(ignored_areas=SQUARE)), 1, 2, (3.5, 0.2), (3.5, 0.8))[-1] == [1]
    assert ids_among(Tracker(), 1, 2, (3.5, 0.2), (3.5, 0.8))[-1] == [1, 2]


def test_a_tracked_person_who_walks_through_keeps_the_id():
    found = play(Tracker(TrackerParams(ignored_areas=SQUARE)), 4, lambda time_s: [at(3.5, 1.8 - 0.9 * time_s)], 10)
    assert list(map(ids, found[8:])) == [[1]] * 32


def test_a_new_area_ends_the_tracks_in_it_and_keeps_the_others():
    tracker = Tracker()
    assert ids_among(tracker, 1, 2, (3.5, 0.2), (3.5, 1.2))[-1] == [1, 2]
    tracker.reconfigure(TrackerParams(acceleration=0.1), NoiseParams(), PredictionParams())
    assert ids_among(tracker, 3, 1, (3.5, 0.2), (3.5, 1.2))[-1] == [1, 2]
    tracker.reconfigure(TrackerParams(ignored_areas=SQUARE), NoiseParams(), PredictionParams())
    assert ids_among(tracker, 4, 1, (3.5, 0.2), (3.5, 1.2)) == [[2]] * 10


def test_the_first_map_ends_the_tracks_on_it_and_later_ones_do_not():
    tracker, wall = Tracker(), np.ones((10, 10), bool)
    assert ids_among(tracker, 1, 2, (3.5, 0.2))[-1] == [1]
    tracker.set_map(OccupiedCells(~wall, 0.1, (3.0, 0.0, 0.0)))
    tracker.set_map(OccupiedCells(wall, 0.1, (3.0, 0.0, 0.0)))
    assert ids_among(tracker, 3, 1, (3.5, 0.2))[-1] == [1]
    tracker = Tracker()
    ids_among(tracker, 1, 2, (3.5, 0.2))
    tracker.set_map(OccupiedCells(wall, 0.1, (3.0, 0.0, 0.0)))
    assert ids_among(tracker, 3, 1, (3.5, 0.2))[-1] == []


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
def test_other_texts_are_rejected_without_a_change(text):
    tracker = Tracker(TrackerParams(ignored_areas=SQUARE))
    with pytest.raises(ValueError, match='ignored_areas'):
        tracker.reconfigure(TrackerParams(ignored_areas=text), NoiseParams(), PredictionParams())
    assert len(tracker.ignored.polygons) == 1 and polygons_from('') == []
