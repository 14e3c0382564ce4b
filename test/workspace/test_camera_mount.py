import argparse
import re
from unittest import mock

import numpy as np
import pytest
import roslaunch
from sensor_msgs.msg import Image
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from ros_3d_bb.bags.bag_pipeline import process_bag
from ros_3d_bb.bags.bag_writer import write_bag
from ros_3d_bb.bags.process_bag import _parser, _settings_from, main
from ros_3d_bb.camera.camera_model import transform_from
from ros_3d_bb.camera.images import DepthImage, mounted_camera, turned_camera, turned_image, turned_rotation
from ros_3d_bb.conversions.camera_msgs import (DEPTH_TOPIC, INFO_TOPICS, START_NS, CameraFrame, image_messages_of,
                                               messages_of, transform_messages)
from ros_3d_bb.conversions.image_msgs import fill_image
from ros_3d_bb.conversions.perception_msgs import boxes2d_from_msg, time_from, tracks_from_msg, transform_from_msg
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.detection.boxes import Detections
from ros_3d_bb.detection.detector import DetectorParams
from ros_3d_bb.nodes.camera_pose_node import CameraPoseNode
from ros_3d_bb.nodes.doctor import bag_findings
from ros_3d_bb.pipeline.detection_stage import CameraRotation, detect_in_color
from ros_3d_bb_lab.simulation.scenario import scenario_from
from ros_3d_bb_lab.simulation.simulator import Simulator
from support.bags import changed_bag, messages_in
from support.commands import run
from support.launching import loaded
from support.masterless import masterless

HEIGHT_M, TILT_RAD, ROLL_RAD, FRAME = 1.2, 0.1, np.radians(12), 'camera_color_optical_frame'
PEOPLE = [{'start': [2.6, -0.5], 'moves': [{'to': [3.4, 0.9]}]}, {'start': [3.6, 0.8], 'moves': [{'to': [3.4, -0.9]}]},
          {'start': [4.4, -0.8], 'facing': 2.0}]
SCENE = {'duration': 0.8, 'rate': 10.0, 'robot': {'mount': [0.0, 0.0, HEIGHT_M - 0.065], 'pitch': TILT_RAD},
         'people': [{'start': [3.0, 0.5], 'moves': [{'to': [3.0, -1.0]}]}, {'start': [4.0, -0.8], 'facing': 2.0}]}


class RolledSimulator(Simulator):
    """A camera whose right side is lower, and three people for 3 s at 10 Hz. The map is on the floor below."""

    def __init__(self):
        super(RolledSimulator, self).__init__(scenario_from({
            'duration': 3.0, 'rate': 10.0, 'people': PEOPLE,
            'robot': {'mount': [0.0, 0.0, HEIGHT_M - 0.065], 'pitch': TILT_RAD}}))

    def poses(self, state, camera_index=0):
        poses, rolled = super(RolledSimulator, self).poses(state, camera_index), np.eye(4)
        rolled[:3, :3] = [[np.cos(ROLL_RAD), -np.sin(ROLL_RAD), 0], [np.sin(ROLL_RAD), np.cos(ROLL_RAD), 0], [0, 0, 1]]
        return poses._replace(base_from_camera=poses.base_from_camera.dot(rolled))


def images(frames, camera, turns, with_tf):
    """The messages of each image of a camera that has to be turned to make its images upright."""
    turned = np.eye(4)
    turned[:3, :3] = turned_rotation(turns)
    for frame in frames:
        stamp_ns = START_NS + int(frame.time_s * NS)
        header = Header(stamp=time_from(stamp_ns), frame_id=FRAME)
        color, depth_mm = (turned_image(image, -turns % 4) for image in (frame.color, frame.depth_mm))
        taken = CameraFrame(header, turned_camera(camera, -turns % 4), color, DepthImage(depth_mm, 0.001),
                            [('map', 'base_link', frame.poses.map_from_odom.dot(frame.poses.odom_from_base)),
                             ('base_link', FRAME, frame.poses.base_from_camera.dot(turned))])
        yield stamp_ns, list(messages_of(taken) if with_tf else image_messages_of(taken))


@pytest.fixture(scope='module')
def recorded():
    """Writes a bag of the scene, given the quarter turns that make its images upright."""
    simulator = Simulator(scenario_from(SCENE))
    frames = [simulator.frame(number) for number in range(simulator.frame_count)]
    return lambda path, turns=0, with_tf=True: write_bag(images(frames, simulator.camera, turns, with_tf), str(path))


def processed(folder, *options):
    """Messages by topic of the output of process_bag, with the counters of its events."""
    bags = str(folder / 'in.bag'), str(folder / 'out.bag')
    given = _parser().parse_args(bags + ('--detector', 'depth') + options)
    events = process_bag(*bags, _settings_from(given))
    found = messages_in(folder / 'out.bag', '/yolo_bounding_box', '/ros_3d_bb/tracks')
    return found, events


def positions_and_sizes(found):
    return np.array([[np.hstack((track.position_m, track.size_m)) for track in tracks_from_msg(message)]
                     for message in found['/ros_3d_bb/tracks'][-3:]])


@pytest.fixture(scope='module')
def rolled(tmp_path_factory):
    """Folder with a bag of a RolledSimulator, and the true positions (n, 2) of the people in its last image."""
    simulator, folder = RolledSimulator(), tmp_path_factory.mktemp('rolled')
    frames = [simulator.frame(number) for number in range(simulator.frame_count)]
    write_bag(images(frames, simulator.camera, 0, with_tf=False), str(folder / 'in.bag'))
    return folder, np.array([person.position_m[:2] for person in frames[-1].people])


@pytest.fixture(scope='module')
def upright(recorded, tmp_path_factory):
    folder = tmp_path_factory.mktemp('upright')
    recorded(folder / 'in.bag')
    return processed(folder)[0]


@pytest.mark.parametrize('turns, with_tf', [(1, True), (2, False), (3, False)])
def test_a_rotated_camera_gives_the_same_positions(recorded, upright, tmp_path, turns, with_tf):
    """Height, tilt and rotation replace tf."""
    options = '--camera-height %s --camera-tilt %s --image-rotation %d' % (HEIGHT_M, TILT_RAD, 90 * turns)
    recorded(tmp_path / 'in.bag', turns, with_tf)
    found, events = processed(tmp_path, *() if with_tf else options.split())
    assert not events.sentences and found['/ros_3d_bb/tracks'][-1].header.frame_id == 'map'
    expected = positions_and_sizes(upright)
    assert expected.shape == (3, 2, 6)
    np.testing.assert_allclose(positions_and_sizes(found), expected, atol=0.01)


def test_the_roll_of_a_camera_is_given_or_fitted_to_the_floor(rolled):
    """The same people, at their true positions. Without the roll, the detector corrects the floor of tf."""
    folder, truth_m = rolled
    given = '--camera-height', str(HEIGHT_M), '--camera-tilt', str(TILT_RAD)
    found = {options: processed(folder, *options)[0] for options in (
        given, given + ('--camera-roll', str(ROLL_RAD)), ('--camera-pose', 'floor'))}
    without, with_roll, fitted = (sum(len(boxes2d_from_msg(message).boxes) for message in found[options][
        '/yolo_bounding_box']) for options in found)
    assert max(without, with_roll, fitted) - min(without, with_roll, fitted) <= 3
    for options in list(found)[1:]:
        last = tracks_from_msg(found[options]['/ros_3d_bb/tracks'][-1])
        tracks_m = np.array([track.position_m[:2] for track in last])
        apart_m = np.linalg.norm(tracks_m[:, None] - truth_m, axis=2)
        assert apart_m.shape == (3, 3) and apart_m.min(axis=0).max() < 0.15, options


def doctor_on(path):
    """The facts and faults {subject: text} that the doctor finds in a bag, and the next command."""
    given = argparse.Namespace(bag=str(path), camera='', target_frame='', depth='aligned')
    found, command, _purpose = bag_findings(given)
    return {finding.subject: finding.fault or finding.fact for finding in found}, command


@pytest.mark.parametrize('turns, late_ns', [(1, 0), (3, 20000000)])
def test_the_doctor_notices_a_rotated_camera_without_tf(recorded, tmp_path, turns, late_ns):
    """Whether or not its colour and depth images have the same stamps."""
    recorded(tmp_path / 'same.bag', turns, with_tf=False)

    def late(topic, message, time):
        if topic == '/' + DEPTH_TOPIC:
            message.header.stamp = time = time_from(time.to_nsec() + late_ns)
        return topic, message, time
    changed_bag(tmp_path / 'same.bag', tmp_path / 'in.bag', late)
    found, command = doctor_on(tmp_path / 'in.bag')
    assert 'turned clockwise by %d degrees' % (90 * turns) in found['image rotation']
    options = re.search(r'--camera-height (\S+) --camera-tilt (\S+) --image-rotation (\d+)', command)
    assert list(map(float, options.groups())) == pytest.approx([HEIGHT_M, TILT_RAD, 90 * turns], abs=0.02)


class PoseRig(object):
    """camera_pose_node, and images of the standing person of `recorded`, four in a second."""

    def __init__(self, connections, folder):
        self.connections, self.node, self.stamp_ns = connections, CameraPoseNode(), START_NS
        self._messages = {topic: messages[-1] for topic, messages in messages_in(folder / 'in.bag').items()}

    def send(self, count):
        """Send images. Returns the published TransformStamped; None without one."""
        for _image in range(count):
            self.stamp_ns += NS // 4
            for name in INFO_TOPICS[0], DEPTH_TOPIC:
                message = self._messages['/' + name]
                message.header.stamp = time_from(self.stamp_ns)
                if not self.connections.subscribers[name].unregister.called:
                    self.connections.send(name, message)
        message = self.connections.publishers['/tf_static'].newest
        return None if message is None else message.transforms[0]

    def add_transform(self, parent, child, pose):
        self.connections.send('/tf', TFMessage(transform_messages(time_from(START_NS), [(parent, child, pose)])))


def assert_same_pose(pose, expected):
    """Within 0.05 m and 1 degree."""
    between = np.linalg.inv(expected).dot(pose)
    assert np.linalg.norm(between[:3, 3]) < 0.05
    assert np.arccos(min((np.trace(between[:3, :3]) - 1) / 2, 1)) < np.radians(1)


def test_the_pose_is_that_of_the_root_of_the_driver_and_replaces_none(recorded, tmp_path):
    recorded(tmp_path / 'in.bag', with_tf=False)
    link_from_camera = transform_from((0.1, 0.02, 0.0), (0.5, -0.5, 0.5, -0.5))
    with masterless() as connections:
        rig = PoseRig(connections, tmp_path)
        rig.add_transform('camera_link', FRAME, link_from_camera)
        assert rig.send(7) is None
        link = rig.send(5)
        assert connections.publishers['/tf_static'].count == 1
    assert (link.header.frame_id, link.child_frame_id) == ('map', 'camera_link')
    assert_same_pose(transform_from_msg(link).dot(link_from_camera), mounted_camera(HEIGHT_M, TILT_RAD, 0))
    with masterless() as connections:
        rig = PoseRig(connections, tmp_path)
        rig.add_transform('map', FRAME, np.eye(4))
        assert rig.send(8) is None
        counts = rig.node._diagnostics.counts
        assert counts['images processed'] == 8 and counts['depth images rejected'] == 1


@pytest.mark.parametrize('options, complaint', [
    ('--target-frame camera_color_optical_frame', 'is an optical frame'),
    ('--camera-height -1', 'more than 0'), ('--camera-height 1 --camera-tilt 2', 'less than pi / 2 rad'),
    ('--camera-height 1 --cameras a,b', 'a single camera only'), ('--camera-tilt 0.1', 'without --camera-height'),
    ('--camera-height 1 --camera-roll 1.6', 'less than pi / 4 rad'),
    ('--camera-pose floor --camera-height 1', 'one of them expected')])
def test_unusable_mounts_are_rejected(recorded, tmp_path, options, complaint):
    recorded(tmp_path / 'in.bag', with_tf=False)
    status, printed = run(main, tmp_path / 'in.bag', tmp_path / 'out.bag', '--detector', 'depth', *options.split())
    assert status and complaint in printed and not (tmp_path / 'out.bag').exists()


@pytest.mark.parametrize('turns', [0, 1, 2, 3])
def test_yolov5_sees_upright_images_once_tf_is_known(turns):
    image, known = np.random.RandomState(0).randint(0, 255, (12, 20, 3), np.uint8), []
    received = np.ascontiguousarray(turned_image(image, -turns % 4))
    message = fill_image(Image(header=Header(stamp=time_from(NS), frame_id='optical')), received, 'rgb8')
    camera_from_floor = np.linalg.inv(mounted_camera(1.0, 0.2, turns))
    transforms = mock.Mock(lookup=lambda *_arguments: camera_from_floor)
    rotation = CameraRotation(DetectorParams(), transforms, lambda: known.append(True))
    assert rotation.turns('optical') == turns and rotation.turns('optical') == turns and known == [True]
    found = Detections(np.array([[1.0, 2.0, 4.0, 9.0]]), np.array([0.9]), np.array([0]))
    detector = mock.Mock(detect=mock.Mock(return_value=found))
    shown, detections = detect_in_color(detector, message, turns)
    np.testing.assert_array_equal(detector.detect.call_args[0][0], image)
    np.testing.assert_array_equal(shown, received)
    x1, y1, x2, y2 = detections.boxes[0].astype(int)
    np.testing.assert_array_equal(turned_image(received[y1:y2, x1:x2], turns), image[2:9, 1:4])


def pose_in(arguments):
    """Transform (4, 4), parent and child of a static_transform_publisher x y z yaw pitch roll."""
    x, y, z, *angles = map(float, arguments[:6])
    pose = transform_from((x, y, z), (0, 0, 0, 1))
    for axis, angle in zip(((0, 0, 1), (0, 1, 0), (1, 0, 0)), angles):
        pose = pose.dot(transform_from((0, 0, 0), np.append(np.sin(angle / 2) * np.array(axis), np.cos(angle / 2))))
    return (pose,) + tuple(arguments[6:])


@pytest.mark.parametrize('degrees', ['auto', '90'])
def test_launch_arguments_publish_the_pose_of_a_camera_alone(degrees):
    parameters, nodes = loaded('pipeline.launch', 'detector:=depth', 'camera_height:=1.2', 'camera_tilt:=0.1',
                               'camera_roll:=0.2', 'image_rotation:=' + degrees, 'frame_id:=optical')
    mount, parent, child = pose_in(nodes['camera_pose'].args.split())
    optical, child_parent, camera = pose_in(nodes['camera_optical_frame'].args.split())
    assert (parent, child, camera) == ('map', child_parent, 'optical')
    turns = 0 if degrees == 'auto' else int(degrees) // 90
    np.testing.assert_allclose(mount.dot(optical), mounted_camera(1.2, 0.1, turns, 0.2), atol=1e-6)
    assert parameters['/bbox3d_node/floor_frame'] == parameters['/detector_node/floor_frame'] == 'map'
    assert parameters['/detector_node/floor_height'] == 0
    assert parameters['/bbox3d_node/image_rotation'] == degrees


@pytest.mark.parametrize('launch_file, given, named', [
    ('pipeline.launch', ['cameras:=front,rear', 'camera_height:=1.2'], ['cameras', 'camera_height']),
    ('pipeline.launch', ['cameras:=front,rear', 'frame_id:=optical'], ['cameras', 'frame_id']),
    ('pipeline.launch', ['camera_tilt:=0.1'], ['camera_height', 'camera_tilt']),
    ('pipeline.launch', ['camera_pose:=wall'], ['camera_pose', 'floor']),
    ('playback.launch', ['bag:=/b.bag', 'camera_pose:=floor', 'camera_height:=1.2'], ['camera_pose', 'camera_height']),
    ('pipeline.launch', ['cameras:=front,rear', 'camera_pose:=floor'], ['cameras', 'camera_pose']),
    ('measure.launch', ['session:=/s', 'camera_root:=camera_link'], ['camera_height', 'camera_root']),
    ('pipeline.launch', ['camera_height:=1,2'], ['camera_height', '1,2', 'metres']),
    ('measure.launch', ['session:=/s', 'camera_height:=1', 'camera_tilt:=20'], ['camera_tilt', '20', 'radians']),
    ('jackal.launch', ['driver:=none', 'mount:=0.1 0 0,4 0 0 0'], ['mount', '0,4', 'six numbers']),
    ('jackal.launch', ['driver:=realsense'], ['driver', 'realsense2_camera', 'pyrealsense2']),
    ('realsense.launch', ['file:=/a.bag', 'driver:=realsense2_camera'], ['file', 'driver', 'pyrealsense2'])])
def test_unusable_launch_arguments_are_refused(launch_file, given, named):
    with pytest.raises(roslaunch.RLException) as error:
        loaded(launch_file, *given)
    sentence = str(error.value).split('Arg xml')[0]
    assert all(name in sentence for name in named + ['expected'])
