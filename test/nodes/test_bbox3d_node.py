"""bbox3d_node on synthetic images. Needs a master, because messages of several topics are paired by arrival."""
import itertools

import numpy as np
import pytest
import rospy
from dynamic_reconfigure.client import Client
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_msgs.msg import Int32MultiArray, String

from ros_3d_bb.conversions.image_msgs import fill_image, imgmsg_to_depth, imgmsg_to_rgb
from ros_3d_bb.conversions.perception_msgs import boxes2d_to_msg, time_from
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import BoundingBox3DArray
from ros_3d_bb.nodes.common.subscribers import subscribe
from ros_3d_bb.visualization.image_overlay import VALID_COLOR
from support.compressed import compressed_fields
from support.ros import TIMEOUT_S, Recorder, camera_info, depth_message, header_at, publisher, wait_until

PERIOD = NS // 30
BOX = np.array([[20, 10, 44, 38]])
_stamps = itertools.count(1000 * NS, 10 * NS)


class Rig(object):
    """A camera, a detector, and the output of the node."""

    def __init__(self):
        self.depth = publisher('camera/aligned_depth_to_color/image_raw', Image)
        self.info = publisher('camera/color/camera_info', CameraInfo)
        self.boxes = publisher('yolo_bounding_box', Int32MultiArray)
        self.output = Recorder('ros_3d_bb/bb_3d', BoundingBox3DArray)

    def send_camera(self, stamp_ns, depth_mm=2000):
        self.info.publish(camera_info(stamp_ns))
        self.depth.publish(depth_message(stamp_ns, depth_mm))

    def send_boxes(self, stamp_ns, boxes=BOX):
        self.boxes.publish(boxes2d_to_msg(np.array(boxes).reshape(-1, 4), header_at(stamp_ns)))


@pytest.fixture(scope='module')
def rig():
    rospy.init_node('test_bbox3d_node')
    return Rig()


@pytest.fixture
def output(rig):
    return rig.output.emptied()


@pytest.fixture
def now():
    """A stamp for this test, later than those of previous tests."""
    return next(_stamps)


def test_boxes_become_3d_in_the_frame_and_at_the_stamp_of_the_image(rig, output, now):
    rig.send_camera(now, 2000)
    rig.send_boxes(now)
    message, = output.wait_for(1)
    assert message.header.stamp == time_from(now)
    assert message.header.frame_id == 'camera_color_optical_frame'
    box, = message.boxes
    center, size = box.center.position, box.size
    assert center.z == pytest.approx(2.0) and abs(center.x) < 0.04 and abs(center.y) < 0.04
    assert (size.x, size.y, size.z) == pytest.approx((24 / 60 * 2.0, 28 / 60 * 2.0, 24 / 60 * 2.0))
    assert box.center.orientation.w == 1.0 and min(box.position_covariance[::4]) >= 0.01  # without an error model
    assert (box.roi.x_offset, box.roi.y_offset, box.roi.width, box.roi.height) == (20, 10, 24, 28)
    assert box.support == 1.0 and not box.truncated


def test_boxes_without_a_stamp_get_the_image_that_arrived_before_them(rig, output, now):
    """Of two images 0.4 s apart, the one 0.05 s (~assumed_delay) before."""
    for number in range(2):
        rig.send_camera(now + number * PERIOD, 1500 + 500 * number)
        rospy.sleep(0.4 if number == 0 else 0.05)
    rig.boxes.publish(Int32MultiArray(data=[20, 10, 44, 38]))
    message, = output.wait_for(1)
    assert message.header.stamp == time_from(now + PERIOD)
    assert message.boxes[0].center.position.z == pytest.approx(2.0)


def test_a_changed_estimator_is_used_from_the_next_image(rig, output, now):
    """Less than half of the box is a person at 2 m, the rest is wall: the median is that of the wall."""
    depth_mm = np.full((48, 64), 5000, np.uint16)
    depth_mm[:, 27:37] = 2000
    client, depths_m = Client('bbox3d_node', timeout=TIMEOUT_S), []
    for number, estimator in enumerate(('median', 'foreground', 'median')):
        client.update_configuration({'estimator': estimator, 'stride': 2})
        stamp_ns = now + number * PERIOD
        rig.info.publish(camera_info(stamp_ns))
        rig.depth.publish(fill_image(Image(header=header_at(stamp_ns)), depth_mm, '16UC1'))
        rig.send_boxes(stamp_ns)
        wait_until(lambda: output.messages and output.messages[-1].header.stamp == time_from(stamp_ns), 'its boxes')
        depths_m.append(output.messages[-1].boxes[0].center.position.z)
    client.update_configuration({'stride': 20})
    client.close()
    assert depths_m == pytest.approx([5.0, 2.09, 5.0])


def test_the_publisher_decides_the_type_of_images(rig):
    """A message of another type is left out; the diagnostics report such a topic as silent."""
    image, received = depth_message(NS, 2000), {}
    for name, message in (('plain', image), ('other', String('no image')), ('compressed', CompressedImage(
            **compressed_fields(image, 'compressedDepth rvl')))):
        received[name] = []
        subscriber = subscribe('images/' + name, Image, received[name].append)
        sender = publisher('images/' + name, type(message))
        for _message in range(2):
            sender.publish(message)
        if name != 'other':
            wait_until(lambda: len(received[name]) == 2, name)
        subscriber.unregister()
        assert [type(each) for each in received[name]] == [type(message)] * (0 if name == 'other' else 2)
    np.testing.assert_array_equal(imgmsg_to_depth(received['compressed'][0]).values, np.full((48, 64), 2000))


def test_debug_images_are_published_while_they_have_subscribers(rig, output, now):
    color = rospy.Publisher('camera/color/image_raw', Image, queue_size=10)
    with Recorder('ros_3d_bb/color', Image) as drawn, Recorder('ros_3d_bb/raw', Image) as raw, \
            Recorder('ros_3d_bb/depth', Image) as grey:
        for frame in range(100):
            stamp_ns = now + frame * PERIOD
            color.publish(fill_image(Image(header=header_at(stamp_ns)), np.full((48, 64, 3), 99, np.uint8), 'rgb8'))
            rig.send_camera(stamp_ns)
            rospy.sleep(0.03)
            rig.send_boxes(stamp_ns)
            if drawn.messages and raw.messages and grey.messages:
                break
        assert raw.messages[-1].data[:3] == b'\x63' * 3 and grey.messages[-1].encoding == 'mono8'
        assert (imgmsg_to_rgb(drawn.messages[-1]) == VALID_COLOR).all(axis=2).any()
        assert drawn.messages[-1].header.stamp.to_nsec() >= now

    def is_unsubscribed():  # the node checks its subscribers when it receives boxes
        rig.send_camera(now + 200 * PERIOD)
        rig.send_boxes(now + 200 * PERIOD)
        return color.get_num_connections() == 0
    wait_until(is_unsubscribed, 'the end of the subscription to colour')
