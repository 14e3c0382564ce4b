"""The tracker with two cameras on one robot: one person is one track, for any view and order of images.

`FRONT` stands at the origin of the map, 1 m up, and looks along x, `LEFT` 45 degrees to the left of that. Each sees 31
degrees to either side, so that both see what is from 14 to 31 degrees to the left.
"""
import functools

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.occlusion import depths_towards
from ros_3d_bb.tracking.out_of_sequence import LATEST_NS, MOST_KEPT
from ros_3d_bb.tracking.tracker import Tracker
from ros_3d_bb.tracking.types import OCCLUDED, OUT_OF_VIEW, VISIBLE, CameraView
from support import people
from support.people import CAMERA, START_NS, at, ids, mounted, view_from

PERIOD_NS = NS // 30
EDGE = 0.6  # x / z of what the image border shows


def looking(yaw, camera):
    return view_from(0, 0, camera=camera, yaw_deg=np.degrees(yaw))


FRONT, LEFT = looking(0, 'front'), looking(np.pi / 4, 'left')
IN_FRONT, IN_BOTH, AT_LEFT = 0.0, np.radians(22.5), np.radians(50)  # bearings


def around(bearing, range_m=3.0):
    """The position at a bearing, to the left of x."""
    return np.array([range_m * np.cos(bearing), range_m * np.sin(bearing)])


def shown(view, *places_m, offset_m=(0, 0)):
    """The detections of people, none outside of the view; `offset_m` is the calibration error."""
    bearings = [view.bearings(np.array([place_m]))[1][0] for place_m in places_m]
    return [at(*np.add(place_m, offset_m)) for place_m, bearing in zip(places_m, bearings)
            if abs(np.tan(bearing)) < EDGE - 0.05 and abs(bearing) <= 1]


def images_of(seconds, places_at, views=(FRONT, LEFT), start_s=0.0, rate_hz=30, offset_m=(0, 0), sigma_m=0.0, seed=0):
    """(stamp_ns, detections, view) of cameras that take turns at `rate_hz` each, of people at `places_at(seconds)`.
    `offset_m` is the calibration error of LEFT, and `sigma_m` that of positions."""
    random, images = np.random.RandomState(seed), []
    for number in range(int(seconds * rate_hz) * len(views)):
        view, time_s = views[number % len(views)], start_s + number / (rate_hz * len(views))
        found = shown(view, *places_at(time_s), offset_m=offset_m if view is LEFT else (0, 0))
        images.append((START_NS + int(round(time_s * NS)), [
            person._replace(position_m=person.position_m + random.normal(0, sigma_m, 3)) for person in found], view))
    return images


def play(tracker, images):
    return [tracker.update(*image) for image in images]


def standing(*bearings):
    return lambda _time_s: [around(bearing) for bearing in bearings]


def low_camera(depth_m):
    """A camera 0.2 m up, with the same depth everywhere."""
    depth = DepthImage(np.full((480, 640), 1000 * depth_m, np.uint16), 0.001)
    return CameraView(mounted(0.2), CAMERA, 'low', functools.partial(depths_towards, CAMERA, depth))


@pytest.mark.parametrize('views', [('low',), ('low', 'left')])
def test_a_person_before_a_low_camera_stays_while_the_place_is_occupied(views):
    """The detector finds the person in the first second only."""
    def cameras(depth_m):
        return [{'low': low_camera(depth_m), 'left': LEFT}[name] for name in views]
    tracker = Tracker()
    play(tracker, images_of(1, lambda _time_s: [(1.0, 0.0)], cameras(0.95)))
    occupied = play(tracker, images_of(10, standing(), cameras(0.95), start_s=1))
    assert all([(track.id, track.status) for track in objects] == [(1, OCCLUDED)] for objects in occupied[len(views):])
    assert np.sqrt(occupied[-1][0].covariance[0, 0]) < 0.4
    free = play(tracker, images_of(1, standing(), cameras(4.0), start_s=11))
    assert free[-1] == []


@pytest.mark.parametrize('speed_mps', [0.5, 1.0, 1.5])
def test_a_person_who_walks_up_to_a_low_camera_and_stops_stays_before_it(speed_mps):
    """The detector finds the person up to 1.3 m. Before, the track went on through the robot, which then drove on."""
    def x_at(time_s):
        return max(3.0 - speed_mps * time_s, 0.8)
    track, = people.play(Tracker(), 10, lambda time_s: [at(x_at(time_s), 0)] if x_at(time_s) > 1.3 else [],
                         view=lambda time_s: low_camera(x_at(time_s) - 0.1))[-1]
    assert (track.id, track.status, track.moving) == (1, OCCLUDED, False) and 0.5 < track.position_m[0] <= 0.9
    assert np.linalg.norm(track.velocity_mps) < 0.05 and 0.5 < track.prediction_m[-1, 0] <= 0.9


def test_a_wall_behind_a_person_who_has_left_does_not_keep_the_track():
    """The person stood 0.3 m before it. Afterwards the robot, which stands, sees only the wall."""
    tracker, wall = Tracker(), [low_camera(1.3)]
    play(tracker, images_of(1, lambda _time_s: [(1.0, 0.0)], wall))
    left = play(tracker, images_of(45, standing(), wall, start_s=1)[::10])
    assert all(ids(objects) == [1] for objects in left[:3 * 29]) and not any(left[3 * 36:])


def test_a_person_who_walks_from_one_view_to_the_other_keeps_the_id():
    published = play(Tracker(), images_of(4, lambda time_s: [around(0.3 * time_s - 0.3)]))
    assert all([(track.id, track.status) for track in objects] == [(1, VISIBLE)] for objects in published[20:])
    speed_mps = np.linalg.norm(published[-1][0].velocity_mps)
    assert speed_mps == pytest.approx(0.9, abs=0.1)


@pytest.mark.slow
@settings(max_examples=20)
@given(st.floats(0, 0.3), st.floats(-np.pi, np.pi), st.integers(0, 1000))
def test_one_person_is_one_track_though_the_cameras_do_not_quite_agree(apart_m, direction, seed):
    """About where somebody is whom both see, by up to 0.3 m."""
    published = play(Tracker(), images_of(1.5, standing(IN_BOTH), offset_m=around(direction, apart_m), sigma_m=0.04,
                                          seed=seed))
    assert all(ids(objects) == [1] for objects in published[20:])


def test_two_people_side_by_side_in_both_views_are_two_tracks():
    """0.7 m apart, where the cameras disagree by 0.15 m."""
    places = [around(IN_BOTH, 2.5), around(IN_BOTH, 2.5) + (0.5, 0.5)]
    objects = play(Tracker(), images_of(3, lambda _time_s: places, offset_m=(0.15, 0)))[-1]
    assert ids(objects) == [1, 2]
    for track, place_m in zip(objects, places):
        assert np.linalg.norm(track.position_m[:2] - place_m) < 0.2


@pytest.mark.parametrize('seconds, views, offset_m, contradicting', [
    (7, (FRONT, LEFT), (1.0, 0.2), ('front', 'left')), (4, (FRONT, LEFT), (1.0, 0.2), None),
    (7, (FRONT,), (0, 0), None), (7, (FRONT, LEFT), (0.2, 0.1), None)])
def test_cameras_whose_poses_contradict_each_other(seconds, views, offset_m, contradicting):
    """One person is two tracks while both cameras see both places. Each detector misses a tenth."""
    tracker, random = Tracker(), np.random.RandomState(0)
    for stamp_ns, detections, view in images_of(seconds, standing(IN_BOTH), views, offset_m=offset_m):
        tracker.update(stamp_ns, detections if random.rand() < 0.9 else [], view)
    assert tracker.contradicting_cameras == contradicting


def test_people_side_by_side_whom_both_cameras_detect_are_no_contradiction():
    tracker, places = Tracker(), [around(IN_BOTH, 2.5), around(IN_BOTH, 2.5) + (0.5, 0.5)]
    for number, (stamp_ns, _detections, view) in enumerate(images_of(9, standing(IN_BOTH))):
        hidden = places[view is LEFT:][:1] if number % 3 else places  # each camera detects one of them more often
        tracker.update(stamp_ns, [found for place_m in hidden for found in shown(view, place_m)], view)
    assert len(tracker.tracks()) == 2 and tracker.contradicting_cameras is None


def test_a_camera_that_ends_neither_keeps_tracks_nor_delays_others():
    """Its people remain visible for one second, are then out of view for one, and then unpublished."""
    tracker = Tracker()
    assert ids(play(tracker, images_of(1, standing(IN_FRONT, AT_LEFT)))[-1]) == [1, 2]
    after = play(tracker, images_of(7, standing(IN_FRONT), views=(FRONT,), start_s=1.0))
    assert all((objects[0].id, objects[0].status) == (1, VISIBLE) for objects in after)
    others = [objects[1].status if len(objects) > 1 else None for objects in after]
    visible, out, gone = (others.count(state) for state in (VISIBLE, OUT_OF_VIEW, None))
    assert others == [VISIBLE] * visible + [OUT_OF_VIEW] * out + [None] * gone and visible == 30
    assert 15 <= out <= 30  # until their positions are too uncertain
    back = play(tracker, images_of(1, standing(AT_LEFT), views=(LEFT,), start_s=8.0))
    assert ids(back[-1])[-1] == 3  # too long ago: another track


@pytest.mark.parametrize('rate_hz', [0.8, 1.5])
def test_a_slow_camera_has_the_same_weight_beside_a_fast_one_as_alone(rate_hz):
    """Errors of its boxes are not correlated from image to image. Only the slow one has the person in view."""
    alone, beside = Tracker(), Tracker()
    slow = [(START_NS + int(number * NS / rate_hz) + 1, shown(LEFT, around(AT_LEFT)), LEFT) for number in range(8)]
    fast = images_of(8 / rate_hz, standing(), views=(FRONT,))
    play(alone, slow)
    play(beside, sorted((image for image in slow + fast if image[0] <= slow[-1][0]), key=lambda image: image[0]))
    (one,), (other,) = alone.tracks(), beside.tracks()
    np.testing.assert_allclose(other.covariance, one.covariance, rtol=1e-6)


@pytest.mark.parametrize('others', [(), (looking(np.pi, 'rear'),)])
def test_a_person_who_stays_behind_an_object_remains_there(others):
    """The person walks at 1 m/s behind a screen that hides y = 0 to 1 m from the camera in front, and stays there for
    1.5 s; another camera looks back."""
    def depth_at(points):
        behind_screen = (points[:, 0] / points[:, 2] < 0) & (points[:, 0] / points[:, 2] > -1 / 4.0)
        return np.where(behind_screen, 1.5, 6.0)

    def walk(time_s):
        y_m = min(time_s - 1.5, max(0.5, time_s - 3))
        return [] if -0.2 < y_m < 1.2 else [(4.0, y_m)]
    views = (FRONT._replace(depth_at=depth_at),) + others
    published = play(Tracker(), images_of(5, walk, views=views))
    first, inside, last = (number * len(views) for number in (42, 60, 125))
    assert all(objects[0].status == OCCLUDED for objects in published[first:last])
    assert all(0 < objects[0].position_m[1] < 1.1 for objects in published[inside:last])
    assert [(track.id, track.status) for track in published[-1]] == [(1, VISIBLE)]


def test_a_person_detected_by_one_camera_is_not_occluded_in_the_other():
    def depth_at(points):
        return np.full(len(points), 1.0)
    published = play(Tracker(), images_of(2, standing(IN_BOTH), views=(FRONT, LEFT._replace(depth_at=depth_at))))
    assert all([track.status for track in objects] == [VISIBLE] for objects in published[20:])


REAR = looking(np.pi, 'rear')
KINDS = ['skip', 'none', 'seen']
ARRIVALS = st.tuples(st.integers(0, 14), st.sampled_from([FRONT, LEFT, REAR]), st.sampled_from(KINDS))


@pytest.mark.slow
@settings(max_examples=100)
@given(st.lists(ARRIVALS, min_size=2, max_size=14, unique_by=lambda arrival: (arrival[0], arrival[1].camera)),
       st.floats(0, 2.5), st.integers(1, 3), st.randoms())
def test_neither_does_it_where_images_have_no_answer(arrivals, pause_s, cameras, random):
    """The order in which the images come does not matter: those of up to three cameras within 0.47 s, after a pause;
    somebody who was known before is found or not. What has no answer may be of the pause, too."""
    def play_them(arrivals):
        tracker = Tracker()
        play(tracker, images_of(0.3, standing(IN_BOTH), views=(FRONT, LEFT, REAR)[:cameras]))
        for step, view, kind in arrivals:
            stamp_ns = START_NS + NS // 3 + int(pause_s * NS) + step * PERIOD_NS
            if kind == 'skip':
                tracker.skip(stamp_ns - int(random_pauses[step, view.camera] * pause_s * NS), view.camera)
            else:
                tracker.update(stamp_ns, shown(view, around(IN_BOTH)) if kind == 'seen' else [], view)
        return tracker
    random_pauses = {(step, view.camera): random.choice([0, 0, 0.3, 0.9]) for step, view, _kind in arrivals}
    in_time = play_them(sorted(arrivals, key=lambda arrival: (arrival[0], arrival[1].camera)))
    random.shuffle(arrivals)
    shuffled = play_them(arrivals)
    assert ids(shuffled.tracks()) == ids(in_time.tracks())
    shuffled_tracks, tracks = ([dict(vars(track), latest=(track.latest.x, track.latest.y))
                                for track in tracker._buffer.state.tracks] for tracker in (shuffled, in_time))
    assert shuffled_tracks == tracks


@pytest.mark.parametrize('late_images', [(1,), (3,), (9,), (14,), (3, 6, 9), (4, 9, 14)])
def test_late_cameras_are_replayed_in_batches(monkeypatch, late_images):
    """An image is processed less than three times on average; before, up to ten times."""
    steps, step = [], Tracker._step
    monkeypatch.setattr(Tracker, '_step', lambda *given: steps.append(None) or step(*given))
    views = [FRONT] + [looking(number, 'late %d' % number) for number in range(len(late_images))]
    lates = dict(zip([view.camera for view in views], (0,) + late_images))
    images = images_of(2, standing(), views=views)
    images.sort(key=lambda image: image[0] + lates[image[2].camera] * PERIOD_NS)
    play(Tracker(), images)
    assert len(steps) <= 3 * len(images)


def test_stamps_that_hardly_advance_are_rejected_until_they_do():
    """All images of the last moment are kept, to take late ones in."""
    tracker = Tracker()
    for number in range(MOST_KEPT):
        tracker.update(NS + number, [], FRONT)
    for _again in range(2):
        with pytest.raises(ValueError, match='%d images of camera' % MOST_KEPT):
            tracker.update(NS + MOST_KEPT, [], FRONT)
    tracker.update(NS, [], LEFT)
    tracker.update(NS + LATEST_NS + 1, [], FRONT)


GROUP = [(IN_BOTH, 2.5), (IN_BOTH + 0.1, 3.5), (IN_BOTH - 0.1, 4.2), (IN_BOTH + 0.05, 5.5)]  # bearings, ranges


def steps_m(published):
    """Distances of the tracks between successive images."""
    return [np.linalg.norm(after.position_m - before.position_m)
            for objects, later in zip(published, published[1:]) for before, after in zip(objects, later)]


@pytest.mark.parametrize('rate_hz', [10, 30])
@pytest.mark.parametrize('offset_m', [(0.1, 0), (0.2, 0), (0, 0.2), (0.3, 0), (0, -0.3)])
def test_cameras_whose_poses_disagree_keep_the_ids_of_people_in_both(rate_hz, offset_m):
    tracker = Tracker()
    published = play(tracker, images_of(4, lambda _time_s: [around(*person) for person in GROUP], rate_hz=rate_hz,
                                        offset_m=offset_m, sigma_m=0.01))[rate_hz:]
    assert all(ids(objects) == [1, 2, 3, 4] for objects in published)
    assert max(steps_m(published)) < 0.4 * np.linalg.norm(offset_m)


@pytest.mark.parametrize('rate_hz, nearer_m', [(5, 0.15), (7.5, 0.18), (15, 0.13), (30, 0.18)])
def test_a_person_measured_too_near_by_opposite_cameras_stands(rate_hz, nearer_m):
    """Each box is before the track, but no outliers have moved it."""
    opposite, random = view_from(8, 0, camera='opposite', yaw_deg=180), np.random.RandomState(0)
    published = play(Tracker(), [
        (START_NS + int(number * NS / (2 * rate_hz)),
         [at(*random.normal((4 + (2 * (number % 2) - 1) * nearer_m, 0), 0.02), sigma=0.02)],
         (FRONT, opposite)[number % 2]) for number in range(int(20 * rate_hz))])[int(4 * rate_hz):]
    assert max(np.linalg.norm(track.velocity_mps) for objects in published for track in objects) < 0.3
    assert all(ids(objects) == [1] for objects in published)
