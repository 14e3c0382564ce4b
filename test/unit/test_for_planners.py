"""Where people are now, in which frame, and what ground they take up; all against places known beforehand."""
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ros_3d_bb.geometry import transform_from
from ros_3d_bb.tracking.for_planners import (check_tracks, disc_points, footprint_points, in_frame, position_after,
                                             predicted_to, ring_points)
from ros_3d_bb.tracking.tracked import VISIBLE, TrackedObject

STEP_S = 0.25


def track_at(position_m, velocity_mps, prediction_m=None, moving=True, covariance=None, number=1):
    """A track whose prediction is straight ahead for 2 s, where none is given."""
    position_m, velocity_mps = np.array(position_m, float), np.array(velocity_mps, float)
    if prediction_m is None:
        prediction_m = position_m + np.outer(STEP_S * np.arange(1, 9), velocity_mps)
    return TrackedObject(number, position_m, np.array([0.5, 0.5, 1.7]), velocity_mps, velocity_mps, VISIBLE, moving, 0,
                         0, np.reshape(prediction_m, (-1, 3)), STEP_S, covariance)


@given(st.floats(0, 10), st.floats(-2, 2), st.floats(-2, 2))
def test_who_walks_straight_is_where_the_velocity_leads_before_and_beyond_the_last_prediction(ahead_s, vx, vy):
    track = track_at([1, 2, 0.9], [vx, vy, 0])
    np.testing.assert_allclose(position_after(track, ahead_s), [1 + vx * ahead_s, 2 + vy * ahead_s, 0.9], atol=1e-9)
    without = track_at([1, 2, 0.9], [vx, vy, 0], np.empty((0, 3)))
    np.testing.assert_allclose(position_after(without, ahead_s), position_after(track, ahead_s), atol=1e-9)


def test_the_prediction_of_the_tracker_is_followed_round_a_bend():
    track = track_at([0, 0, 1], [1, 0, 0], [[0.25, 0, 1], [0.25, 0.25, 1]])
    np.testing.assert_allclose(position_after(track, [0, 0.125, 0.25, 0.375, 0.5]),
                               [[0, 0, 1], [0.125, 0, 1], [0.25, 0, 1], [0.25, 0.125, 1], [0.25, 0.25, 1]])


def test_people_who_stand_have_no_velocity_for_planners():
    stands, walks = predicted_to([track_at([0, 0, 1], [0.1, 0, 0], moving=False), track_at([0, 0, 1], [1, 0, 0])], 0.2)
    assert not stands.velocity_mps.any() and stands.position_m[0] == pytest.approx(0.02)
    assert walks.velocity_mps[0] == 1 and walks.position_m[0] == pytest.approx(0.2)


@given(st.floats(-np.pi, np.pi), st.floats(-5, 5), st.floats(-5, 5))
def test_a_change_of_frame_turns_velocity_and_covariance_and_goes_before_or_after_the_prediction(yaw, x, y):
    b_from_a = transform_from((x, y, 0), (0, 0, np.sin(yaw / 2), np.cos(yaw / 2)))
    track = track_at([1, 2, 0.9], [1.5, 0, 0], covariance=np.diag([1, 4, 9, 0.1, 0.4, 0.9]))
    once, = predicted_to(in_frame([track_at([1, 2, 0.9], [1.5, 0, 0])], b_from_a), 0.4)
    again, = in_frame(predicted_to([track], 0.4), b_from_a)
    np.testing.assert_allclose(once.position_m, again.position_m, atol=1e-9)
    np.testing.assert_allclose(again.velocity_mps, [1.5 * np.cos(yaw), 1.5 * np.sin(yaw), 0], atol=1e-9)
    along = np.array([np.cos(yaw), np.sin(yaw), 0])
    assert along.dot(again.covariance[:3, :3]).dot(along) == pytest.approx(1)
    assert along.dot(again.covariance[3:, 3:]).dot(along) == pytest.approx(0.1)


def test_footprints_fill_the_cylinder_and_the_ground_ahead_without_gaps():
    """1.5 m/s along x for 1 s: a strip of 0.5 m width, 1.5 m longer than the body."""
    points = footprint_points([track_at([2, 0, 0.85], [1.5, 0, 0])], 1.0, 0.05)
    assert points[:, 0].min() == pytest.approx(1.75) and points[:, 0].max() == pytest.approx(3.75)
    assert np.abs(points[:, 1]).max() == pytest.approx(0.25, abs=0.002)
    assert sorted(set(np.round(points[:, 2], 3))) == [0.425, 0.85, 1.275]
    strip = np.stack(np.meshgrid(np.arange(1.9, 3.6, 0.02), np.arange(-0.2, 0.2, 0.02)), axis=-1).reshape(-1, 1, 2)
    assert np.linalg.norm(strip - points[np.newaxis, :, :2], axis=-1).min(axis=1).max() < 0.05


def test_without_prediction_only_the_cylinder_is_there_and_nobody_has_no_points():
    points = footprint_points([track_at([2, 0, 0.85], [1.5, 0, 0])], 0.0, 0.05)
    assert np.linalg.norm(points[:, :2] - [2, 0], axis=1).max() == pytest.approx(0.25)
    assert footprint_points([], 1.0, 0.05).shape == (0, 3)


@given(st.floats(0.02, 3), st.floats(0.01, 0.5))
def test_a_disc_has_its_outline_and_nothing_outside(radius_m, spacing_m):
    disc, ring = disc_points(radius_m, spacing_m), ring_points(radius_m, spacing_m)
    assert np.linalg.norm(disc, axis=1).max() == pytest.approx(radius_m)
    assert np.linalg.norm(ring, axis=1) == pytest.approx(radius_m)
    assert (np.linalg.norm(ring - np.roll(ring, 1, axis=0), axis=1) <= spacing_m + 1e-9).all()


@pytest.mark.parametrize('changed', [{'position_m': np.array([np.nan, 0, 1])}, {'velocity_mps': np.full(3, np.inf)},
                                     {'size_m': np.array([0, 0, 1.7])}, {'prediction_m': np.full((1, 3), np.nan)},
                                     {'prediction_step_s': 0.0}])
def test_tracks_that_no_planner_should_see_are_named(changed):
    check_tracks([track_at([0, 0, 1], [1, 0, 0])])
    with pytest.raises(ValueError, match='track 7 has p'):
        check_tracks([track_at([0, 0, 1], [1, 0, 0], number=7)._replace(**changed)])


STANDS = track_at([3, 0, 0.85], [0.19, 0, 0], np.empty((0, 3)), moving=False)  # 0.19 m/s: noise of one who stands


@given(st.floats(0, 10))
def test_who_stands_stays_where_nothing_is_predicted(ahead_s):
    assert (position_after(STANDS, ahead_s) == [3, 0, 0.85]).all()
    later, = predicted_to([STANDS], ahead_s)
    assert (later.position_m == [3, 0, 0.85]).all() and not later.velocity_mps.any()
    beyond = STANDS._replace(prediction_m=np.array([[3.02, 0, 0.85]]))
    assert position_after(beyond, STEP_S + ahead_s)[0] == pytest.approx(3.02, abs=1e-12)


def test_who_stands_covers_no_ground_ahead():
    assert footprint_points([STANDS], 0.5, 0.05)[:, 0].max() == pytest.approx(3.25)
    walks = STANDS._replace(moving=True)
    assert footprint_points([walks], 0.5, 0.05)[:, 0].max() == pytest.approx(3.25 + 0.5 * 0.19)
