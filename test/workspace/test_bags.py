import json
import os
import resource
import sys

import numpy as np
import pytest
import rosbag
from std_msgs.msg import String

from conftest import DATA
from ros_3d_bb.bags.bag_writer import write_bag
from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.conversions.camera_msgs import START_NS
from ros_3d_bb.conversions.image_msgs import imgmsg_to_depth, imgmsg_to_rgb
from ros_3d_bb.conversions.perception_msgs import boxes2d_from_msg, camera_from_msg, time_from, tracks_from_msg
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.detection.depth.ground_plane import fit_floor
from ros_3d_bb.sessions.session_reader import read_color, read_depth, read_session
from ros_3d_bb_lab.simulation.ros.scenario_to_bag import scenario_images, scenario_to_bag
from ros_3d_bb_lab.simulation.scenario import scenario_from
from ros_3d_bb_lab.simulation.simulator import Simulator
from support.bags import messages_in, session_images


@pytest.fixture(scope='module')
def session(session_folder):
    """The first frames of a session."""
    session = read_session(session_folder)
    return session._replace(frames=session.frames[:7])


@pytest.fixture(scope='module')
def messages(session, tmp_path_factory):
    """{topic: messages} of a bag at 10 Hz."""
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


@pytest.fixture
def run_tool(monkeypatch, capsys, tmp_path):
    """Runs a command in the folder of the test; returns its exit status and output."""
    def run(tool, *arguments):
        monkeypatch.chdir(str(tmp_path))
        monkeypatch.setattr(sys, 'argv', ['tool'] + [str(argument) for argument in arguments])
        try:
            tool()
            status = 0
        except SystemExit as error:
            status = error.code
        return status, ''.join(capsys.readouterr())
    return run


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
    (json.dumps(SCENE), ('--seed', '-1'), 'seed is -1'), ('people:\n- {strat: [1, 2]}', (), 'mean start')])
def test_an_invalid_scenario_leaves_no_bag_and_the_fault_is_named(tmp_path, run_tool, text, option, named):
    (tmp_path / 'scene.yaml').write_text(text)
    status, output = run_tool(scenario_to_bag, 'scene.yaml', 'out.bag', *option)
    assert status == 1 and named in output and os.listdir(str(tmp_path)) == ['scene.yaml']


def images_of_a_polished_floor():
    """Depth images in which the floor has no depth, with their cameras: recorded, or drawn without the data."""
    folder = os.path.join(DATA, 'data', 'tue_bags')
    if not os.path.isdir(folder):
        values = np.full((480, 640), np.nan, np.float32)
        values[60:460, 270:350], values[240:400, :90], values[140:300, 420:600] = 1.9, 2.2, 4.8
        yield DepthImage(values, 1.0), Camera(640, 480, 537.0, 537.5, 320.7, 227.7)
        return
    for name in sorted(os.listdir(folder)):
        with rosbag.Bag(os.path.join(folder, name)) as bag:
            by_kind = {getattr(message, 'encoding', 'camera_info'): message for _, message, _ in bag.read_messages()}
        yield imgmsg_to_depth(by_kind['32FC1']), camera_from_msg(by_kind['camera_info'])


def test_no_other_plane_is_taken_for_a_floor_without_depth():
    floors = [fit_floor(depth, camera) for depth, camera in images_of_a_polished_floor()]
    assert floors and floors == len(floors) * [None]


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
