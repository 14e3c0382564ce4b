"""Commands and code of the README and of doc/: the first steps are run, and tools know the options of all commands.

test_pages.py checks the arguments of launch files.
"""
import argparse
import contextlib
import io
import os
import re
import runpy
import shlex
import sys
from unittest import mock

import pytest
import yaml
from sensor_msgs.msg import Image
from std_msgs.msg import Int32MultiArray, MultiArrayDimension

from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, DEPTH_TOPIC, INFO_TOPICS, STATIC_TOPIC, TF_TOPIC
from ros_3d_bb.conversions.image_msgs import fill_image
from ros_3d_bb.conversions.perception_msgs import BOXES_TOPIC, TRACKS_TOPIC, boxes2d_from_msg
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.detection.boxes import iou
from ros_3d_bb.detection.weights import names_beside
from ros_3d_bb.msg import TrackedObjectArray
from ros_3d_bb_lab.evaluation import __main__ as bench
from ros_3d_bb_lab.evaluation.noise import __main__ as noise
from ros_3d_bb_lab.simulation.scenario import scenario_from
from ros_3d_bb_lab.simulation.simulator import Simulator
from support.bags import scene_bag
from support.code_blocks import BLOCKS, ROOT, claimed
from support.masterless import masterless
from support.ros import header_at, person

# OpenCV's detector detects people at this distance from a camera at the height of a Jackal's.
SCENE = {'duration': 3.0, 'rate': 5.0, 'people': [{'start': [4.5, 0.3], 'facing': 3.1}]}
ON_NOETIC = claimed('sudo apt install ros-noetic-ros-base')
DESK = claimed('source ~/catkin_ws/devel/setup.bash\nroslaunch ros_3d_bb pipeline.launch')
DEMO_AND_TESTS = claimed('./run demo\n./run test')
RECORD = claimed('rosbag record -O my.bag ')
OWN_DETECTOR, TRACK_PRINTER = claimed('import cv2, rospy', 'python'), claimed('import rospy', 'python')
STAMPED = claimed('message = Int32MultiArray', 'python')
MODEL_NAMES = claimed('# people_yolov7.yaml', 'yaml')


@pytest.mark.slow
def test_a_camera_on_a_desk(reader, tmp_path):
    """From the first package to tracks in RViz, with a driver that publishes no frames above camera_link."""
    path = scene_bag(tmp_path / 'scene.bag', SCENE)
    (reader.etc / 'setup.bash').touch()
    with reader.running(ON_NOETIC, DISPLAY=reader.screen(), READER_BAG=path) as graph:
        graph.hears('camera/color/camera_info')
        graph.start(['bash', '-c', reader.typed(DESK)], cwd=str(reader.home))
        graph.shows('RViz')
        graph.hears('ros_3d_bb/tracks:objects')


@pytest.mark.slow
def test_demo_writes_table_image_and_bag_and_the_tests_start(reader):
    """Of a short scene, without the archives of the planners, which `./run test` would build, in some minutes."""
    path = reader.clone / 'config' / 'scenarios' / 'demo.yaml'
    path.write_text(yaml.safe_dump(dict(yaml.safe_load(path.read_text()), duration=3.0, rate=4.0)))
    printed = reader.types(DEMO_AND_TESTS, reader.clone, ROS_3D_BB_DATA='')
    assert 'people are found by depth' in printed and 'running all tests' in printed
    for kind in ('bag', 'png'):
        path, = re.findall(r'(/\S+\.%s)' % kind, printed.split('what became of it')[1])[:1]
        assert os.path.exists(path)
    assert 'catkin_make --directory' in reader.log.read_text()


def commands_of_tools():
    """(tool, words) of the commands on all pages; the tool of a benchmark is `bench`, with its name as first word."""
    for line in [line for block in BLOCKS for line in block.text.replace('\\\n', '').splitlines()]:
        line = re.sub(r'\$\(.*?\)', 'PATH', line)
        for tool, options in re.findall(r'(?:rosrun ros_3d_bb|\./run) (\w+)([^|&;<>#]*)', line):
            if tool in ('bench', 'noise') or 'rosrun' in line and tool.endswith(('_bag', '_report', 'doctor')):
                yield tool, shlex.split(options.split(':::')[0])  # which GNU parallel reads


class Parsed(Exception):
    """The options of a command are valid."""


@pytest.mark.parametrize('tool, words', commands_of_tools())
def test_tools_have_the_options_of_commands(monkeypatch, tool, words):
    parse = argparse.ArgumentParser.parse_args

    def parse_and_stop(*given):
        parse(*given)
        raise Parsed
    monkeypatch.setattr(argparse.ArgumentParser, 'parse_args', parse_and_stop)
    monkeypatch.setattr(sys, 'argv', [tool] + words)
    with pytest.raises(Parsed):
        if tool == 'bench':
            bench.main(words)
        elif tool == 'noise':
            noise.main()
        else:
            runpy.run_path(os.path.join(ROOT, 'scripts', tool), run_name='__main__')


def test_the_recorded_topics_are_the_inputs():
    assert RECORD.text.split()[4:] == ['/' + topic for topic in (  # rosbag stores them as given
        COLOR_TOPIC, INFO_TOPICS[0], DEPTH_TOPIC, TF_TOPIC, STATIC_TOPIC)]


@contextlib.contextmanager
def node_of(block):
    """The connections of a node whose code is on a page, and what it prints."""
    printed = io.StringIO()
    with masterless() as connections, mock.patch.multiple('rospy', init_node=mock.DEFAULT, spin=mock.DEFAULT), \
            contextlib.redirect_stdout(printed):
        exec(block.text, {})
        yield connections, printed


def test_the_detector_of_the_page_publishes_the_boxes_of_people():
    frame = Simulator(scenario_from(SCENE)).frame(0)
    with node_of(OWN_DETECTOR) as (connections, _printed):
        connections.send(COLOR_TOPIC, fill_image(Image(header=header_at(NS)), frame.color, 'rgb8'))
        found = boxes2d_from_msg(connections.publishers[BOXES_TOPIC].newest)
    assert found.stamp_ns == NS and iou(frame.people[0].box_px, found.boxes.astype(float)).max() > 0.4


def test_the_subscriber_of_the_page_prints_the_tracks():
    with node_of(TRACK_PRINTER) as (connections, printed):
        message = TrackedObjectArray(header=header_at(NS, 'map'), objects=[person(7, 1.0, 2.0)])
        message.objects[0].label = 'person'
        connections.send(TRACKS_TOPIC, message)
    assert printed.getvalue().startswith('person 7 at 1.00 2.00 in map, 1.00 m/s to x')


def test_stamp_and_frame_in_the_layout_of_2d_boxes():
    names = {'image': Image(header=header_at(1600000000000000005, 'some_camera')), 'Int32MultiArray': Int32MultiArray,
             'MultiArrayDimension': MultiArrayDimension, 'x1': 10, 'y1': 20, 'x2': 30, 'y2': 40}
    exec(STAMPED.text, names)
    boxes = boxes2d_from_msg(names['message'])
    assert (boxes.stamp_ns, boxes.frame_id) == (1600000000000000005, 'some_camera')
    assert boxes.boxes.tolist() == [[10, 20, 30, 40]]


def test_the_file_of_class_names_on_the_page_is_valid(tmp_path):
    (tmp_path / 'people_yolov7.yaml').write_text(MODEL_NAMES.text)
    assert names_beside(str(tmp_path / 'people_yolov7.onnx')) == ['person']
