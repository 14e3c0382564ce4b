import math

import numpy as np
import pytest

from ros_3d_bb.tracking.tracker import Tracker
from support import people
from support.people import all_ids, noisy

VIEW = people.VIEW._replace(intrinsics=None)  # everything is in view
NOISE_M, WALKING_MPS = 0.03, 1.4
RATES_HZ = [3, 5, 7.5, 10, 15, 30]


def play(rate_hz, seconds, boxes_at, tracker=None, start_s=0.0):
    """The published tracks of each image, of boxes (x, y) or (x, y, height) at `boxes_at(seconds)`, with noise."""
    random = np.random.RandomState(1)
    return people.play(tracker or Tracker(), seconds, lambda time_s: noisy(random, boxes_at(time_s), NOISE_M), rate_hz,
                       start_s, VIEW)


@pytest.mark.parametrize('rate_hz', RATES_HZ)
@pytest.mark.parametrize('speed_mps', [2.5, 4.0, 5.0])
def test_a_runner_is_published_with_one_id_from_the_fourth_image_on(rate_hz, speed_mps):
    outputs = play(rate_hz, 6.5 / speed_mps, lambda time_s: [(6.0, speed_mps * time_s - 3.3)])
    assert len(all_ids(outputs)) == 1 and all(outputs[4:])


@pytest.mark.parametrize('rate_hz', RATES_HZ)
@pytest.mark.parametrize('velocity_mps', [(WALKING_MPS, 0.0), (0.0, -WALKING_MPS), (0.0, 0.0)])
def test_a_person_who_turns_or_stops_keeps_the_id(rate_hz, velocity_mps):
    """From one image to the next, as it seems to a slow detector."""
    def boxes_at(time_s):
        before_s, after_s = min(time_s, 3.0), max(time_s - 3.0, 0.0)
        return [(4.0 + velocity_mps[0] * after_s, WALKING_MPS * (before_s - 3.0) + velocity_mps[1] * after_s)]
    outputs = play(rate_hz, 5, boxes_at)
    assert len(all_ids(outputs)) == 1
    for number, tracks in list(enumerate(outputs))[-2:]:
        (x, y), = boxes_at(number / rate_hz)
        assert math.hypot(tracks[0].position_m[0] - x, tracks[0].position_m[1] - y) < 0.3


@pytest.mark.parametrize('rate_hz', RATES_HZ)
@pytest.mark.parametrize('heights_m', [(1.7, 1.2), (1.2, 1.7), (1.8, 1.1), (1.7, 2.1)])
def test_a_person_who_sits_down_stands_up_or_bends_keeps_the_id(rate_hz, heights_m):
    outputs = play(rate_hz, 4, lambda time_s: [(3.0, 0.0, float(np.interp(time_s, (2, 2.6), heights_m)))])
    assert len(all_ids(outputs)) == 1


def test_a_person_who_crouches_and_is_missed_once_keeps_the_id():
    def boxes_at(time_s):
        return [] if 1.96 < time_s < 2.04 else [(3.0, 0.0, float(np.interp(time_s, (1.8, 2.2), (1.7, 1.3))))]
    assert len(all_ids(play(15, 4, boxes_at))) == 1


@pytest.mark.parametrize('velocity_mps', [0.0, -0.8])
def test_a_person_who_stops_or_turns_while_missed_keeps_the_id(velocity_mps):
    """For 0.37 s. Before, the person walked at 1.2 m/s."""
    def boxes_at(time_s):
        place = (4.0, 1.2 * min(time_s - 1.5, 0.0) + velocity_mps * max(time_s - 1.5, 0.0))
        return [] if 1.51 < time_s < 1.86 else [place]
    assert len(all_ids(play(30, 3, boxes_at))) == 1


@pytest.mark.parametrize('rate_hz', RATES_HZ)
def test_a_first_box_with_a_wrong_depth_gives_a_standing_person_no_lasting_velocity(rate_hz):
    outputs = play(rate_hz, 3, lambda time_s: [(4.0 if time_s < 0.5 / rate_hz else 3.0, 0.0)])
    for tracks in outputs[max(int(rate_hz), 4):]:
        assert abs(tracks[-1].position_m[0] - 3) < 0.3 and abs(tracks[-1].velocity_mps[0]) < 1


@pytest.mark.parametrize('rate_hz', [3, 5, 10, 30])
def test_a_person_found_in_every_second_image_is_published(rate_hz):
    outputs = play(rate_hz, 10, lambda time_s: [(3.0, 0.0)] if round(time_s * rate_hz) % 2 == 0 else [])
    assert len(all_ids(outputs)) == 1 and any(outputs[:int(5 * rate_hz)])


def test_a_person_beside_one_who_is_not_detected_gets_another_id():
    """The box is within reach of the last detection of the other person, but two images later."""
    def boxes_at(time_s):
        return [(4.0, 0.0)] if time_s < 1.9 else [] if time_s < 2.3 else [(4.0, 0.9)]
    outputs = play(5, 5, boxes_at)
    before, after = all_ids(outputs[:9]), all_ids([outputs[-1]])
    assert len(before) == len(after) == 1 and not before & after


def test_of_two_people_within_reach_none_takes_the_box_of_a_third():
    """A slow detector misses two people who stand 0.6 m apart, and finds a third one between them."""
    def boxes_at(time_s):
        return [(4.0, -0.3, 1.8), (4.0, 0.3, 1.5)] if time_s < 2 else [(4.35, 0.0, 1.2)]
    outputs = play(5, 2.4, boxes_at)
    of_two = all_ids(outputs[:9])
    assert all(track.size_m[2] > 1.4 for tracks in outputs for track in tracks if track.id in of_two)


def test_boxes_that_never_become_a_track_are_counted():
    """Three boxes, each too far from the one before to be of the same person; then a person who stays."""
    tracker = Tracker()
    play(5, 0.6, lambda time_s: [(3.0, 15.0 * time_s)], tracker)
    assert not tracker.untracked_boxes  # their tracks are tentative
    play(5, 3.4, lambda _time_s: [(3.0, -3.0)], tracker, 0.6)
    assert tracker.untracked_boxes == 3
    tracker.reset()
    assert not tracker.untracked_boxes


@pytest.mark.parametrize('gap_s', [5.0, 3600.0, 6.3e7])
@pytest.mark.parametrize('y', [-1.3, -0.4, 0.7])
def test_a_person_after_a_gap_between_images_gets_a_new_id(gap_s, y):
    """Any box would be within reach after it, and the covariance of the track is too large for an update."""
    tracker = Tracker()
    before, after = (play(10, 1.0, lambda _time_s: [(4.0, y)], tracker, start_s) for start_s in (0.0, gap_s))
    assert after[-1] and not all_ids(before) & all_ids(after)


@pytest.mark.parametrize('rate_hz', [3, 5, 10])
def test_people_who_walk_on_while_they_bend_keep_their_velocity(rate_hz):
    tracks = play(rate_hz, 3.0, lambda time_s: [(3.0, time_s - 2, 1.7 if time_s < 2 else 1.1)])
    assert all_ids(tracks) == {1}
    for track, in tracks[2 * rate_hz:]:
        assert track.velocity_mps[1] == pytest.approx(1, abs=0.3)
