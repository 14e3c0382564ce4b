"""Graphs of commands of the README and of doc/. test_pages.py checks the launch arguments of all commands."""
import re
import subprocess
import sys

import yaml

from support.bags import scene_bag
from support.code_blocks import claimed

TRACKS, BOXES = 'ros_3d_bb/tracks:objects', 'ros_3d_bb/bb_3d:boxes'
# OpenCV's detector detects people at this distance from a camera at the height of a Jackal's.
SCENE = {'duration': 1.0, 'rate': 5.0, 'people': [{'start': [4.5, 0.3], 'facing': 3.1}]}
SIMULATION, DOCTOR = claimed('roslaunch ros_3d_bb simulation.launch scenario:='), claimed('rosrun ros_3d_bb doctor\n')
OWN_DETECTOR = claimed('import cv2, rospy', 'python')
BESIDE_DETECTOR = claimed('roslaunch ros_3d_bb pipeline.launch detector:=none')
PLANNER = claimed('roslaunch ros_3d_bb pipeline.launch weights:=$HOME/yolov5n.pt planner:=')
PLANNER_POINTS = claimed('rostopic echo -n 1 /planner_bridge_node')
TRACK_PRINTER = claimed('import rospy', 'python')
DIAGNOSTICS = claimed('rostopic echo -n 5 /diagnostics')
LIVE = [claimed('rosrun dynamic_reconfigure dynparam set /tracker_node ' + beginning) for beginning in ('pred', '"{')]
MOUNT = claimed('rosrun tf2_ros static_transform_publisher')
ON_NOETIC = claimed('sudo apt install ros-noetic-ros-base')
DESK = claimed('source ~/catkin_ws/devel/setup.bash\nroslaunch ros_3d_bb pipeline.launch')


def test_a_camera_on_a_desk(reader, tmp_path):
    """From the first package to tracks in RViz, with a driver that publishes no frames above camera_link."""
    path = scene_bag(tmp_path / 'scene.bag', dict(SCENE, duration=3.0))
    (reader.etc / 'setup.bash').touch()
    with reader.running(ON_NOETIC, DISPLAY=reader.screen(), READER_BAG=path) as graph:
        graph.hears('camera/color/camera_info')
        graph.start(['bash', '-c', reader.typed(DESK)], cwd=str(reader.home))
        graph.shows('RViz')
        graph.hears(TRACKS)


def test_another_detector(reader, tmp_path):
    path = scene_bag(tmp_path / 'scene.bag', SCENE)
    (tmp_path / 'detector.py').write_text(OWN_DETECTOR.text)
    with reader.running(BESIDE_DETECTOR) as graph:
        graph.starts_camera(path)
        graph.start([sys.executable, str(tmp_path / 'detector.py')])
        graph.hears('yolo_bounding_box:data', BOXES, TRACKS)


def test_commands_beside_the_pipeline(reader, camera_bag, tmp_path):
    """Planner points, diagnostics, live parameters, a mount that looks down, and a node that prints the tracks."""
    (tmp_path / 'printer.py').write_text(TRACK_PRINTER.text)
    with reader.running(PLANNER) as graph:
        graph.starts_camera(camera_bag)
        graph.hears('planner_bridge_node/points:width')
        master = {'ROS_MASTER_URI': graph.environment['ROS_MASTER_URI']}
        assert re.match(r'\d+\n---\n$', reader.types(PLANNER_POINTS, **master))
        assert 'values' in reader.types(DIAGNOSTICS, **master)
        graph.start([sys.executable, '-u', str(tmp_path / 'printer.py')])
        graph.waits(lambda: re.search(r'^person \d+ at [-\d.]+ [-\d.]+ in map', graph.output(), re.M), 'a track')
        for block in LIVE:
            reader.types(block, **master)
        printed = subprocess.check_output(['rosparam', 'get', '/tracker_node'], env=graph.environment)
        with reader.running(MOUNT, **master) as mount:
            mount.hears('tf_static:transforms')
    parameters = yaml.safe_load(printed)
    changed = [parameters[name] for name in ('prediction_time', 'confirmation_probability', 'max_position_std')]
    assert changed == [3.0, 0.95, 0.8]


def test_simulation_and_doctor(reader):
    with reader.running(SIMULATION, DISPLAY=reader.screen()) as graph:
        graph.shows('RViz')
        graph.hears(TRACKS, 'ground_truth:objects')
        printed = reader.types(DOCTOR, appended=' --patience 60', ROS_MASTER_URI=graph.environment['ROS_MASTER_URI'])
    assert 'doctor: no faults found' in printed
