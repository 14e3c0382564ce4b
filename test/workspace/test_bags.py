"""Bags of sessions and scenarios: pixels, intrinsics, and transforms of a robot in the map."""
import json
import os
import subprocess

import numpy as np
import pytest
import rosbag
import tf2_ros

from ros_3d_bb.bags.bag_writer import START_NS, SessionBagOptions, images_in, session_images, write_bag
from ros_3d_bb.conversions.image_msgs import imgmsg_to_depth, imgmsg_to_rgb
from ros_3d_bb.conversions.perception_msgs import (boxes2d_from_msg, camera_from_msg, time_from,
                                                   tracks_from_msg, transform_from_msg)
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.sessions.session_reader import read_color, read_depth, read_session
from ros_3d_bb_lab.simulation.ros.scenario_to_bag import scenario_images
from ros_3d_bb_lab.simulation.scenario import scenario_from
from ros_3d_bb_lab.simulation.simulator import Simulator


@pytest.fixture(scope='module')
def session(session_folder):
    """The first frames of a session."""
    session = read_session(session_folder)
    return session._replace(frames=session.frames[:7])


@pytest.fixture(scope='module')
def messages(session, tmp_path_factory):
    """{topic: messages} of a bag at 10 Hz."""
    path = str(tmp_path_factory.mktemp('bag') / 'session.bag')
    assert write_bag(session_images(session, SessionBagOptions(10.0, with_boxes=True)), path) == 7
    return messages_in(path)


def messages_in(path):
    by_topic = {}
    with rosbag.Bag(path) as bag:
        for topic, message, time in bag.read_messages():
            by_topic.setdefault(topic, []).append(message)
            stamped = message.transforms[0] if topic == '/tf' else message
            assert topic == '/yolo_bounding_box' or stamped.header.stamp == time
    return by_topic


def test_topics_are_those_of_a_realsense_on_a_robot(messages):
    assert set(messages) == {'/camera/color/image_raw', '/camera/aligned_depth_to_color/image_raw', '/tf',
                             '/camera/color/camera_info', '/camera/aligned_depth_to_color/camera_info',
                             '/yolo_bounding_box'}
    assert all(len(of_topic) == 7 for of_topic in messages.values())


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


def test_transforms_of_a_session_are_those_of_a_jackal_in_the_map(session, messages):
    """0.17 m in front of and 0.20 m above base_link (thesis 3.5.1), facing forward."""
    buffer = tf2_ros.BufferCore()
    for transform in messages['/tf'][3].transforms:
        buffer.set_transform(transform, 'test')
    stamp = messages['/camera/color/image_raw'][3].header.stamp
    map_from_camera = transform_from_msg(buffer.lookup_transform_core('map', session.frame_id, stamp))
    np.testing.assert_allclose(map_from_camera.dot([0, 0, 2, 1]), [2.17, 0, 0.2, 1], atol=1e-9)
    assert buffer.can_transform_core('odom', 'base_link', stamp)[0]


def test_depth_in_other_units_than_millimetres_keeps_its_scale(session, tmp_path):
    """The depth unit of the camera is 0.25 mm; the depth in the bag is in metres."""
    path = str(tmp_path / 'fine.bag')
    write_bag(session_images(session._replace(depth_scale_m=0.00025, frames=session.frames[:1])), path, 'none')
    depth = imgmsg_to_depth(messages_in(path)['/camera/aligned_depth_to_color/image_raw'][0])
    assert depth.scale_m == 1.0
    np.testing.assert_allclose(depth.values, read_depth(session.frames[0], session).values * 0.00025, rtol=1e-6)


def run_tool(tool, *arguments):
    return subprocess.run(['rosrun', 'ros_3d_bb', tool] + list(arguments), stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, universal_newlines=True)


def test_the_command_prints_the_number_of_images(session_folder, tmp_path):
    result = run_tool('session_to_bag', session_folder, str(tmp_path / 'out.bag'), '--rate', '15')
    assert result.returncode == 0 and 'out.bag: ' in result.stdout
    with rosbag.Bag(str(tmp_path / 'out.bag')) as bag:
        assert '/yolo_bounding_box' not in bag.get_type_and_topic_info().topics


@pytest.mark.parametrize('depth', ['depth/missing.png', None])
def test_an_invalid_session_leaves_no_bag_and_is_named(session_folder, tmp_path, depth):
    folder, bag = tmp_path / 'broken', str(tmp_path / 'out.bag')
    folder.mkdir()
    if depth:
        with open(os.path.join(session_folder, 'frames.json')) as stream:
            content = json.load(stream)
        content['frames'][0]['depth'] = depth
        (folder / 'frames.json').write_text(json.dumps(content))
    result = run_tool('session_to_bag', str(folder), bag)
    assert result.returncode == 1 and str(folder) in result.stdout
    assert 'Traceback' not in result.stdout and os.listdir(str(tmp_path)) == ['broken']


SCENE = {'duration': 0.5, 'rate': 10.0, 'people': [{'start': [3.0, 0.5], 'moves': [{'to': [3.0, -1.0]}]}],
         'robot': {'moves': [{'to': [1.0, 0.0]}], 'odometry_drift': [0.2, 0.1, 0.3]}}


@pytest.fixture(scope='module')
def scene(tmp_path_factory):
    """Simulator, and {topic: messages} of the bag of its scenario."""
    path = str(tmp_path_factory.mktemp('bag') / 'scene.bag')
    assert write_bag(scenario_images(scenario_from(SCENE)), path) == 5
    return Simulator(scenario_from(SCENE)), messages_in(path)


def test_a_scene_has_the_topics_of_a_robot_and_the_truth(scene):
    _simulator, messages = scene
    assert set(messages) == {'/camera/color/image_raw', '/camera/aligned_depth_to_color/image_raw', '/tf',
                             '/camera/color/camera_info', '/camera/aligned_depth_to_color/camera_info', '/ground_truth'}
    assert [message.header.stamp.to_nsec() - START_NS for message in messages['/ground_truth']] == [
        number * NS // 10 for number in range(5)]
    assert set(message.header.frame_id for message in messages['/ground_truth']) == {'map'}


def test_a_scene_contains_the_images_of_the_simulator(scene):
    simulator, messages = scene
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


def test_the_transforms_of_a_scene_connect_map_and_camera(scene):
    simulator, messages = scene
    buffer = tf2_ros.BufferCore()
    for message in messages['/tf']:
        for transform in message.transforms:
            buffer.set_transform(transform, 'test')
    for number in range(5):
        found = buffer.lookup_transform_core('map', 'camera_color_optical_frame',
                                             messages['/ground_truth'][number].header.stamp)
        np.testing.assert_allclose(transform_from_msg(found),
                                   simulator.poses_at(simulator.time_s(number)).map_from_camera, atol=1e-9)


def raw_messages(path):
    with rosbag.Bag(str(path)) as bag:
        return [(topic, data[1], stamp) for topic, data, stamp in bag.read_messages(raw=True)]


def test_the_bag_of_a_scenario_depends_on_the_seed_only(tmp_path):
    scenario = tmp_path / 'scene.yaml'
    scenario.write_text(json.dumps(dict(SCENE, duration=0.2)))
    for name, seed in (('one', '5'), ('two', '5'), ('other', '6')):
        result = run_tool('scenario_to_bag', str(scenario), str(tmp_path / name), '--seed', seed, '--rate', '20')
        assert result.returncode == 0 and ': 4 images' in result.stdout
    one, two, other = (raw_messages(tmp_path / name) for name in ('one', 'two', 'other'))
    assert one == two and one != other


def test_the_number_of_images_and_true_boxes_are_optional(tmp_path):
    scenario, path = tmp_path / 'scene.yaml', str(tmp_path / 'scene.bag')
    scenario.write_text(json.dumps(SCENE))
    result = run_tool('scenario_to_bag', str(scenario), path, '--images', '2', '--boxes')
    assert result.returncode == 0 and ': 2 images' in result.stdout
    simulator, messages = Simulator(scenario_from(SCENE)), messages_in(path)
    for number, message in enumerate(messages['/yolo_bounding_box']):
        boxes, (person,) = boxes2d_from_msg(message), simulator.frame(number).people
        assert boxes.stamp_ns == START_NS + number * NS // 10 and boxes.frame_id == 'camera_color_optical_frame'
        assert boxes.boxes.tolist() == [list(person.box_px)]
    assert len(messages['/yolo_bounding_box']) == 2
    assert run_tool('scenario_to_bag', str(scenario), path, '--images', '0').returncode == 2


def test_a_bag_is_read_by_image(session, tmp_path):
    path = str(tmp_path / 'session.bag')
    write_bag(session_images(session, SessionBagOptions(with_boxes=True)), path)
    topics = {'tf', 'camera/color/image_raw', 'yolo_bounding_box'}
    images = images_in(path, topics)
    assert len(images) == len(session.frames)
    for messages, frame in zip(images, session.frames):
        assert set(topic for topic, _message in messages) == topics
        np.testing.assert_array_equal(imgmsg_to_rgb(dict(messages)['camera/color/image_raw']),
                                      read_color(frame, session.camera))
    with pytest.raises(ValueError, match='ground_truth'):
        images_in(path, {'tf', 'ground_truth'})
    with pytest.raises(ValueError, match='ground_truth'):
        images_in(path, {'ground_truth'})
    with pytest.raises(ValueError, match='missing.bag'):
        images_in(str(tmp_path / 'missing.bag'), topics)


@pytest.mark.parametrize('option,named', [(('--rate', '0'), 'rate is 0'), (('--rate', 'nan'), 'rate is nan'),
                                          (('--seed', '-1'), 'seed is -1')])
def test_an_invalid_rate_or_seed_leaves_no_bag(tmp_path, option, named):
    scenario = tmp_path / 'scene.yaml'
    scenario.write_text(json.dumps(SCENE))
    result = run_tool('scenario_to_bag', str(scenario), str(tmp_path / 'out.bag'), *option)
    assert result.returncode == 1 and named in result.stdout and 'Traceback' not in result.stdout
    assert os.listdir(str(tmp_path)) == ['scene.yaml']


def test_an_invalid_scenario_leaves_no_bag_and_the_key_is_named(tmp_path):
    scenario = tmp_path / 'scene.yaml'
    scenario.write_text('people:\n- {strat: [1, 2]}\n')
    result = run_tool('scenario_to_bag', str(scenario), str(tmp_path / 'out.bag'))
    assert result.returncode == 1 and 'mean start' in result.stdout
    assert 'Traceback' not in result.stdout and os.listdir(str(tmp_path)) == ['scene.yaml']
