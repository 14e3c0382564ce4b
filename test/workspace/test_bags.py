import csv
import json
import os
import re
import resource
import subprocess

import numpy as np
import pytest
import rosbag
from std_msgs.msg import Header, String

from ros_3d_bb.bags.bag_writer import write_bag
from ros_3d_bb.conversions.camera_msgs import START_NS
from ros_3d_bb.conversions.image_msgs import imgmsg_to_depth, imgmsg_to_rgb
from ros_3d_bb.conversions.perception_msgs import (boxes2d_from_msg, boxes2d_to_msg, camera_from_msg, time_from,
                                                   tracks_from_msg, tracks_to_msg)
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.sessions.session_reader import read_color, read_depth, read_session
from ros_3d_bb_lab.evaluation.demo.scene_report import (BOXES_TOPIC, TRACKS_TOPIC, main, paths_of, read_recording,
                                                        write_csv, write_report)
from ros_3d_bb_lab.simulation.ros.scenario_to_bag import scenario_images, scenario_to_bag
from ros_3d_bb_lab.simulation.scenario import scenario_from
from ros_3d_bb_lab.simulation.simulator import Simulator
from support.bags import changed_bag, messages_in, scene_bag, session_images
from support.commands import run


@pytest.fixture(scope='module')
def session(session_folder):
    session = read_session(session_folder)
    return session._replace(frames=session.frames[:7])


@pytest.fixture(scope='module')
def messages(session, tmp_path_factory):
    path = str(tmp_path_factory.mktemp('bag') / 'session.bag')
    assert write_bag(session_images(session, 10.0, with_boxes=True), path) == 7
    with rosbag.Bag(path) as bag:
        for topic, message, time in bag.read_messages():
            stamped = message.transforms[0] if topic == '/tf' else message
            assert topic == '/yolo_bounding_box' or stamped.header.stamp == time
    return messages_in(path)


def test_pixels_boxes_and_intrinsics_are_those_of_the_session(session, messages):
    for number, frame in enumerate(session.frames):
        color = messages['/camera/color/image_raw'][number]
        depth = messages['/camera/aligned_depth_to_color/image_raw'][number]
        assert color.header.stamp == depth.header.stamp == time_from(START_NS + number * NS // 10)
        assert color.header.frame_id == depth.header.frame_id == session.frame_id
        np.testing.assert_array_equal(imgmsg_to_rgb(color), read_color(frame, session.camera))
        np.testing.assert_array_equal(imgmsg_to_depth(depth).values, read_depth(frame, session).values)
        boxes = boxes2d_from_msg(messages['/yolo_bounding_box'][number])
        assert boxes.stamp_ns == color.header.stamp.to_nsec()
        assert [tuple(box) for box in boxes.boxes.tolist()] == list(frame.boxes_px)
        assert camera_from_msg(messages['/camera/color/camera_info'][number]) == session.camera


SCENE = {'duration': 0.5, 'rate': 10.0, 'people': [{'start': [3.0, 0.5], 'moves': [{'to': [3.0, -1.0]}]}],
         'robot': {'moves': [{'to': [1.0, 0.0]}], 'odometry_drift': [0.2, 0.1, 0.3]}}


@pytest.fixture(scope='module')
def scene(tmp_path_factory):
    """Simulator, and {topic: messages} of the bag of its scenario."""
    path = str(tmp_path_factory.mktemp('bag') / 'scene.bag')
    assert write_bag(scenario_images(scenario_from(SCENE)), path) == 5
    return Simulator(scenario_from(SCENE)), messages_in(path)


def test_a_scene_contains_the_images_of_the_simulator(scene):
    simulator, messages = scene
    assert [message.header.stamp.to_nsec() - START_NS for message in messages['/ground_truth']] == [
        number * NS // 10 for number in range(5)]
    for number in (0, 4):
        frame = simulator.frame(number)
        np.testing.assert_array_equal(imgmsg_to_rgb(messages['/camera/color/image_raw'][number]), frame.color)
        depth = imgmsg_to_depth(messages['/camera/aligned_depth_to_color/image_raw'][number])
        assert depth.scale_m == 0.001
        np.testing.assert_array_equal(depth.values, frame.depth_mm)
        assert camera_from_msg(messages['/camera/color/camera_info'][number]) == simulator.camera
        written, = tracks_from_msg(messages['/ground_truth'][number])
        person, = simulator.true_tracks(frame, START_NS + number * NS // 10)
        assert (written.id, written.status, written.moving) == (person.id, person.status, person.moving)
        for field in ('position_m', 'velocity_mps', 'size_m', 'prediction_m'):
            np.testing.assert_allclose(getattr(written, field), getattr(person, field), atol=1e-12)


@pytest.mark.parametrize('text,option,named', [
    (json.dumps(SCENE), ('--rate', '0'), 'rate is 0'), (json.dumps(SCENE), ('--rate', 'nan'), 'rate is nan'),
    (json.dumps(SCENE), ('--seed', '-1'), 'seed is -1'), ('people:\n- {strat: [1, 2]}', (), '[1].start?')])
def test_an_invalid_scenario_leaves_no_bag_and_the_fault_is_named(tmp_path, text, option, named):
    (tmp_path / 'scene.yaml').write_text(text)
    status, output = run(scenario_to_bag, tmp_path / 'scene.yaml', tmp_path / 'out.bag', *option)
    assert status == 1 and named in output and os.listdir(str(tmp_path)) == ['scene.yaml']


RECORDED_SCENE = {'duration': 1.0, 'rate': 10.0, 'people': [{'start': [3.0, 1.0], 'moves': [{'to': [3.0, -1.0]}]}],
                  'robot': {'moves': [{'to': [1.0, 0.0]}]}}
SHIFT_M = 0.2


def images_with_tracks(frame_id):
    """Scene with tracks at an offset of `SHIFT_M` from the truth with the ID 7, except for the first image."""
    for number, (stamp_ns, messages) in enumerate(scenario_images(scenario_from(RECORDED_SCENE))):
        messages, header = list(messages), Header(stamp=time_from(stamp_ns), frame_id=frame_id)
        truth = dict(messages)['ground_truth']
        tracks = [track._replace(id=7, position_m=track.position_m + [0, SHIFT_M, 0])
                  for track in tracks_from_msg(truth)]
        messages.append((BOXES_TOPIC, boxes2d_to_msg(np.array([[100, 50, 200, 300]]), header)))
        if number:
            messages.append((TRACKS_TOPIC, tracks_to_msg(tracks, header)))
        yield stamp_ns, messages


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    path = str(tmp_path_factory.mktemp('bag') / 'scene.bag')
    write_bag(images_with_tracks('map'), path)
    return path


def test_tracks_are_compared_with_the_truth_of_their_stamp(bag):
    with rosbag.Bag(bag) as opened:
        recording = read_recording(opened)
    assert [moment.stamp_ns for moment in recording.moments] == [START_NS + n * NS // 10 for n in range(10)]
    assert recording.answered == 9 and recording.moments[0].tracks == []
    people, tracks = paths_of(recording)
    np.testing.assert_allclose(np.array(tracks[7]) - people[1][1:], [[0, SHIFT_M]] * 9)
    assert recording.robot.shape == (10, 2) and 0.2 < recording.robot[-1, 0] < 1.0


def test_the_command_prints_the_table_and_writes_the_image_next_to_the_bag(bag):
    output = subprocess.check_output(['rosrun', 'ros_3d_bb', 'scene_report', bag], universal_newlines=True)
    _titles, person, summary, picture, report = output.splitlines()
    assert person.split()[0] == '1' and '0.200 m' in person and ' 7 ' in person and ' 90 %' in person
    assert summary.endswith('; 9 of 10 images answered')
    assert picture == 'picture: %s' % bag.replace('.bag', '.png') and os.path.exists(bag.replace('.bag', '.png'))
    assert report == 'report: %s' % bag.replace('.bag', '.html')
    with open(bag.replace('.bag', '.html'), encoding='utf-8') as stream:
        page = stream.read()
    assert '<td>0.200 m</td>' in page and 'src="data:image/png;base64,' in page and 'http' not in page


def test_without_ground_truth_the_tracks_are_listed(tmp_path):
    path = str(tmp_path / 'tracked.bag')
    write_bag(((stamp_ns, [pair for pair in messages if pair[0] != 'ground_truth'])
               for stamp_ns, messages in images_with_tracks('map')), path)
    assert write_report(path, str(tmp_path / 'tracked.png')) == [
        'track  images  first seen  last seen', '    7       9       0.0 s      0.8 s',
        'number of tracks: 1; 9 of 9 images answered']
    assert (tmp_path / 'tracked.png').exists()


def test_tracks_are_written_as_a_table(bag, tmp_path):
    """Also of a bag of rosbag record, which stores the names of topics as they are given on its command line."""
    changed_bag(bag, tmp_path / 'in.bag', lambda topic, *rest: (topic[1:],) + rest)
    write_csv(str(tmp_path / 'in.bag'), str(tmp_path / 'tracks.csv'))
    with open(str(tmp_path / 'tracks.csv'), newline='') as stream:
        rows = list(csv.DictReader(stream))
    assert [(row['id'], row['label'], row['status']) for row in rows] == [('7', 'person', '0')] * 9
    assert [float(row['stamp_s']) * 10 % 10 for row in rows] == pytest.approx(range(1, 10), abs=1e-5)
    with rosbag.Bag(bag) as opened:
        people, _tracks = paths_of(read_recording(opened))
    np.testing.assert_allclose([float(row['y_m']) - SHIFT_M for row in rows], np.array(people[1])[1:, 1])


def test_a_bag_that_was_recorded_in_a_namespace_has_a_report(bag, tmp_path):
    """As with ROS_NAMESPACE=robot1. Transforms are common to all robots."""
    path = str(tmp_path / 'in.bag')
    changed_bag(bag, path, lambda topic, *rest: (topic if topic == '/tf' else '/robot1' + topic,) + rest)
    with rosbag.Bag(bag) as opened, rosbag.Bag(path) as changed:
        expected, found = read_recording(opened), read_recording(changed)
    assert found.has_truth and [len(each.tracks) for each in found.moments] == [
        len(each.tracks) for each in expected.moments]
    write_csv(path, str(tmp_path / 'tracks.csv'))
    assert (tmp_path / 'tracks.csv').read_text().count('person') == 9


def write_unindexed(path):
    write_bag(images_with_tracks('map'), path)
    with open(path, 'r+b') as stream:
        stream.truncate(os.path.getsize(path) // 2)


@pytest.mark.parametrize('make, reason', [
    (lambda path: scene_bag(path, RECORDED_SCENE), 'no messages on /ros_3d_bb/tracks'),
    (lambda path: write_bag(images_with_tracks('odom'), path), 'frames map, odom'),
    (lambda _path: None, 'No such file'), (write_unindexed, 'rosbag reindex')])
def test_unusable_bags_are_rejected(tmp_path, monkeypatch, make, reason):
    path = str(tmp_path / 'some.bag')
    make(path)
    monkeypatch.setattr('sys.argv', ['scene_report', path])
    with pytest.raises(SystemExit, match='%s.*%s.*no report was written' % (re.escape(path), reason)):
        main()
    assert set(os.listdir(str(tmp_path))) <= {'some.bag'}


def test_a_full_disk_is_named_and_leaves_no_bag(tmp_path):
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20000, before[1]))
    images = ((number + 1, [('noise', String(os.urandom(1000).hex()))]) for number in range(1000))
    try:
        with pytest.raises(OSError, match='File too large'):  # in place of: No space left on device
            write_bag(images, str(tmp_path / 'some.bag'))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert os.listdir(str(tmp_path)) == []
