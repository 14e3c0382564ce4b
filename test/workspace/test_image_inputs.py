"""Compressed, YUV and Bayer images give the positions of plain images in process_bag."""
import cv2
import numpy as np
import pytest
import rosbag
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from ros_3d_bb.bags.bag_pipeline import process_bag
from ros_3d_bb.bags.bag_writer import write_bag
from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, DEPTH_TOPIC, info_of_images, info_topic_beside
from ros_3d_bb.conversions.image_msgs import fill_image, imgmsg_to_depth, imgmsg_to_rgb
from ros_3d_bb.conversions.perception_msgs import camera_from_msg
from ros_3d_bb.pipeline.people_pipeline import Settings
from ros_3d_bb_lab.simulation.ros.scenario_to_bag import scenario_images
from ros_3d_bb_lab.simulation.scenario import scenario_from
from support.compressed import compressed_fields, rewritten

SCENE = {'duration': 0.6, 'rate': 10.0, 'people': [{'start': [3.0, 0.5], 'moves': [{'to': [3.0, -1.0]}]},
                                                   {'start': [4.0, -0.8]}]}


def in_metres(message):
    return fill_image(Image(header=message.header), imgmsg_to_depth(message).values * np.float32(0.001), '32FC1')


def as_yuv(message):
    """A colour image as yuv422, UYVY."""
    ycrcb = cv2.cvtColor(imgmsg_to_rgb(message), cv2.COLOR_RGB2YCrCb).astype(np.float32)
    luma = 16 + ycrcb[..., 0] * 219 / 255
    chroma = 128 + (ycrcb[..., 2:0:-1] - 128) * 224 / 255
    uyvy = np.stack([np.where(np.arange(luma.shape[1]) % 2, np.roll(chroma[..., 1], 1, 1), chroma[..., 0]), luma], 2)
    return fill_image(Image(header=message.header), np.clip(np.round(uyvy), 0, 255).astype(np.uint8), 'yuv422')


def as_bayer(message):
    rgb = imgmsg_to_rgb(message)
    mosaic = rgb[..., 1].copy()
    mosaic[::2, ::2], mosaic[1::2, 1::2] = rgb[::2, ::2, 0], rgb[1::2, 1::2, 2]
    return fill_image(Image(header=message.header), mosaic, 'bayer_rggb8')


def same(message):
    return message


def compressed(codec, change=same):
    return lambda message: CompressedImage(**compressed_fields(change(message), codec))


# name: how colour and depth are changed, and the largest error of a position in metres
STREAMS = {'png, png': (compressed('png'), compressed('compressedDepth'), 0.01),
           'png, rvl': (compressed('png'), compressed('compressedDepth rvl'), 0.01),
           'jpeg, 16UC1': (compressed('jpeg'), same, 0.03),
           'jpeg, quantized': (compressed('jpeg'), compressed('compressedDepth', in_metres), 0.03),
           'yuv422': (as_yuv, same, 0.01), 'bayer_rggb8': (as_bayer, same, 0.01)}


@pytest.fixture(scope='module')
def scene(tmp_path_factory):
    path = str(tmp_path_factory.mktemp('scene') / 'scene.bag')
    write_bag(scenario_images(scenario_from(SCENE)), path)
    return path


@pytest.fixture(scope='module')
def plain(scene, tmp_path_factory):
    """The output of process_bag for plain images."""
    path = str(tmp_path_factory.mktemp('plain') / 'plain.bag')
    process_bag(scene, path, Settings(detector='depth'))
    return path


def boxes_in(path):
    """{stamp: positions} of the 3D boxes, sorted."""
    with rosbag.Bag(str(path)) as bag:
        return {message.header.stamp: positions_in(message)
                for _topic, message, _time in bag.read_messages('/ros_3d_bb/bb_3d')}


def positions_in(message):
    positions = [box.center.position for box in message.boxes]
    return np.array(sorted((at.z, at.x, at.y) for at in positions))


@pytest.mark.parametrize('name', sorted(STREAMS))
def test_other_images_give_the_same_positions(scene, plain, tmp_path, name):
    change_color, change_depth, largest_m = STREAMS[name]
    names = rewritten(scene, tmp_path / 'in.bag', {COLOR_TOPIC: change_color, DEPTH_TOPIC: change_depth})
    events = process_bag(str(tmp_path / 'in.bag'), str(tmp_path / 'out.bag'), Settings(detector='depth', names=names))
    assert not events.sentences, events.sentences
    expected, found = boxes_in(plain), boxes_in(tmp_path / 'out.bag')
    assert set(found) == set(expected) and sum(map(len, expected.values())) == 12
    for stamp, positions in expected.items():
        assert found[stamp].shape == positions.shape
        np.testing.assert_allclose(found[stamp], positions, atol=largest_m)


@pytest.mark.parametrize('image_topic', ['/camera/depth/image', '/camera/depth/image/compressedDepth',
                                         '/camera/depth/image/compressed'])
def test_camera_info_is_in_the_namespace_of_the_image(image_topic):
    assert info_topic_beside(image_topic) == '/camera/depth/camera_info'


@pytest.mark.parametrize('topic,is_rectified', [
    ('/kinect2/qhd/image_depth_rect', True), ('/camera/depth/image_rect_raw/compressedDepth', True),
    ('/camera/rgb/image_rect_color', True), ('/camera/rgb/image_raw', False), ('/rect/image_direct', False)])
def test_rectified_images_have_no_distortion(topic, is_rectified):
    info = CameraInfo(width=640, height=480, distortion_model='plumb_bob', D=[0.1, 0, 0, 0, 0],
                      K=[600, 0, 320, 0, 600, 240, 0, 0, 1], P=[580, 0, 318, 0, 0, 581, 239, 0, 0, 0, 1, 0])
    camera = camera_from_msg(info_of_images(info, topic))
    assert camera[2:6] == ((580, 581, 318, 239) if is_rectified else (600, 600, 320, 240))
    assert bool(camera.distortion) is not is_rectified and info.K[0] == 600
    info.P = [0] * 12  # unknown
    assert camera_from_msg(info_of_images(info, topic)).fx == 600
