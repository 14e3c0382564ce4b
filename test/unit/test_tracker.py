import doctest
import functools

import numpy as np
import pytest

from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking import tracker as tracker_module
from ros_3d_bb.tracking.measurement_model import NoiseParams
from ros_3d_bb.tracking.occlusion import depths_towards
from ros_3d_bb.tracking.prediction import PredictionParams
from ros_3d_bb.tracking.tracker import Tracker, TrackerParams
from ros_3d_bb.tracking.types import OCCLUDED, OUT_OF_VIEW, VISIBLE
from support.people import CAMERA, START_NS, VIEW, all_ids, at, ids, mounted, noisy, play, standing, view_from


def test_the_example_in_the_docstring_works():
    assert doctest.testmod(tracker_module) == (0, 7)


@pytest.mark.parametrize('speed_mps', [0, 1.6])
@pytest.mark.parametrize('rate_hz', [3, 4, 5, 10, 20, 30, 60])
def test_tracks_begin_and_end_after_the_same_time_at_any_rate(rate_hz, speed_mps):
    """Boxes without a score, of a person who stands or comes nearer. Below 15 Hz, the second one confirms the track.
    """
    walk = play(Tracker(), 4, lambda time_s: [at(6 - speed_mps * time_s, 0)] if time_s < 2 else [], rate_hz)
    published_s = [number / rate_hz for number, objects in enumerate(walk) if objects]
    assert 0.06 <= published_s[0] <= max(0.11, 1.01 / rate_hz)
    assert 2.15 <= published_s[-1] <= max(2.45, 2 + 2.01 / rate_hz)
    assert len(published_s) == round((published_s[-1] - published_s[0]) * rate_hz) + 1


@pytest.mark.parametrize('score,first,later', [
    (0.95, 2, 2), (0.5, 2, 2), (0.35, 2, 5), (0.1, None, None), (0.02, None, None)])
def test_the_score_decides_when_a_track_is_published(score, first, later):
    """Of people in the first image of the camera, and of those who come into view later."""
    for arrival_s, images in ((0, first), (1, later)):
        published = [len(objects) for objects in play(
            Tracker(), arrival_s + 1, lambda time_s: [at(3, 0, score=score)] if time_s >= arrival_s else [])]
        empty = len(published) if images is None else 30 * arrival_s + images
        assert published == [0] * empty + [1] * (len(published) - empty)


@pytest.mark.parametrize('rate_hz', [4, 5, 10])
def test_fewer_weak_boxes_start_a_track_at_low_rates(rate_hz):
    """More people come into view between two images, but not more false boxes."""
    walk = play(Tracker(), 4, lambda time_s: [at(3, 0, score=0.35)] if time_s >= 2 else [], rate_hz)
    first_s = [number / rate_hz for number, objects in enumerate(walk) if objects][0] - 2
    assert first_s == pytest.approx(max(0.2, 1 / rate_hz))


def test_people_after_a_gap_in_the_images_count_as_arrived_meanwhile():
    """Boxes that need five images without the gap."""
    tracker = Tracker()
    play(tracker, 1, standing())
    after = play(tracker, 0.2, lambda _time_s: [at(3, 0, score=0.35)], start_s=2)
    assert [len(objects) for objects in after] == [0, 0, 1, 1, 1, 1]


@pytest.mark.parametrize('rate_hz', [5, 60])
def test_velocity_and_prediction_are_right_at_any_rate(rate_hz):
    walk = play(Tracker(), 4, lambda time_s: [at(4 - 0.4 * time_s, -1 + 0.6 * time_s)], rate_hz)
    track, = walk[-1]
    np.testing.assert_allclose(track.velocity_mps, (-0.4, 0.6, 0), atol=0.03)
    assert track.moving and track.status == VISIBLE
    np.testing.assert_allclose(track.prediction_m[-1] - track.position_m, (-0.8, 1.2, 0), atol=0.12)
    assert len(track.prediction_m) == 8 and track.prediction_step_s == 0.25


def test_an_occluded_person_stays_published_and_keeps_the_id():
    """Another person stands in front for 1.5 s."""
    def hidden(time_s):
        return [at(2, 0)] + ([] if 1 < time_s < 2.5 else [at(4, 0)])
    walk = play(Tracker(), 4, hidden)
    assert all(ids(objects) == [1, 2] for objects in walk[20:])
    assert [track.status for track in walk[60]] == [VISIBLE, OCCLUDED]
    assert [track.status for track in walk[-1]] == [VISIBLE, VISIBLE]


def test_a_person_out_of_view_is_published_while_certain():
    """Walks out to the left at 1 m/s, which a robot must know that drives across the way."""
    walk = play(Tracker(), 5, lambda time_s: [at(3, time_s)] if time_s < 1.75 else [])
    left = [objects[0] for objects in walk[53:] if objects]
    assert 1.0 <= len(left) / 30 <= 2.0 and not walk[-1]
    assert all(track.status == OUT_OF_VIEW for track in left[8:])
    assert left[-1].position_m[1] == pytest.approx(1.75 + len(left) / 30.0, abs=0.3)


PILLAR = VIEW._replace(depth_at=lambda points: np.where(np.abs(points[:, 0]) < 0.1 * points[:, 2], 2.0, 6.0))


@pytest.mark.parametrize('rate_hz', [5, 10, 30])
@pytest.mark.parametrize('speed_mps', [0.6, 1.5])
def test_a_person_who_comes_too_near_for_the_camera_stays_before_it(speed_mps, rate_hz):
    """Depth cameras measure nothing nearer than 0.3 to 0.8 m."""
    tracker, nearest_s = Tracker(), 2.3 / speed_mps
    blind = VIEW._replace(depth_at=lambda points: np.full(len(points), np.nan))
    for objects in play(tracker, nearest_s + 3, lambda time_s: [at(3 - speed_mps * time_s, 0)] if time_s < nearest_s
                        else [], rate_hz, view=blind)[-3 * rate_hz:]:
        assert ids(objects) == [1] and 0.3 < objects[0].position_m[0] < 0.9
    assert np.linalg.norm(objects[0].velocity_mps) < 0.1


def test_the_position_of_a_person_who_stands_before_a_low_camera_stays_certain():
    """It shows the legs, which the detector misses. A robot must be able to pass, as people who wait stay there."""
    tracker = Tracker()
    view = VIEW._replace(fixed_from_camera=mounted(0.2), depth_at=lambda points: np.full(len(points), 0.9))
    play(tracker, 2, standing((1, 0)), view=view)
    for (track,) in play(tracker, 10, standing(), start_s=2, view=view)[1:]:
        assert track.status == OCCLUDED and np.hypot(*track.position_m[:2] - (1, 0)) < 0.02
        assert np.sqrt(np.diag(track.covariance)[:2]).max() < 0.13


@pytest.mark.parametrize('beside_m,depth_m', [(0.6, np.nan), (0.0, 4.0)])
def test_a_person_who_has_passed_the_camera_goes_on_behind_it(beside_m, depth_m):
    """Beside it, or the depth image shows the wall behind the place of the person."""
    tracker, view = Tracker(), VIEW._replace(depth_at=lambda points: np.full(len(points), depth_m))
    walk = play(tracker, 3, lambda time_s: [at(2.5 - time_s, beside_m)] if time_s < 2 else [], view=view)
    last, = [objects[0] for objects in walk if objects][-1:]
    assert last.position_m[0] < 0.3


@pytest.mark.parametrize('view,speed_mps,away_s,max_age,expected', [
    (VIEW, 0, 2.9, 4.0, 1), (VIEW, 0, 3.5, 15.0, 2),  # the position is too uncertain after 3 s
    (VIEW, 0, 1.5, 1.0, 2), (PILLAR, 0.6, 6, 4.0, 2), (PILLAR, 0.6, 6, 15.0, 1)])
def test_a_person_who_reappears_within_max_age_keeps_the_id(view, speed_mps, away_s, max_age, expected):
    """A person is missed while standing, or while stopping behind a pillar, which is 0.8 m wide there."""
    side_m = 0.65 if speed_mps else 0
    tracker = Tracker(TrackerParams(max_age=max_age))
    play(tracker, 2, lambda time_s: [at(4, speed_mps * (time_s - 2) - side_m)], view=view)
    play(tracker, away_s, standing(), start_s=2, view=view)
    after = play(tracker, 1, lambda time_s: [at(4, speed_mps * (time_s - 2 - away_s) + side_m)], start_s=2 + away_s,
                 view=view)
    assert ids(after[-1]) == [expected]


def test_two_tracks_that_meet_in_one_person_become_one():
    """A detector draws two boxes of one person, at first far apart."""
    published = play(Tracker(), 3, lambda time_s: [at(3, 0), at(3, max(0.02, 0.8 - 1.2 * time_s))])
    assert ids(published[10]) == [1, 2] and ids(published[-1]) == [1]


def test_a_person_whose_legs_are_hidden_keeps_the_id():
    """A person starts to walk behind a trolley, is missed for 0.4 s, and then only visible above it."""
    def walking(time_s):
        y = 0.5 * max(time_s - 1, 0)
        upper = at(3, y, height=1.05, position_m=np.array([3, y, 1.7 - 1.05 / 2]))
        return [at(3, y)] if time_s < 1.1 else [upper] if time_s > 1.5 else []
    published = play(Tracker(), 3, walking)
    assert all_ids(published) == {1}
    assert published[50][0].status == VISIBLE


def test_boxes_with_little_support_start_no_track_and_continue_one():
    weak = at(3, 0, support=0.15)
    assert not any(play(Tracker(), 1, lambda _time_s: [weak]))
    assert ids(play(Tracker(), 2, lambda time_s: [at(3, 0) if time_s < 0.5 else weak])[-1]) == [1]


def test_an_end_that_is_sometimes_truncated_does_not_change_the_height():
    """In one of five images the detector draws the lower edge inside the image, where the box counts as whole."""
    visible = at(1.5, 0, height=0.7, position_m=np.array([1.5, 0, 1.35]))  # from 1.0 m to 1.7 m above the floor
    published = play(Tracker(), 4, lambda time_s: [visible if int(30 * time_s) % 5 == 4 else at(1.5, 0, cut='bottom')])
    heights_m = [track.size_m[2] for objects in published for track in objects]
    assert np.ptp(heights_m) < 0.01


def test_a_truncated_box_that_ends_inside_the_image_does_not_stop_a_walking_person():
    """Head and feet come out of the image, and the detector draws the upper edge a few pixels below the border."""
    def walking(time_s):
        x = 3.5 - time_s
        if time_s < 1:
            return [at(x, 0, sigma=0.12)]
        if time_s < 1.5:
            return [at(x, 0, sigma=0.12, cut='top bottom', height=0.9, position_m=np.array([x, 0, 0.6]))]
        return [at(x, 0, sigma=0.12, cut='bottom', position_m=np.array([x, 0, 1.0 - 1.7 / 2]))]

    track, = play(Tracker(), 1.75, walking, rate_hz=10)[-1]
    assert track.velocity_mps[0] == pytest.approx(-1, abs=0.1)


def test_the_box_of_a_hand_does_not_raise_a_person_whose_head_is_truncated():
    """The estimator completes the box of a hand, 0.6 m above the floor, to a body."""
    hand = at(1.5, 0, cut='top', position_m=np.array([1.5, 0, 0.6 + 1.7 / 2]))
    track, = play(Tracker(), 1.05, lambda time_s: [at(1.5, 0, cut='top') if time_s < 1 else hand])[-1]
    assert track.size_m[2] < 1.85 and track.position_m[2] < 1.0


@pytest.mark.parametrize('rate_hz,offset_m,from_s,error_m', [
    (30, lambda number: 0.8 * (number % 10 == 9), 0.5, 0.15),  # one box in ten has the depth of the background
    (30, lambda number: 0.4 * (3 <= number < 10), 0.5, 0.2),  # those of a new person, whose velocity is unknown
    (30, lambda number: 0.6 * (3 <= number < 10), 0.5, 0.2),
    (30, lambda number: 0.45 * (number < 90), 3.5, 0.1)] + [  # for long
    (rate_hz, lambda number: -0.45 * (number % 7 == 6), 2, 0.1) for rate_hz in (7.5, 15, 30, 60)])  # as of a hand
def test_boxes_with_a_wrong_depth_do_not_move_a_person_who_stands(rate_hz, offset_m, from_s, error_m):
    walk = play(Tracker(), 6, lambda time_s: [at(3 + offset_m(round(rate_hz * time_s)), 0)], rate_hz)
    assert all_ids(walk) == {1}
    for track, in walk[int(from_s * rate_hz):]:
        assert abs(track.position_m[0] - 3) < error_m
    assert max(np.linalg.norm(track.velocity_mps) for track, in walk[int(2 * rate_hz):]) < 0.1


@pytest.mark.parametrize('y,cut,width,expected', [
    (1.5, 'left', 0.25, 1.612), (-0.02, 'top', 0.38, -0.02), (0.02, 'top', 0.38, 0.02), (1.3, 'top', 0.38, 1.3)])
def test_a_truncated_box_is_completed_where_it_is_narrower_than_a_person(y, cut, width, expected):
    """The border at the left hides half of a body, 0.125 m at right angles to the ray; that above, no width."""
    track, = play(Tracker(), 1, lambda _time_s: [at(3, y, cut=cut, width=width)])[-1]
    assert track.position_m[1] == pytest.approx(expected, abs=0.01)


def test_boxes_of_a_far_person_with_large_errors_continue_the_track():
    random = np.random.RandomState(0)
    walk = play(Tracker(), 10, lambda _time_s: [at(*random.normal((7, 0), 1.0), sigma=1.0)], 3)
    assert len(all_ids(walk)) == 1


@pytest.mark.slow
def test_moving_has_hysteresis():
    """It starts at 0.2 m/s and ends at 0.1 m/s."""
    def speed(mps):
        return play(Tracker(), 4, lambda time_s: [at(3, mps * time_s - 0.5)])[-1][0].moving
    assert [speed(mps) for mps in (0.0, 0.15, 0.3)] == [False, False, True]
    slowing = play(Tracker(), 6, lambda time_s: [at(3, 0.4 * min(time_s, 3) + 0.14 * max(time_s - 3, 0) - 1)])
    assert slowing[-1][0].moving


def test_the_error_of_the_pose_of_the_robot_is_in_the_covariance():
    """A turn of the robot moves people at right angles to their direction from the camera, which is at the origin."""
    plain, uncertain = (play(Tracker(prediction=params), 1, standing((4, 3)))[-1][0] for params in (
        PredictionParams(), PredictionParams(pose_sigma=0.05, pose_yaw_sigma=0.02)))
    x, y = plain.position_m[:2] - VIEW.fixed_from_camera[:2, 3]
    turned = 0.02 ** 2 * np.array([[y * y, -x * y], [-x * y, x * x]])
    for before, after in ((plain.covariance, uncertain.covariance),
                          (plain.prediction_covariance_m2[-1], uncertain.prediction_covariance_m2[-1])):
        np.testing.assert_allclose((after - before)[:2, :2], 0.05 ** 2 * np.eye(2) + turned, atol=1e-9)


@pytest.mark.parametrize('late_s', [0.0, 0.6, 5.0])
def test_a_duplicate_or_too_late_image_is_rejected_without_any_change(late_s):
    tracker = Tracker()
    before = play(tracker, 1, standing((3, 0)))[-1]
    with pytest.raises(ValueError, match='stamp'):
        tracker.update(START_NS + int(round((29 / 30 - late_s) * NS)), [at(3, 1)], VIEW)
    np.testing.assert_array_equal(tracker.tracks()[0].covariance, before[0].covariance)
    assert ids(tracker.update(START_NS + NS, [at(3, 0)], VIEW)) == [1]


def test_new_parameters_apply_from_the_next_image_on_and_tracks_are_kept():
    """There are no more detections; by the old limits, predictions reach 2 s, and the track is kept for 4 s."""
    tracker = Tracker()
    number, = ids(play(tracker, 1, standing((3, 0)))[-1])
    tracker.reconfigure(TrackerParams(), NoiseParams(), PredictionParams(prediction_time=1.0))
    missed = play(tracker, 0.2, standing(), start_s=1)[-1]
    assert ids(missed) == [number] and len(missed[0].prediction_m) == 4
    tracker.reconfigure(TrackerParams(max_age=0.5), NoiseParams(), PredictionParams())
    assert play(tracker, 0.1, standing(), start_s=2)[-1] == []
    assert ids(play(tracker, 1, standing((3, 0)), start_s=3)[-1]) == [number + 1]


@pytest.mark.parametrize('start,end', [((3, 0), (0.45, -0.1)), ((3, 0), (0.41, -0.27)), ((3.5, 1.8), (0.5, 0.3))])
@pytest.mark.parametrize('depth_mm,stays', [(5000, False), (0, True)])
def test_who_passes_the_camera_does_not_stay_before_it(start, end, depth_mm, stays):
    """The camera looks past the person, who is beside or behind it, or is covered by one who stands before it."""
    depth = DepthImage(np.full((480, 640), depth_mm, np.uint16), 0.001)
    view = VIEW._replace(depth_at=functools.partial(depths_towards, CAMERA, depth))

    def walk(time_s):
        way = np.array(end) - start
        return [at(*start + way * time_s / 2)] if time_s <= 2 else []

    published = play(Tracker(), 6, walk, rate_hz=5, view=view)
    last = [objects for objects in published[10:] if objects]
    assert len(last) >= 18 if stays else len(last) <= 10
    distance_m = np.hypot(*last[-1][0].position_m[:2])
    assert distance_m < 0.6 if stays else distance_m > 1


@pytest.mark.parametrize('first', ['hidden', 'whole'])
def test_the_height_of_a_person_whose_legs_are_hidden_is_that_of_the_person(first):
    """A table hides the lower half for some seconds, once at the start. A person nearby keeps another ID."""
    def walk(time_s):
        is_hidden = (time_s < 2 if first == 'hidden' else 2 <= time_s < 6)
        y = 0.3 * time_s - 1
        return [at(4, y)._replace(position_m=np.array([4, y, 1.3]), size_m=np.array([0.5, 0.5, 0.8]))
                if is_hidden else at(4, y), at(4, 2.5)]

    published = play(Tracker(), 9, walk, rate_hz=2.5)
    assert all_ids(published) == {1, 2}
    heights_m = [objects[0].size_m[2] for objects in published[20 if first == 'hidden' else 2:]]
    assert all(1.45 < height_m < 1.75 for height_m in heights_m)


@pytest.mark.slow
@pytest.mark.parametrize('slope', [-0.1, 0.05, 0.1])
@pytest.mark.parametrize('cut,height', [(['top'], 1.7), (['bottom'], 1.7), (['top', 'bottom'], 0.6)])
def test_the_height_of_a_person_is_constant_on_a_slope(slope, cut, height):
    """The person goes up or down at 1 m/s, 2 m ahead of the robot; the border cuts the box from 1 s to 6 s."""
    def walk(time_s):
        box = at(2, 0, height, cut) if 1 < time_s < 6 else at(2, 0)
        return [box._replace(position_m=box.position_m + (time_s, 0, slope * time_s))]
    published = play(Tracker(), 8, walk, view=lambda time_s: view_from(time_s, 0, 1 + slope * time_s))
    assert set(ids(objects)[0] for objects in published[4:]) == {1}
    assert all(abs(objects[0].size_m[2] - 1.7) < 0.1 for objects in published[4:])
    assert published[-1][0].position_m[2] == pytest.approx(0.85 + slope * 7.97, abs=0.05)


def test_the_prediction_of_people_who_manoeuvre_is_less_certain():
    """The ellipse after 2 s is larger while a person stops or turns than while the same person walks on."""
    def area_m4(velocity_mps):
        def places(time_s):
            walked_m = np.multiply((0, 1.2), min(time_s, 3) - 3) + np.multiply(velocity_mps, max(time_s - 3, 0))
            return [at(4 + walked_m[0], walked_m[1])]
        return np.linalg.det(play(Tracker(), 3.5, places, 10)[-1][0].prediction_covariance_m2[-1, :2, :2])
    straight = area_m4((0, 1.2))
    for velocity_mps in ((0, 0), (1.2, 0), (0, -1.2)):
        assert area_m4(velocity_mps) > 1.5 * straight


@pytest.mark.parametrize('rate_hz', [5, 7.5])
def test_the_velocities_of_people_who_turn_together_follow_the_turn(rate_hz):
    """Three people side by side turn right within half a second, at 4 m/s2."""
    def places(time_s):
        turned_s = min(max(time_s - 2, 0), 0.5)
        first = np.array([4.0 + 1.4 * (turned_s ** 2 + max(time_s - 2.5, 0)),
                          1.4 * (min(time_s, 2) + turned_s - turned_s ** 2) - 3])
        return first + 0.8 * np.arange(3)[:, None] * (1, 0)
    random, tracker = np.random.RandomState(0), Tracker()
    objects = play(tracker, 4.5, lambda time_s: noisy(random, places(time_s), 0.03), rate_hz,
                   view=VIEW._replace(intrinsics=None))[-1]
    assert len(objects) == 3
    for track in objects:
        np.testing.assert_allclose(track.velocity_mps[:2], (1.4, 0), atol=0.4)
