"""Each command of the README and of doc/ that starts nodes, on its own master: its topics receive messages."""
import math
import re
import subprocess
import sys

import yaml

from ros_3d_bb.bags.bag_writer import write_bag
from ros_3d_bb_lab.simulation.ros.scenario_to_bag import scenario_images
from ros_3d_bb_lab.simulation.scenario import scenario_from
from support.code_blocks import claimed
from support.realsense_recordings import SUFFIX, colored, sloping_depth, write_recording

TRACKS, BOXES = 'ros_3d_bb/tracks:objects', 'ros_3d_bb/bb_3d:boxes'
IMAGES = 'camera/color/image_raw:data', 'camera/aligned_depth_to_color/image_raw:data', 'camera/color/camera_info:K'
MARKERS = 'visualization_marker_array:markers'
# OpenCV's detector detects people at this distance from a camera at the height of a Jackal's.
SCENE = {'duration': 1.0, 'rate': 5.0, 'people': [{'start': [4.5, 0.3], 'facing': 3.1}]}

JACKAL = claimed('roslaunch ros_3d_bb jackal.launch')
DESK = claimed('export ROS_MASTER_URI=http://192.168.131.1:11311')
PIPELINE = claimed('roslaunch ros_3d_bb pipeline.launch weights:=$HOME/yolov5n.pt\n')
REALSENSE = claimed('roslaunch ros_3d_bb realsense.launch\n')
TRIPOD = claimed('roslaunch ros_3d_bb pipeline.launch weights:=$HOME/yolov5n.pt rviz:=true')
PYREALSENSE = claimed('pip3 install pyrealsense2\n')
RECORDING = claimed('roslaunch ros_3d_bb realsense.launch file:=')
PLAYBACK = claimed('roslaunch ros_3d_bb playback.launch')
OWN_DETECTOR = claimed('import cv2, rospy', 'python')
TRACK_PRINTER = claimed('import rospy', 'python')
BESIDE_DETECTOR = claimed('roslaunch ros_3d_bb pipeline.launch detector:=none')
PLANNER = claimed('roslaunch ros_3d_bb pipeline.launch weights:=$HOME/yolov5n.pt planner:=')
PLANNER_POINTS = claimed('rostopic echo -n 1 /planner_bridge_node')
DIAGNOSTICS = claimed('rostopic echo -n 1 /diagnostics')
LIVE = [claimed('rosrun dynamic_reconfigure dynparam set /tracker_node ' + beginning) for beginning in ('pred', '"{')]
MOUNT = claimed('rosrun tf2_ros static_transform_publisher')
SLIDERS = claimed('rosrun rqt_reconfigure')
SIMULATION = claimed('roslaunch ros_3d_bb simulation.launch scenario:=')
DOCTOR = claimed('rosrun ros_3d_bb doctor\n')
GAZEBO = claimed('roslaunch ros_3d_bb gazebo.launch')
FRONT, REAR = (claimed('roslaunch ros_3d_bb realsense.launch camera:=' + name) for name in ('front', 'rear'))
BOTH = claimed('roslaunch ros_3d_bb pipeline.launch cameras:=front,rear')


def test_jackal_launch_starts_camera_tracker_and_planner_bridge(reader, camera_bag):
    with reader.running(JACKAL, READER_BAG=camera_bag) as graph:
        graph.start(['rosrun', 'tf2_ros', 'static_transform_publisher', *'0 0 0 0 0 0 odom base_link'.split()])
        graph.hears(TRACKS, 'planner_bridge_node/points:width')


def test_a_camera_mount_with_positive_pitch_looks_down(reader):
    with reader.running(PIPELINE) as robot:
        with reader.running(MOUNT, ROS_MASTER_URI=robot.environment['ROS_MASTER_URI']) as mount:
            mount.hears('tf_static:transforms')
            printed = subprocess.check_output(['rostopic', 'echo', '-n', '1', '/tf_static'], env=mount.environment)
    transform, = yaml.safe_load(printed.decode().split('---')[0])['transforms']
    assert (transform['header']['frame_id'], transform['child_frame_id']) == ('base_link', 'camera_link')
    rotation = transform['transform']['rotation']
    forward_z = 2 * (rotation['x'] * rotation['z'] - rotation['y'] * rotation['w'])
    assert abs(forward_z + math.sin(math.radians(20))) < 1e-3


def test_desk_launch_shows_rviz_on_the_master_of_the_robot(reader, camera_bag):
    with reader.running(PIPELINE) as robot:
        robot.starts_camera(camera_bag)
        robot.hears(TRACKS, MARKERS)
        master = robot.environment['ROS_MASTER_URI']
        with reader.running(DESK, replaced=[('http://192.168.131.1:11311', master), ('192.168.131.100', '127.0.0.1')],
                            ROS_MASTER_URI=master, DISPLAY=reader.screen()) as desk:
            desk.shows('RViz')


def test_realsense_and_pipeline_in_two_terminals(reader, camera_bag):
    with reader.running(REALSENSE, READER_BAG=camera_bag) as camera:
        camera.hears(*IMAGES)
        with reader.running(TRIPOD, ROS_MASTER_URI=camera.environment['ROS_MASTER_URI'],
                            DISPLAY=reader.screen()) as pipeline:
            pipeline.hears(TRACKS)
            pipeline.shows('RViz')


def test_without_the_driver_realsense_node_searches_for_the_camera(reader):
    with reader.running(PYREALSENSE) as graph:
        graph.says('no images of a RealSense')
    assert 'pip3 install pyrealsense2' in reader.log.read_text()


def test_recording_of_a_realsense(reader):
    path = write_recording(str(reader.home / ('some' + SUFFIX)), [colored(0)] * 3, [sloping_depth()] * 3)
    with reader.running(RECORDING, replaced=[('/path/to/some.bag', path)]) as graph:
        graph.hears(*IMAGES)


def test_playback_of_a_bag(reader, camera_bag):
    with reader.running(PLAYBACK, replaced=[('$HOME/some.bag', camera_bag)], DISPLAY=reader.screen()) as graph:
        graph.shows('RViz')
        graph.hears(TRACKS)


def test_another_detector(reader, tmp_path):
    write_bag(scenario_images(scenario_from(SCENE)), str(tmp_path / 'scene.bag'))
    (tmp_path / 'detector.py').write_text(OWN_DETECTOR.text)
    with reader.running(BESIDE_DETECTOR) as graph:
        graph.starts_camera(str(tmp_path / 'scene.bag'))
        graph.start([sys.executable, str(tmp_path / 'detector.py')])
        graph.hears('yolo_bounding_box:data', BOXES, TRACKS)


def test_a_node_prints_the_tracks(reader, camera_bag, tmp_path):
    (tmp_path / 'printer.py').write_text(TRACK_PRINTER.text)
    with reader.running(PIPELINE) as graph:
        graph.starts_camera(camera_bag)
        graph.hears(TRACKS)
        printer = subprocess.Popen([sys.executable, '-u', str(tmp_path / 'printer.py')], env=graph.environment,
                                   stdout=subprocess.PIPE, universal_newlines=True)
        try:
            assert re.match(r'person \d+ at [-\d.]+ [-\d.]+ in map, [-\d.]+ m/s to x', printer.stdout.readline())
        finally:
            printer.terminate()
            printer.wait()


def test_planner_points_diagnostics_and_live_parameters(reader, camera_bag):
    with reader.running(PLANNER) as graph:
        graph.starts_camera(camera_bag)
        graph.hears('planner_bridge_node/points:width')
        master = {'ROS_MASTER_URI': graph.environment['ROS_MASTER_URI']}
        assert re.match(r'\d+\n---\n$', reader.types(PLANNER_POINTS, **master))
        assert 'values' in reader.types(DIAGNOSTICS, **master)
        for block in LIVE + [SLIDERS]:
            reader.types(block, **master)
        printed = subprocess.check_output(['rosparam', 'get', '/tracker_node'], env=graph.environment)
    parameters = yaml.safe_load(printed)
    changed = [parameters[name] for name in ('prediction_time', 'confirmation_probability', 'max_position_std')]
    assert changed == [3.0, 0.95, 0.8]


def test_simulation_and_doctor(reader):
    with reader.running(SIMULATION, DISPLAY=reader.screen()) as graph:
        graph.shows('RViz')
        graph.hears(TRACKS, 'ground_truth:objects')
        printed = reader.types(DOCTOR, appended=' --patience 60', ROS_MASTER_URI=graph.environment['ROS_MASTER_URI'])
    assert 'doctor: no faults found' in printed


def test_gazebo(reader, camera_bag):
    """With stand-ins for Gazebo and Jackal; a bag replaces the camera."""
    with reader.running(GAZEBO, DISPLAY=reader.screen()) as graph:
        graph.starts_camera(camera_bag)
        graph.hears(TRACKS)
        description = subprocess.check_output(['rosparam', 'get', '/robot_description'], env=graph.environment)
    assert b'camera_color_optical_frame' in description


def test_two_realsenses_and_one_tracker(reader, camera_bag):
    """Both cameras play the same bag, in one frame."""
    with reader.running(FRONT, READER_BAG=camera_bag) as front:
        front.hears(*(topic.replace('camera/', 'front/', 1) for topic in IMAGES))
        on_it = {'ROS_MASTER_URI': front.environment['ROS_MASTER_URI']}
        front.start(['rosrun', 'tf2_ros', 'static_transform_publisher',
                     *'0 0 1 -0.5 0.5 -0.5 0.5 map camera_color_optical_frame'.split()])
        with reader.running(REAR, READER_BAG=camera_bag, **on_it) as rear, \
                reader.running(BOTH, DISPLAY=reader.screen(), **on_it) as both:
            rear.hears(*(topic.replace('camera/', 'rear/', 1) for topic in IMAGES))
            both.hears('front/' + BOXES, 'rear/' + BOXES, TRACKS, MARKERS)
            both.shows('RViz')
            serial = subprocess.check_output(['rosparam', 'get', '/stub/serial_no'], env=both.environment)
    assert serial.decode().strip() == 'NUMBER_OF_THE_OTHER'
