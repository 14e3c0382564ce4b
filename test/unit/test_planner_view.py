import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from ros_3d_bb.camera.camera_model import transform_from
from ros_3d_bb.planning.cost_grid import CELL_M, COMFORT_M, HALF_SIZE_M, HIGHEST, presence_costs
from ros_3d_bb.planning.people_removal import are_inside, cylinders_of, scan_parts
from ros_3d_bb.planning.planner_view import (covariances_after, footprint_points, in_frame, position_after,
                                             predicted_to, usable_tracks, with_usable_covariances)
from support.tracks import STEP_S, track_at


@given(st.floats(-np.pi, np.pi), st.floats(-5, 5), st.floats(-5, 5))
def test_a_change_of_frame_turns_velocity_and_covariance(yaw, x, y):
    b_from_a = transform_from((x, y, 0), (0, 0, np.sin(yaw / 2), np.cos(yaw / 2)))
    track = track_at([1, 2, 0.9], [1.5, 0, 0], covariance=np.diag([1, 4, 9, 0.1, 0.4, 0.9]))
    once, = predicted_to(in_frame([track_at([1, 2, 0.9], [1.5, 0, 0])], b_from_a), 0.4)
    again, = in_frame(predicted_to([track], 0.4), b_from_a)
    np.testing.assert_allclose(once.position_m, again.position_m, atol=1e-9)
    np.testing.assert_allclose(again.velocity_mps, [1.5 * np.cos(yaw), 1.5 * np.sin(yaw), 0], atol=1e-9)
    along = np.array([np.cos(yaw), np.sin(yaw), 0])
    assert along.dot(again.covariance[:3, :3]).dot(along) == pytest.approx(1)
    assert along.dot(again.covariance[3:, 3:]).dot(along) == pytest.approx(0.1)


def test_footprints_end_where_the_prediction_is_uncertain():
    """The standard deviation grows from 0.3 m now to 0.6 m after 0.5 s: 0.5 m after 0.33 s."""
    track = track_at([2, 0, 0.85], [1.5, 0, 0], covariance=0.3 ** 2 * np.eye(6))._replace(
        prediction_covariance_m2=np.array([std_m ** 2 * np.eye(3) for std_m in (0.45, 0.6, 0.75, 0.9, 1, 1, 1, 1)]))
    assert footprint_points([track], 0.5, 0.05)[:, 0].max() == pytest.approx(2.25 + 0.3 * 1.5)
    certain = track._replace(prediction_covariance_m2=0.3 ** 2 * np.repeat(np.eye(3)[np.newaxis], 8, axis=0))
    assert footprint_points([certain], 0.5, 0.05)[:, 0].max() == pytest.approx(2.25 + 0.5 * 1.5)


@pytest.mark.parametrize('changed', [{'position_m': np.array([np.nan, 0, 1])}, {'velocity_mps': np.full(3, np.inf)},
                                     {'size_m': np.array([0, 0, 1.7])}, {'size_m': np.array([0.5, 0.5, 10.0])},
                                     {'prediction_m': np.full((1, 3), np.nan)}, {'prediction_step_s': 0.0}])
def test_an_invalid_track_does_not_affect_the_others(changed):
    good = [track_at([number, 0, 1], [1, 0, 0], number=number) for number in (1, 2)]
    broken = track_at([0, 0, 1], [1, 0, 0], number=7)._replace(**changed)
    usable, faults = usable_tracks([good[0], broken, good[1]])
    assert [track.id for track in usable] == [1, 2] and len(faults) == 1 and 'track 7 ' in faults[0]
    assert usable_tracks(good)[1] == []
    for wrong in ({'score': np.nan}, {'score': 1.5}, {'label': 'a;b'}, {'label': u'\u9f8d'}):
        usable, faults = usable_tracks([good[0], good[1]._replace(**wrong)])
        assert usable == good[:1] and len(faults) == 1


@pytest.mark.parametrize('covariance', [np.diag([1, 1, 1, 1, 1, np.nan]), np.full((6, 6), 1e300),
                                        np.diag([1, -0.1, 1, 1, 1, 1])])
def test_a_person_whose_covariance_is_invalid_stays(covariance):
    ahead_m2 = np.tile(np.eye(3), (8, 1, 1))
    wrong = track_at([1, 0, 1], [1, 0, 0], covariance=covariance)._replace(prediction_covariance_m2=ahead_m2)
    good = wrong._replace(id=2, covariance=np.eye(6))
    tracks, faults = with_usable_covariances(usable_tracks([wrong, good, wrong._replace(covariance=None)])[0])
    assert [track.covariance is None for track in tracks] == [True, False, True] and len(faults) == 1
    assert tracks[1].prediction_covariance_m2 is ahead_m2
    assert np.isfinite(covariances_after(tracks[0], [0.0, 3.0])).all()


coordinates = st.floats(-1e6, 1e6)
speeds = st.floats(-3, 3)


@st.composite
def random_tracks(draw):
    """A person anywhere on a large map, with any prediction or none."""
    steps = draw(st.integers(0, 6))
    position_m = np.array([draw(coordinates), draw(coordinates), draw(st.floats(-2, 2))])
    ahead_m = np.array([(draw(speeds), draw(speeds), 0.0) for _step in range(steps)]).reshape(-1, 3)
    track = track_at(position_m, (draw(speeds), draw(speeds), 0), position_m + np.cumsum(ahead_m, axis=0),
                     draw(st.booleans()))
    width_m = draw(st.floats(0.1, 1.5))
    return track._replace(prediction_step_s=draw(st.floats(0.01, 2)),
                          size_m=np.array([width_m, width_m, draw(st.floats(0.5, 2.2))]))


def walked_to(track, ahead_s):
    """Where a track is some time ahead, leg by leg: apart from the code, one number at a time."""
    here, left_s = [float(value) for value in track.position_m], ahead_s
    for goal in track.prediction_m.tolist():
        share = min(left_s / track.prediction_step_s, 1.0)
        here = [start + share * (end - start) for start, end in zip(here, goal)]
        left_s = max(left_s - track.prediction_step_s, 0.0)
        if share < 1:
            return here
    return [start + left_s * speed * track.moving for start, speed in zip(here, track.velocity_mps.tolist())]


@given(random_tracks(), st.floats(0, 15))
def test_positions_ahead_are_those_of_a_walk_leg_by_leg(track, ahead_s):
    np.testing.assert_allclose(position_after(track, ahead_s), walked_to(track, ahead_s), rtol=0, atol=1e-6)


def segment_distances(points, start, end):
    along = end - start
    share = np.clip((points - start).dot(along) / max(along.dot(along), 1e-12), 0, 1)
    return np.linalg.norm(points - start - share[:, None] * along, axis=1)


@given(random_tracks(), st.floats(0, 2))
@settings(deadline=None, max_examples=50)
def test_footprints_are_on_the_way_and_within_the_body(track, ahead_s):
    """No point is farther than half a body from the way walked, or above three quarters or below one of the height."""
    points = footprint_points([track], ahead_s, 0.1)
    times_s = sorted({0.0, ahead_s} | {min(ahead_s, track.prediction_step_s * step) for step in range(1, 7)})
    way = np.array([walked_to(track, time_s) for time_s in times_s])[:, :2]
    distances = np.min([segment_distances(points[:, :2], start, end) for start, end in zip(way, way[1:])]
                       + [np.linalg.norm(points[:, :2] - way[0], axis=1)], axis=0)
    assert distances.max() <= track.size_m[0] / 2 + 1e-6
    heights = (points[:, 2] - track.position_m[2]) / track.size_m[2]
    assert heights.min() == pytest.approx(-0.25, abs=1e-6) and heights.max() == pytest.approx(0.25, abs=1e-6)
    for place in (way[0], way[-1]):
        assert np.linalg.norm(points[:, :2] - place, axis=1).max() >= track.size_m[0] / 2 - 1e-6


MARGIN_M = 0.2


def test_cylinders_are_where_people_are_then_and_wider_if_uncertain():
    walking = track_at([2, 1, 0.85], [1.0, 0, 0], covariance=np.diag([0.01, 0.04, 0, 0, 0, 0]))
    walking = walking._replace(prediction_covariance_m2=np.tile(walking.covariance[:3, :3], (8, 1, 1)))
    dog = track_at([0, 0, 0.3], [0, 0, 0])._replace(label='dog')
    (x, y, radius_m, low_m, high_m), = cylinders_of([walking, dog], 0.3, MARGIN_M)
    assert (x, y, radius_m) == pytest.approx((2.3, 1.0, 0.25 + MARGIN_M + 0.2))
    assert high_m == pytest.approx(1.7 + MARGIN_M) and -2 < low_m <= -MARGIN_M
    assert cylinders_of([], 0.3, MARGIN_M).shape == (0, 5)


@pytest.mark.parametrize('seen_from_m', [0.0, 0.5, 0.75, 1.2])
def test_a_person_whose_legs_are_hidden_from_the_camera_reaches_the_floor(seen_from_m):
    """A laser below the desk sees the legs."""
    track = track_at([2, 0, (seen_from_m + 1.7) / 2], [0, 0, 0])
    track = track._replace(size_m=np.array([0.5, 0.5, 1.7 - seen_from_m]))
    assert are_inside(np.array([[2.0, 0.1, 0.02], [2.0, 0.1, 0.2]]), cylinders_of([track], 0.0, MARGIN_M)).all()


@pytest.mark.parametrize('count, increment_s, expected', [
    (10, 0.005, [(0, 4, 0.0075), (4, 8, 0.0275), (8, 12, 0.0425)]), (3, 0.1, [(0, 1, 0.0), (1, 2, 0.1), (2, 3, 0.2)])])
def test_a_scan_is_divided_into_parts_of_nearly_the_same_time(count, increment_s, expected):
    parts = [(part.start, part.stop, pytest.approx(later_s)) for part, later_s in scan_parts(count, increment_s)]
    assert parts == expected


@pytest.mark.parametrize('count, increment_s', [(0, 0.01), (5, 0.0), (5, -0.1), (5, np.nan), (5, np.inf), (500, 0.1)])
def test_a_scan_without_plausible_times_is_one_part(count, increment_s):
    assert scan_parts(count, increment_s) == [(slice(None), 0.0)]


WIDTH_M = 0.5
RADIUS_M = WIDTH_M / 2 + COMFORT_M
ROBOT_RADIUS_M = 0.35


def walking(position_m, velocity_mps, stds_m=(0.0, 0.0)):
    """A track whose standard deviation grows linearly from now to the end of the prediction of 2 s."""
    covariances_m2 = np.interp(STEP_S * np.arange(9), (0, 2), stds_m)[:, np.newaxis, np.newaxis] ** 2 * np.eye(3)
    covariance = np.zeros((6, 6))
    covariance[:3, :3] = covariances_m2[0]
    return track_at(position_m + (0.85,), velocity_mps + (0.0,), covariance=covariance)._replace(
        prediction_covariance_m2=covariances_m2[1:])


def cost_at(costs, x_m, y_m):
    row, column = (int((part + HALF_SIZE_M) // CELL_M) for part in (y_m, x_m))
    return costs[row, column]


def test_certain_predictions_cost_most_along_the_way_and_nothing_beside():
    costs = presence_costs([walking((1.0, -2.0), (0.0, 1.5))], np.eye(4), ROBOT_RADIUS_M)
    assert costs.dtype == np.int8 and costs.shape == (100, 100)
    for y_m in np.arange(-1.95, 1.0, 0.1):
        assert cost_at(costs, 1.0, y_m) == HIGHEST
        assert cost_at(costs, 1.0 + 2 * RADIUS_M, y_m) == cost_at(costs, 1.0 - 2 * RADIUS_M, y_m) == 0
    assert cost_at(costs, 1.0, 1.0 + 2 * RADIUS_M) == cost_at(costs, 1.0, -2.0 - 2 * RADIUS_M) == 0


def test_a_robot_in_the_way_pays_only_for_going_further_into_it():
    """A person comes towards the robot from ahead; the probability decreases to the sides."""
    tracks = [walking((2.0, 0.3), (-1.0, 0.0), (0.1, 0.5))]
    costs = presence_costs(tracks, np.eye(4), ROBOT_RADIUS_M)
    assert cost_at(costs, 0.0, 0.0) == cost_at(costs, 0.0, -1.0) == cost_at(costs, 0.0, 1.0) == 0
    assert cost_at(costs, 1.0, 0.3) == HIGHEST
    behind = walking((-0.6, 0.0), (0.8, 0.0), (0.1, 0.5))  # does not hide the costs of the other person
    assert cost_at(presence_costs(tracks + [behind], np.eye(4), ROBOT_RADIUS_M), 1.0, 0.3) == HIGHEST
    two_m_beside = presence_costs(tracks, transform_from((0, 2, 0), (0, 0, 0, 1)), ROBOT_RADIUS_M)
    assert cost_at(two_m_beside, 0.0, 2.0) > HIGHEST / 2 and cost_at(two_m_beside, 1.0, 2.3) == HIGHEST
