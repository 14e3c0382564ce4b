"""The recipes in doc/other_cameras.md, on simulated streams with the topics, frames, formats and delays of the drivers.

A person stands 2.5 m, another one 3.6 m before a camera 1.2 m above the floor, which looks down by 0.1 rad.
"""
import shlex
from typing import NamedTuple, Tuple

import numpy as np
import pytest
import rosbag
from sensor_msgs.msg import Image
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from ros_3d_bb.bags.process_bag import main
from ros_3d_bb.camera.camera_model import OPTICAL_ROTATION, Camera, transform_from
from ros_3d_bb.camera.depth_image import DepthImage
from ros_3d_bb.conversions.camera_msgs import (COLOR_TOPIC, DEPTH_TOPICS, INFO_TOPICS, START_NS,
                                               STATIC_TOPIC, CameraFrame, image_messages_of, transform_messages)
from ros_3d_bb.conversions.image_msgs import fill_image
from ros_3d_bb.conversions.perception_msgs import time_from, tracks_from_msg
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb_lab.simulation.scenario import scenario_from
from ros_3d_bb_lab.simulation.simulator import Simulator
from support.code_blocks import claimed
from support.launching import loaded

IMAGES, RATE_HZ, HEIGHT_M, TILT_RAD = 6, 30, 1.2, 0.1
PEOPLE = [{'start': [2.5, 0.5], 'facing': 3.0}, {'start': [3.6, -1.3], 'facing': 2.0}]
OPTICAL = transform_from((0, 0, 0), OPTICAL_ROTATION)
EYE = np.eye(4)
PIPELINE = 'roslaunch ros_3d_bb pipeline.launch weights:=$HOME/yolov5n.pt '


def shifted(y_m):
    return transform_from((0.0, y_m, 0.0), (0, 0, 0, 1))


class Driver(NamedTuple):
    """A driver's stream. `topics` are those of colour, its camera_info, depth, and the camera_info of raw depth.

    `depth_camera` is that of raw depth, None if it is registered. `links` are (parent, child, parent_from_child), the
    first from the root; images have the last child as frame unless `frame_id` is given. `depth_late` is the stamp of
    depth minus that of colour, in periods. `no_depth` is the value of pixels without depth.
    """

    recipe: str
    topics: Tuple[str, ...]
    camera: Camera
    color: str
    depth: str
    links: tuple
    frame_id: str = ''
    depth_late: float = 0.0
    depth_camera: Camera = None
    no_depth: float = 0.0


OPENNI = Driver('camera_image:=/camera/rgb/image_raw \\\n  camera_info:=/camera/rgb/camera_info camera_depth:=',
                ('/camera/rgb/image_raw', '/camera/rgb/camera_info', '/camera/depth_registered/image_raw'),
                Camera(640, 480, 525.0, 525.0, 319.5, 239.5), 'rgb8', '32FC1',
                (('camera_link', 'camera_rgb_frame', shifted(-0.045)),
                 ('camera_link', 'camera_depth_frame', shifted(-0.02)),
                 ('camera_rgb_frame', 'camera_rgb_optical_frame', OPTICAL),
                 ('camera_depth_frame', 'camera_depth_optical_frame', OPTICAL)),
                frame_id='camera_rgb_optical_frame', depth_late=0.4, no_depth=np.nan)
OAK = Driver('camera_image:=/oak', ('/oak/rgb/image_raw', '/oak/rgb/camera_info', '/oak/stereo/image_raw'),
             Camera(1280, 720, 1000.1, 999.5, 673.3, 339.9), 'bgr8', '16UC1',
             (('oak-d-base-frame', 'oak', EYE), ('oak', 'oak_rgb_camera_frame', EYE),
              ('oak_rgb_camera_frame', 'oak_rgb_camera_optical_frame', OPTICAL)), depth_late=-0.3)
DRIVERS = {
    'openni2': OPENNI,
    'openni2, raw depth': OPENNI._replace(
        recipe='depth:=raw', topics=OPENNI.topics[:2] + ('/camera/depth/image_rect_raw', '/camera/depth/camera_info'),
        depth='16UC1', no_depth=0.0, depth_camera=Camera(640, 480, 570.3, 570.3, 314.5, 235.5)),
    'astra': Driver(
        'camera_image:=/camera/color',
        ('/camera/color/image_raw', '/camera/color/camera_info', '/camera/depth/image_raw'),
        Camera(640, 480, 570.0, 570.0, 319.5, 239.5), 'rgb8', '16UC1',
        (('camera_link', 'camera_color_frame', shifted(-0.025)),
         ('camera_color_frame', 'camera_color_optical_frame', OPTICAL)), depth_late=0.2),
    'azure': Driver(
        'camera_image:=/rgb', ('/rgb/image_raw', '/rgb/camera_info', '/depth_to_rgb/image_raw'),
        Camera(1280, 720, 612.9, 612.7, 635.4, 367.9), 'bgra8', '16UC1',
        (('camera_base', 'rgb_camera_link', shifted(-0.032).dot(OPTICAL)),), depth_late=0.01),
    'kinect2': Driver(
        'camera_image:=/kinect2',
        ('/kinect2/qhd/image_color_rect', '/kinect2/qhd/camera_info', '/kinect2/qhd/image_depth_rect'),
        Camera(960, 540, 530.3, 529.3, 478.2, 259.5), 'bgr8', '16UC1', (), frame_id='kinect2_rgb_optical_frame'),
    'zed2': Driver(
        'camera_image:=/zed2',
        ('/zed2/zed_node/rgb/image_rect_color', '/zed2/zed_node/rgb/camera_info',
         '/zed2/zed_node/depth/depth_registered'),
        Camera(640, 360, 264.9, 264.9, 320.1, 179.4), 'bgra8', '32FC1',
        (('base_link', 'zed2_left_camera_frame', EYE),
         ('zed2_left_camera_frame', 'zed2_left_camera_optical_frame', OPTICAL)), no_depth=np.inf),
    'oak': OAK,
    'oak, example': OAK._replace(
        recipe='\\\n  camera_image:=/stereo_inertial', topics=tuple(
            '/stereo_inertial_publisher/' + name for name in ('color/image', 'color/camera_info', 'stereo/depth')))}
RECIPES = {name: claimed(PIPELINE + driver.recipe) for name, driver in DRIVERS.items()}


def arguments_in(block):
    """Words after the command of a block."""
    return shlex.split(block.text.replace('\\\n', ''))[3:]


def arguments_of(recipe):
    """{argument: value} of a recipe."""
    return dict(word.split(':=') for word in arguments_in(recipe))


def seen_by(camera, beside_m=0.0):
    """The scene as seen by a camera, a distance to the left of the middle."""
    mount = [0.0, beside_m, HEIGHT_M - 0.065]
    return Simulator(scenario_from({'duration': 0.1, 'rate': 10.0, 'depth_noise': False, 'people': PEOPLE,
                                    'robot': {'mount': mount, 'pitch': TILT_RAD}}), camera).frame(0)


def depth_message(driver, header, depth_mm):
    if driver.depth == '16UC1':
        return fill_image(Image(header=header), depth_mm, '16UC1')
    depth_m = np.where(depth_mm > 0, depth_mm * np.float32(0.001), np.float32(driver.no_depth)).astype(np.float32)
    return fill_image(Image(header=header), depth_m, '32FC1')


def info_message(camera, header):
    return next(image_messages_of(CameraFrame(header, camera, None, DepthImage(None, 0.001), ())))[1]


def color_message(driver, header, rgb):
    bgr = rgb[..., ::-1]
    pixels = {'rgb8': rgb, 'bgr8': bgr, 'bgra8': np.dstack((bgr, np.full(rgb.shape[:2], 255, np.uint8)))}[driver.color]
    return fill_image(Image(header=header), np.ascontiguousarray(pixels), driver.color)


def write_stream(driver, path):
    """Write the stream of a driver to a bag, each message at its stamp."""
    frame = seen_by(driver.camera)
    depth_mm, frame_id = frame.depth_mm, driver.frame_id or driver.links[-1][1]
    depth_frame_id = frame_id
    if driver.depth_camera is not None:
        depth_mm, depth_frame_id = seen_by(driver.depth_camera, 0.025).depth_mm, 'camera_depth_optical_frame'
    with rosbag.Bag(path, 'w') as bag:
        def write(topic, message, stamp_ns):
            bag.write('/' + topic.lstrip('/'), message, time_from(stamp_ns))
        write(STATIC_TOPIC, TFMessage(transform_messages(time_from(START_NS), driver.links)), START_NS - NS)
        for number in range(IMAGES):
            stamp_ns = START_NS + number * NS // RATE_HZ
            depth_ns = stamp_ns + int(driver.depth_late * NS / RATE_HZ)
            header = Header(stamp=time_from(stamp_ns), frame_id=frame_id)
            depth_header = Header(stamp=time_from(depth_ns), frame_id=depth_frame_id)
            write(driver.topics[2], depth_message(driver, depth_header, depth_mm), depth_ns)
            if driver.depth_camera is not None:
                write(driver.topics[3], info_message(driver.depth_camera, depth_header), depth_ns)
            write(driver.topics[0], color_message(driver, header, frame.color), stamp_ns)
            write(driver.topics[1], info_message(driver.camera, header), stamp_ns + 1)


@pytest.mark.parametrize('name', sorted(set(DRIVERS) - {'oak, example'}))  # whose images are those of oak
def test_people_are_tracked_with_the_topics_of_a_recipe(name, tmp_path, capfd):
    driver, recipe = DRIVERS[name], arguments_of(RECIPES[name])
    write_stream(driver, str(tmp_path / 'in.bag'))
    depth_topics = DEPTH_TOPICS[recipe.get('depth', 'aligned')]
    ours = [COLOR_TOPIC, INFO_TOPICS[0]] + list(depth_topics)
    theirs = [recipe['camera_image'], recipe['camera_info'], recipe['camera_depth']] + list(driver.topics[3:])
    assert theirs == list(driver.topics)
    options = [word for pair in zip(ours, theirs) for word in ('--remap', '%s:=%s' % pair)]
    with pytest.raises(SystemExit) as ended:
        main([str(tmp_path / 'in.bag'), str(tmp_path / 'out.bag'), '--detector', 'depth', '--camera-height',
              str(HEIGHT_M), '--camera-tilt', str(TILT_RAD), '--depth', recipe.get('depth', 'aligned')] + options)
    assert not ended.value.code and 'colour images rejected' not in capfd.readouterr().out
    with rosbag.Bag(str(tmp_path / 'out.bag')) as bag:
        tracks = [tracks_from_msg(message) for _topic, message, _time in bag.read_messages(['/ros_3d_bb/tracks'])]
    found_m = sorted(track.position_m[:2].tolist() for track in tracks[-1])
    assert len(tracks) == IMAGES
    np.testing.assert_allclose(found_m, [person['start'] for person in PEOPLE], atol=0.06)


@pytest.mark.parametrize('name', sorted(DRIVERS))
def test_launch_files_use_the_topics_of_a_recipe(name):
    _parameters, nodes = loaded('pipeline.launch', *arguments_in(RECIPES[name]))
    _parameters, separate = loaded('pipeline.launch', 'single_process:=false', *arguments_in(RECIPES[name]))
    nodes.update(separate)
    color, info, depth = DRIVERS[name].topics[:3]
    depth_topic = DEPTH_TOPICS[arguments_of(RECIPES[name]).get('depth', 'aligned')][0]
    everything = {COLOR_TOPIC: color, INFO_TOPICS[0]: info, depth_topic: depth}
    for node, topics in (('people_node', everything), ('bbox3d_node', everything),
                         ('yolov5_node', {COLOR_TOPIC: color}),
                         ('tracker_node', {INFO_TOPICS[0]: info, depth_topic: depth})):
        remaps = dict(nodes[node].remap_args)
        assert {topic: remaps[topic] for topic in topics} == topics
