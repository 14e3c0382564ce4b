"""The recipes in doc/other_cameras.md: pipeline.launch gives its nodes the topics of the drivers.

Their image formats, delays, raw depth and frames are those of tests in test/unit, test_raw_depth.py and
test_camera_mount.py.
"""
import shlex

import pytest

from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, DEPTH_TOPICS, INFO_TOPICS
from support.code_blocks import claimed
from support.launching import loaded

PIPELINE = 'roslaunch ros_3d_bb pipeline.launch weights:=$HOME/yolov5n.pt '
# The beginning of a recipe, and the topics of colour, its camera_info and depth.
DRIVERS = {
    'openni2': ('camera_image:=/camera/rgb/image_raw \\\n  camera_info:=/camera/rgb/camera_info camera_depth:=',
                '/camera/rgb/image_raw', '/camera/rgb/camera_info', '/camera/depth_registered/image_raw'),
    'openni2, raw depth': ('depth:=raw', '/camera/rgb/image_raw', '/camera/rgb/camera_info',
                           '/camera/depth/image_rect_raw'),
    'astra': ('camera_image:=/camera/color', '/camera/color/image_raw', '/camera/color/camera_info',
              '/camera/depth/image_raw'),
    'azure': ('camera_image:=/rgb', '/rgb/image_raw', '/rgb/camera_info', '/depth_to_rgb/image_raw'),
    'kinect2': ('camera_image:=/kinect2', '/kinect2/qhd/image_color_rect', '/kinect2/qhd/camera_info',
                '/kinect2/qhd/image_depth_rect'),
    'zed2': ('camera_image:=/zed2', '/zed2/zed_node/rgb/image_rect_color', '/zed2/zed_node/rgb/camera_info',
             '/zed2/zed_node/depth/depth_registered'),
    'oak': ('camera_image:=/oak', '/oak/rgb/image_raw', '/oak/rgb/camera_info', '/oak/stereo/image_raw'),
    'oak, example': ('\\\n  camera_image:=/stereo_inertial', '/stereo_inertial_publisher/color/image',
                     '/stereo_inertial_publisher/color/camera_info', '/stereo_inertial_publisher/stereo/depth')}
RECIPES = {name: claimed(PIPELINE + beginning) for name, (beginning, *_topics) in DRIVERS.items()}


@pytest.mark.parametrize('name', sorted(DRIVERS))
def test_launch_files_use_the_topics_of_a_recipe(name):
    arguments = shlex.split(RECIPES[name].text.replace('\\\n', ''))[3:]
    nodes = loaded('pipeline.launch', *arguments)[1]
    nodes.update(loaded('pipeline.launch', 'single_process:=false', *arguments)[1])
    _beginning, color, info, depth = DRIVERS[name]
    depth_topic = DEPTH_TOPICS['raw' if 'depth:=raw' in arguments else 'aligned'][0]
    everything = {COLOR_TOPIC: color, INFO_TOPICS[0]: info, depth_topic: depth}
    for node, topics in (('people_node', everything), ('bbox3d_node', everything),
                         ('yolov5_node', {COLOR_TOPIC: color}),
                         ('tracker_node', {INFO_TOPICS[0]: info, depth_topic: depth})):
        remaps = dict(nodes[node].remap_args)
        assert {topic: remaps[topic] for topic in topics} == topics
