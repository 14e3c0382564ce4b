"""Cameras that are rotated, tilted, or without tf: the same positions as from an upright camera on a robot."""
import numpy as np
import pytest
import rosbag
import roslaunch
from sensor_msgs.msg import Image
from std_msgs.msg import Header

from ros_3d_bb.bags.bag_pipeline import process_bag
from ros_3d_bb.bags.bag_writer import write_bag
from ros_3d_bb.bags.process_bag import _parser, _settings_from, main
from ros_3d_bb.camera.camera_model import transform_from
from ros_3d_bb.camera.depth_image import DepthImage
from ros_3d_bb.camera.image_rotation import mounted_camera, turned_camera, turned_image, turned_rotation
from ros_3d_bb.conversions.camera_msgs import START_NS, CameraFrame, image_messages_of, messages_of
from ros_3d_bb.conversions.image_msgs import fill_image
from ros_3d_bb.conversions.perception_msgs import boxes2d_from_msg, time_from, tracks_from_msg
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.detection.boxes import Detections
from ros_3d_bb.pipeline.detection_stage import CameraRotation, Yolov5NodeParams, detect_in_color
from ros_3d_bb_lab.simulation.scenario import scenario_from
from ros_3d_bb_lab.simulation.simulator import Simulator
from support.launching import loaded

HEIGHT_M, TILT_RAD, FRAME = 1.2, 0.1, 'camera_color_optical_frame'
SCENE = {'duration': 0.8, 'rate': 10.0, 'robot': {'mount': [0.0, 0.0, HEIGHT_M - 0.065], 'pitch': TILT_RAD},
         'people': [{'start': [3.0, 0.5], 'moves': [{'to': [3.0, -1.0]}]}, {'start': [4.0, -0.8], 'facing': 2.0}]}


@pytest.fixture(scope='module')
def recorded():
    """Returns the path of a bag of the scene, given the quarter turns that make its images upright."""
    simulator = Simulator(scenario_from(SCENE))
    frames = [simulator.frame(number) for number in range(simulator.frame_count)]

    def images(turns, with_tf):
        rolled = np.eye(4)
        rolled[:3, :3] = turned_rotation(turns)
        for frame in frames:
            stamp_ns = START_NS + int(frame.time_s * NS)
            header = Header(stamp=time_from(stamp_ns), frame_id=FRAME)
            color, depth_mm = (turned_image(image, -turns % 4) for image in (frame.color, frame.depth_mm))
            taken = CameraFrame(header, turned_camera(simulator.camera, -turns % 4), color, DepthImage(depth_mm, 0.001),
                                [('map', 'base_link', frame.poses.map_from_odom.dot(frame.poses.odom_from_base)),
                                 ('base_link', FRAME, frame.poses.base_from_camera.dot(rolled))])
            yield stamp_ns, list(messages_of(taken) if with_tf else image_messages_of(taken))
    return lambda path, turns=0, with_tf=True: write_bag(images(turns, with_tf), str(path))


def processed(folder, *options):
    """Messages by topic of the output of process_bag, with the counters of its events."""
    bags = str(folder / 'in.bag'), str(folder / 'out.bag')
    given = _parser().parse_args(bags + ('--detector', 'depth') + options)
    events = process_bag(*bags, _settings_from(given))
    found = {}
    with rosbag.Bag(str(folder / 'out.bag')) as bag:
        for topic, message, _time in bag.read_messages(['/yolo_bounding_box', '/ros_3d_bb/tracks']):
            found.setdefault(topic, []).append(message)
    return found, events


def positions_and_sizes(found):
    return np.array([[np.hstack((track.position_m, track.size_m)) for track in tracks_from_msg(message)]
                     for message in found['/ros_3d_bb/tracks'][-3:]])


@pytest.fixture(scope='module')
def upright(recorded, tmp_path_factory):
    folder = tmp_path_factory.mktemp('upright')
    recorded(folder / 'in.bag')
    return processed(folder)[0]


@pytest.mark.parametrize('turns', [1, 2, 3])
def test_a_rotated_camera_gives_the_same_positions(recorded, upright, tmp_path, turns):
    recorded(tmp_path / 'in.bag', turns)
    found, events = processed(tmp_path)
    expected = positions_and_sizes(upright)
    assert expected.shape == (3, 2, 6) and not events.sentences
    np.testing.assert_allclose(positions_and_sizes(found), expected, atol=0.01)
    boxes, upright_boxes = (boxes2d_from_msg(each['/yolo_bounding_box'][-1]).boxes for each in (found, upright))
    sides, upright_sides = (each[:, 2:] - each[:, :2] for each in (boxes, upright_boxes))
    np.testing.assert_allclose(sides[:, ::-1] if turns % 2 else sides, upright_sides, atol=1)


@pytest.mark.parametrize('turns', [0, 1, 2, 3])
def test_height_tilt_and_rotation_replace_tf(recorded, upright, tmp_path, turns):
    recorded(tmp_path / 'in.bag', turns, with_tf=False)
    found, _events = processed(tmp_path, '--camera-height', str(HEIGHT_M), '--camera-tilt', str(TILT_RAD),
                               '--image-rotation', str(90 * turns))
    assert found['/ros_3d_bb/tracks'][-1].header.frame_id == 'map'
    np.testing.assert_allclose(positions_and_sizes(found), positions_and_sizes(upright), atol=0.01)


@pytest.mark.parametrize('options, complaint', [
    ('--target-frame camera_color_optical_frame', 'is an optical frame'),
    ('--camera-height -1', 'more than 0'), ('--camera-height 1 --camera-tilt 2', 'less than pi / 2 rad'),
    ('--camera-height 1 --cameras a,b', 'a single camera only'), ('--camera-tilt 0.1', 'without --camera-height'),
    ('--camera-roll 0.1', 'without --camera-height'), ('--camera-height 1 --camera-roll 1.6', 'less than pi / 4 rad'),
    ('--image-rotation 45', 'invalid choice')])
def test_unusable_mounts_are_rejected(recorded, tmp_path, capfd, options, complaint):
    recorded(tmp_path / 'in.bag', with_tf=False)
    with pytest.raises(SystemExit) as error:
        main([str(tmp_path / 'in.bag'), str(tmp_path / 'out.bag'), '--detector', 'depth'] + options.split())
    assert error.value.code and complaint in capfd.readouterr().err and not (tmp_path / 'out.bag').exists()


class Detector(object):
    """Detects one box in an upright image."""

    def detect(self, image):
        self.image = image
        return Detections(np.array([[1.0, 2.0, 4.0, 9.0]]), np.array([0.9]), np.array([0]))


@pytest.mark.parametrize('turns', [0, 1, 2, 3])
def test_yolov5_sees_upright_images_once_tf_is_known(turns):
    image, known = np.random.RandomState(0).randint(0, 255, (12, 20, 3), np.uint8), []
    received = np.ascontiguousarray(turned_image(image, -turns % 4))
    message = fill_image(Image(header=Header(stamp=time_from(NS), frame_id='optical')), received, 'rgb8')
    camera_from_floor = np.linalg.inv(mounted_camera(1.0, 0.2, turns))
    transforms = type('Transforms', (), {'lookup': lambda *_arguments: camera_from_floor})()
    rotation = CameraRotation(Yolov5NodeParams(), transforms, lambda: known.append(True))
    assert rotation.turns('optical') == turns and rotation.turns('optical') == turns and known == [True]
    detector = Detector()
    shown, detections = detect_in_color(detector, message, turns)
    np.testing.assert_array_equal(detector.image, image)
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


@pytest.mark.parametrize('degrees', ['auto', '0', '90', '180', '270'])
def test_launch_arguments_publish_the_pose_of_a_camera_alone(degrees):
    parameters, nodes = loaded('pipeline.launch', 'detector:=depth', 'camera_height:=1.2', 'camera_tilt:=0.1',
                               'camera_roll:=0.2', 'image_rotation:=' + degrees, 'frame_id:=optical')
    mount, parent, child = pose_in(nodes['camera_pose'].args.split())
    optical, child_parent, camera = pose_in(nodes['camera_optical_frame'].args.split())
    assert (parent, child, camera) == ('map', child_parent, 'optical')
    turns = 0 if degrees == 'auto' else int(degrees) // 90
    np.testing.assert_allclose(mount.dot(optical), mounted_camera(1.2, 0.1, turns, 0.2), atol=1e-6)
    assert parameters['/bbox3d_node/floor_frame'] == parameters['/depth_detector_node/floor_frame'] == 'map'
    assert parameters['/depth_detector_node/floor_height'] == 0
    assert parameters['/bbox3d_node/image_rotation'] == degrees


def test_the_transform_that_the_doctor_advises_is_that_of_the_arguments():
    pose, _parent, _child = pose_in('0 0 1.2 -1.5708 0 -1.6708 map optical'.split())
    np.testing.assert_allclose(pose, mounted_camera(1.2, 0.1, 0), atol=1e-4)


@pytest.mark.parametrize('launch_file, given, named', [
    ('pipeline.launch', ['cameras:=front,rear', 'camera_height:=1.2'], ['cameras', 'camera_height']),
    ('pipeline.launch', ['cameras:=front', 'camera_height:=1.2'], ['cameras', 'camera_height']),
    ('playback.launch', ['bag:=/b.bag', 'cameras:=front,rear', 'camera_height:=1.2'], ['cameras', 'camera_height']),
    ('jackal.launch', ['driver:=none', 'cameras:=front,rear', 'camera_height:=1.2'], ['cameras', 'camera_height']),
    ('pipeline.launch', ['cameras:=front,rear', 'frame_id:=optical'], ['cameras', 'frame_id']),
    ('pipeline.launch', ['camera_tilt:=0.1'], ['camera_height', 'camera_tilt']),
    ('pipeline.launch', ['camera_roll:=0.1'], ['camera_height', 'camera_roll']),
    ('measure.launch', ['session:=/s', 'camera_root:=camera_link'], ['camera_height', 'camera_root']),
    ('pipeline.launch', ['detector:=yolo5'], ['detector', 'yolo5']),
    ('pipeline.launch', ['cameras:=front,rear', 'detector:=yolo5'], ['detector', 'yolo5']),
    ('jackal.launch', ['driver:=realsense'], ['driver', 'realsense2_camera', 'pyrealsense2']),
    ('realsense.launch', ['file:=/a.bag', 'driver:=realsense2_camera'], ['file', 'driver', 'pyrealsense2'])])
def test_unusable_launch_arguments_are_refused(launch_file, given, named):
    with pytest.raises(roslaunch.RLException) as error:
        loaded(launch_file, *given)
    sentence = str(error.value).split('Arg xml')[0]
    assert all(name in sentence for name in named + ['expected'])
