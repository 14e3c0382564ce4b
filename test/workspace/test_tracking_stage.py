import os

import numpy as np
import pytest
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header

from ros_3d_bb.camera.camera_model import OPTICAL_ROTATION, transform_from
from ros_3d_bb.conversions.image_msgs import fill_image
from ros_3d_bb.conversions.perception_msgs import occupied_from_msg, time_from
from ros_3d_bb.core.detector_model import DetectorModel
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.estimation.error_model import read_error_model, write_error_model
from ros_3d_bb.tracking.types import OCCLUDED, OUT_OF_VIEW, VISIBLE
from support.two_cameras import START_NS, Rig, boxes

PERIOD_NS = NS // 30


@pytest.fixture
def rig():
    return Rig()


def stand(rig):
    """A person stands there for a second; returns the stamp of the last image and the IDs of the tracks."""
    for frame in range(30):
        result = rig.send(START_NS + frame * PERIOD_NS)
    return START_NS + 29 * PERIOD_NS, ids(result)


def ids(result):
    return [track.id for track in result.tracks]


@pytest.mark.parametrize('ahead_ns', [9 * NS // 10, 100 * NS])
def test_an_image_ahead_without_a_result_changes_neither_stamps_nor_tracks(rig, ahead_ns):
    """One has no transform, another one has too many boxes."""
    stamp_ns, before = stand(rig)
    rig.transforms.missing.add(stamp_ns + ahead_ns)
    assert rig.send(stamp_ns + ahead_ns) is None
    with pytest.raises(ValueError, match='2000 3D boxes in one image; at most 1000'):
        rig.send(stamp_ns + 9 * NS // 10 + 1, count=2000)
    result = rig.send(stamp_ns + PERIOD_NS)
    assert result.header.stamp == time_from(stamp_ns + PERIOD_NS) and ids(result) == before
    assert 'jumps back in time' not in rig.events.counts


def test_a_backward_jump_in_time_is_handled_once(rig):
    stamp_ns, _before = stand(rig)
    rig.transforms.missing.add(stamp_ns - 20 * NS)
    assert rig.send(stamp_ns - 20 * NS) is None
    assert rig.send(stamp_ns - 19 * NS).tracks == []
    assert rig.events.counts['jumps back in time'] == 1
    assert rig.send(stamp_ns - 19 * NS + PERIOD_NS).header.stamp < time_from(stamp_ns)


@pytest.mark.parametrize('apart_m, expected', [(0.2, None), (1.4, 1)])
def test_cameras_that_contradict_each_other_are_reported_once(apart_m, expected):
    """They show one person in two places for 7 s."""
    rig = Rig('front', 'left')
    for image in range(70):
        rig.send(START_NS + image * NS // 10, 'front')
        result = rig.send(START_NS + image * NS // 10 + NS // 20, 'left', z=3.0 + apart_m)
    assert len(result.tracks) == (2 if expected else 1)
    assert rig.events.counts.get('cameras that contradict each other') == expected
    assert not expected or 'front and left' in rig.events.sentences['cameras that contradict each other']


@pytest.mark.parametrize('period_s, expected', [(0.5, None), (1.0, 1), (2.0, 1)])
def test_images_too_far_apart_to_track_people_are_reported_once(rig, period_s, expected):
    """One gap of 10 s is none of them."""
    for number in range(10):
        rig.send(START_NS + int(number * period_s * NS) + (number > 5) * 10 * NS)
    assert rig.events.counts.get('rate of images too low') == expected


def test_an_optical_target_frame_is_rejected():
    """By its name when the tracker starts, by that of the boxes when they arrive."""
    with pytest.raises(ValueError, match='camera_rgb_optical_frame is an optical frame.*camera_height'):
        Rig(target_frame='camera_rgb_optical_frame')
    rig = Rig(target_frame='kinect2_rgb')
    with pytest.raises(ValueError, match='kinect2_rgb is an optical frame.*~target_frame'):
        rig.send(START_NS, frame_id='/kinect2_rgb')
    with pytest.raises(ValueError, match='no frame_id.*~frame_id'):
        rig.add_boxes(boxes(START_NS, '', []), 0)


def test_boxes_in_the_frame_of_the_body_of_the_camera_are_rejected(rig):
    """Their z axis points up. A camera that looks up by 45 degrees is none."""
    pitched = transform_from((0, 0, 1), (0, np.sin(-np.pi / 8), 0, np.cos(np.pi / 8)))
    rig.transforms.lookup = lambda *_names: pitched.dot(transform_from((0, 0, 0), OPTICAL_ROTATION))
    assert rig.send(START_NS) is not None
    rig.transforms.lookup = lambda *_names: transform_from((0, 0, 1), (0, 0, 0, 1))
    with pytest.raises(ValueError, match='frame camera .*no optical frame.*up by 90 degrees.*~frame_id'):
        rig.send(START_NS + PERIOD_NS)


def add_images(rig, stamp_ns, encoding='16UC1'):
    header, depth_mm = Header(stamp=time_from(stamp_ns), frame_id='camera'), np.full((48, 64), 1500, '<u2')
    rig.views[''].add_camera_info(CameraInfo(header=header, width=64, height=48, K=[60, 0, 32, 0, 60, 24, 0, 0, 1]))
    image = Image(header=header, width=64, height=48, encoding=encoding, step=128, data=depth_mm.tobytes())
    rig.views[''].add_depth(image, 0)


def test_a_person_behind_something_in_the_depth_image_is_occluded(rig):
    """The person is not detected for a second, which is longer than a missed person is published."""
    stamp_ns, before = stand(rig)
    for number in range(1, 31):
        add_images(rig, stamp_ns + number * PERIOD_NS)
        result = rig.send(stamp_ns + number * PERIOD_NS, count=0)
    assert ids(result) == before and result.tracks[0].status == OCCLUDED


@pytest.mark.parametrize('columns,cx,expected', [
    ((205, 235), 212, [OCCLUDED]), ((175, 205), 212, []), ((0, 0), 423, [OUT_OF_VIEW])])
def test_raw_depth_is_compared_from_where_its_camera_stands(monkeypatch, columns, cx, expected):
    """It stands 0.1 m to the left of the colour camera, and sees something in these columns, 1.5 m ahead. With a
    principal point at the border of its image, it does not see the person."""
    rig, beside = Rig(depth='raw'), transform_from((-0.1, 0, 0), (0, 0, 0, 1))
    lookup = rig.transforms.lookup
    monkeypatch.setattr(rig.transforms, 'lookup', lambda target, source, stamp: (
        beside if (target, source) == ('camera', 'depth') else lookup(target, source, stamp)))
    stamp_ns, _before = stand(rig)
    rig.views[''].add_depth_camera_info(CameraInfo(width=424, height=240, K=[210, 0, cx, 0, 210, 120, 0, 0, 1]))
    rig.views[''].add_camera_info(CameraInfo(width=64, height=48, K=[60, 0, 32, 0, 60, 24, 0, 0, 1]))
    depth_mm = np.full((240, 424), 4000, np.uint16)
    depth_mm[:, slice(*columns)] = 1500
    for number in range(1, 31):
        header = Header(stamp=time_from(stamp_ns + number * PERIOD_NS), frame_id='depth')
        rig.views[''].add_depth(fill_image(Image(header=header), depth_mm, '16UC1'), 0)
        result = rig.send(stamp_ns + number * PERIOD_NS, count=0)
    assert [track.status for track in result.tracks] == expected


def test_boxes_are_tracked_without_their_depth_image_if_it_is_invalid(rig):
    add_images(rig, START_NS, encoding='nonsense')
    assert rig.send(START_NS) is not None
    assert rig.events.counts['depth images rejected'] == 1


def test_invalid_boxes_do_not_affect_the_others(rig):
    """A box as wide as a wall, and one without a position, are in each image of a person."""
    for frame in range(30):
        message = boxes(START_NS + frame * PERIOD_NS, 'camera', [(0, 0, 3), (0, 0, float('nan')), (0, 0, 3)])
        message.boxes[0].size.x, message.boxes[0].size.y = 9.34, 10.93
        rig.add_boxes(message, 0)
    track, = rig.newest.tracks
    assert track.status == VISIBLE and track.detection == 2  # among the published boxes, not those that are used
    assert rig.events.counts['3D boxes dropped'] == 60 and rig.events.counts['images tracked'] == 30


def test_an_image_without_any_valid_box_does_not_age_tracks(rig):
    """It differs from an image without people. The track is still published after a second of such images."""
    stamp_ns, before = stand(rig)
    for number in range(1, 31):
        with pytest.raises(ValueError, match='none'):
            rig.send(stamp_ns + number * PERIOD_NS, z=float('nan'))
    assert ids(rig.send(stamp_ns + 31 * PERIOD_NS)) == before
    assert rig.events.counts['3D boxes dropped'] == 30


def test_the_error_model_gives_the_tracker_the_range_of_the_detector(tmp_path):
    """A person 3 m ahead is not expected to be detected by a detector with a range of 2 m."""
    models = os.path.join(os.path.dirname(os.path.abspath(__file__)), os.pardir, os.pardir, 'config', 'error_models')
    model = read_error_model(os.path.join(models, 'd435i_thesis.yaml'))
    write_error_model(tmp_path / 'model.yaml', model._replace(detector=DetectorModel(max_range_m=2.0)))
    usual, near = Rig(), Rig(error_model=str(tmp_path / 'model.yaml'))
    for rig, expected in (usual, []), (near, [1]):
        stand(rig)
        results = [rig.send(START_NS + (30 + frame) * PERIOD_NS, count=0) for frame in range(25)]
        assert ids(results[-1]) == expected


def map_in(frame_id, **fields):
    grid = OccupancyGrid(header=Header(frame_id=frame_id), data=[100, 0, 64, -1])
    grid.info.width, grid.info.height, grid.info.resolution, grid.info.origin.orientation.w = 2, 2, 0.1, 1.0
    for name, value in fields.items():
        setattr(grid.info, name, value)
    return grid


@pytest.mark.parametrize('message, words', [
    (map_in('odom'), "its frame is 'odom'"), (map_in('map', width=3), 'it has 4 cells of 0.1 m, 3 x 2'),
    (map_in('map', resolution=0.0), 'of 0 m'), (map_in('map', resolution=float('nan')), 'of nan m')])
def test_a_map_in_another_frame_or_without_cells_is_rejected(rig, message, words):
    assert occupied_from_msg(map_in('map')).cells.tolist() == [[True, False], [False, False]]  # from 65 on
    with pytest.raises(ValueError, match=words):
        rig.set_map(message)


def test_the_frame_of_the_tracks_has_no_slash_which_tf2_rejects():
    rig = Rig(target_frame='/map')
    assert rig.send(START_NS).header.frame_id == 'map'


def test_tracks_are_withheld_while_a_camera_is_silent():
    rig = Rig('front', 'rear', camera_timeout=0.5)
    assert rig.send(START_NS, 'front') is None
    assert rig.send(START_NS + NS // 10, 'rear') is not None and rig.send(START_NS + NS // 5, 'front') is not None
    assert rig.send(START_NS + 7 * NS // 10, 'front') is None
    assert 'no boxes of rear were tracked within the last 0.5 s' in rig.events.sentences['tracks withheld']
    assert rig.send(START_NS + 8 * NS // 10, 'rear') is not None


def test_a_camera_that_is_silent_since_a_jump_back_is_noticed():
    """A bag is repeated, the second time without the rear camera."""
    rig = Rig('front', 'rear', camera_timeout=1.0)
    for number in range(50):
        rig.now_ns = number * NS // 10
        assert rig.send(START_NS + rig.now_ns, 'rear') is None or number
        assert rig.send(START_NS + rig.now_ns, 'front') is not None
    results = []
    for number in range(30):
        rig.now_ns += NS // 10
        results.append(rig.send(START_NS + number * NS // 10, 'front'))
    assert rig.events.counts['jumps back in time'] == 1 and results[11:] == [None] * 19
