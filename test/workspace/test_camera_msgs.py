"""Which camera_info belongs to an image, and what holds for rectified images."""
import pytest
from sensor_msgs.msg import CameraInfo

from ros_3d_bb.conversions.camera_msgs import info_of_images, info_topic_beside
from ros_3d_bb.conversions.perception_msgs import camera_from_msg


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
