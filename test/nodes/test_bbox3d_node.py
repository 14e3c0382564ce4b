"""bbox3d_node on made images. Needs a master because pairing is about what arrives when, on several topics."""
import itertools

import numpy as np
import pytest
import rospy
from dynamic_reconfigure.client import Client
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Int32MultiArray

from ros_3d_bb.conversions.image_msgs import fill_image
from ros_3d_bb.conversions.perception_msgs import boxes2d_to_msg, time_from
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import BoundingBox3DArray
from support.ros import (TIMEOUT_S, Recorder, camera_info, depth_message, diagnostics_of, header_at, publisher,
                         wait_until)

PERIOD = NS // 30
BOX = np.array([[20, 10, 44, 38]])
_stamps = itertools.count(1000 * NS, 10 * NS)


class Rig(object):
    """A camera and a detector."""

    def __init__(self):
        self.depth = publisher('camera/aligned_depth_to_color/image_raw', Image)
        self.info = publisher('camera/color/camera_info', CameraInfo)
        self.boxes = publisher('yolo_bounding_box', Int32MultiArray)

    def send_camera(self, stamp_ns, depth_mm=2000, **info):
        self.info.publish(camera_info(stamp_ns, **info))
        self.depth.publish(depth_message(stamp_ns, depth_mm))

    def send_boxes(self, stamp_ns, boxes=BOX):
        self.boxes.publish(boxes2d_to_msg(np.array(boxes).reshape(-1, 4), header_at(stamp_ns)))


@pytest.fixture(scope='module')
def rig():
    rospy.init_node('test_bbox3d_node')
    return Rig()


@pytest.fixture(scope='module')
def recorder(rig):
    with Recorder('ros_3d_bb/bb_3d', BoundingBox3DArray) as recorder:
        yield recorder


@pytest.fixture
def output(recorder):
    return recorder.emptied()


@pytest.fixture
def now():
    """A stamp for this test, later than those of the tests before."""
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
    assert box.center.orientation.w == 1.0 and box.position_covariance == tuple([0.0] * 9)
    assert (box.roi.x_offset, box.roi.y_offset, box.roi.width, box.roi.height) == (20, 10, 24, 28)
    assert box.support == 1.0 and not box.truncated


@pytest.mark.parametrize('delay_frames', [0, 2, 6])
def test_late_boxes_get_the_depth_of_their_own_image(rig, output, now, delay_frames):
    """Each depth image says its number in millimetres."""
    for frame in range(30 + delay_frames):
        if frame < 30:
            rig.send_camera(now + frame * PERIOD, 1000 + frame)
        if frame >= delay_frames:
            rig.send_boxes(now + (frame - delay_frames) * PERIOD)
            output.wait_for(frame - delay_frames + 1)
    for frame, message in enumerate(output.messages):
        assert message.header.stamp == time_from(now + frame * PERIOD)
        assert message.boxes[0].center.position.z == pytest.approx(1.0 + frame / 1000)


def test_boxes_that_come_before_their_image_wait_for_it(rig, output, now):
    rig.send_camera(now, 1000)
    rig.send_boxes(now + PERIOD)
    assert output.stays_at(0, 0.3)
    rig.send_camera(now + PERIOD, 3000)
    message, = output.wait_for(1)
    assert message.boxes[0].center.position.z == pytest.approx(3.0)


def test_plain_arrays_get_the_image_that_came_before_them(rig, output, now):
    """A detector that knows nothing of stamps: of two images 0.4 s apart, the one 0.05 s (~assumed_delay) before."""
    for number in range(2):
        rig.send_camera(now + number * PERIOD, 1500 + 500 * number)
        rospy.sleep(0.4 if number == 0 else 0.05)
    rig.boxes.publish(Int32MultiArray(data=[20, 10, 44, 38]))
    message, = output.wait_for(1)
    assert message.header.stamp == time_from(now + PERIOD)
    assert message.boxes[0].center.position.z == pytest.approx(2.0)


def test_without_depth_the_topic_is_named(rig, output, now):
    """Boxes come and no depth does: nothing is published, and the node says what is missing."""
    rig.send_camera(now)
    for frame in range(1, 40):
        rig.send_boxes(now + frame * PERIOD)
        rospy.sleep(1 / 30)
    wait_until(lambda: 'no depth image with their stamp' in diagnostics_of('bbox3d_node')[1], 'a warning')
    assert '/camera/aligned_depth_to_color/image_raw' in diagnostics_of('bbox3d_node')[1] and output.messages == []


def test_the_camera_of_the_same_stamp_is_used_though_it_comes_last(rig, output, now):
    """The intrinsics change, and their message comes after the depth image and the boxes."""
    rig.send_camera(now)
    rig.depth.publish(depth_message(now + PERIOD, 2000))
    rig.send_boxes(now + PERIOD)
    assert output.stays_at(0, 0.2)
    rig.info.publish(camera_info(now + PERIOD, focal=120.0))
    assert output.wait_for(1)[0].boxes[0].size.x == pytest.approx(24 / 120 * 2.0)


def test_nobody_is_an_answer_and_is_published(rig, output, now):
    rig.send_camera(now)
    rig.send_boxes(now, [])
    message, = output.wait_for(1)
    assert message.boxes == [] and message.header.stamp == time_from(now)


@pytest.mark.parametrize('encoding,dtype,big_endian,padding', [('32FC1', '<f4', 0, 0), ('32FC1', '>f4', 1, 12),
                                                               ('16UC1', '>u2', 1, 0), ('16UC1', '<u2', 0, 6)])
def test_depth_of_any_encoding_byte_order_and_row_step(rig, output, now, encoding, dtype, big_endian, padding):
    value = 2.5 if encoding == '32FC1' else 2500
    row = np.full(64, value, dtype).tobytes() + b'\xff' * padding
    rig.info.publish(camera_info(now))
    rig.depth.publish(Image(header=header_at(now), width=64, height=48, encoding=encoding, is_bigendian=big_endian,
                            step=len(row), data=row * 48))
    rig.send_boxes(now)
    assert output.wait_for(1)[0].boxes[0].center.position.z == pytest.approx(2.5)


def test_time_that_goes_back_starts_anew(rig, output, now):
    """A bag loops: the same stamps come again, with the depth of the second time."""
    known = diagnostics_of('bbox3d_node')[2].get('depth images received', 0)
    for depth_mm, sent in ((1000, 2), (3000, 4)):
        rig.send_camera(now, depth_mm)
        rig.send_camera(now + PERIOD, depth_mm)
        wait_until(lambda: diagnostics_of('bbox3d_node')[2]['depth images received'] >= known + sent, 'depth images')
        rig.send_boxes(now + PERIOD)  # which on the way may overtake the images, and meet those of the first time
        wait_until(lambda: output.messages and output.messages[-1].boxes[0].center.position.z
                   == pytest.approx(depth_mm / 1000), 'boxes at %d mm' % depth_mm)
    assert len(output.messages) == 2


@pytest.mark.parametrize('bad', [
    Int32MultiArray(data=[1, 2, 3]), Int32MultiArray(data=[1] * 4004),
    boxes2d_to_msg(BOX, header_at(7 * NS)),  # far older than the cache
])
def test_arrays_that_cannot_be_used_are_refused_and_the_next_works(rig, output, now, bad):
    rig.send_camera(now)
    rig.boxes.publish(bad)
    rig.send_boxes(now)
    assert output.wait_for(1)[0].header.stamp == time_from(now)
    assert output.stays_at(1, 0.2)
    level, sentence, _counts = diagnostics_of('bbox3d_node')
    assert level == 1 and 'waiting for the next' in sentence


def test_boxes_that_are_no_boxes_are_left_out_and_the_others_are_kept(rig, output, now):
    rig.send_camera(now)
    rig.send_boxes(now, [[40, 10, 20, 38], [5, 5, 5, 9], [1000, 1000, 1100, 1100], [-2 ** 31, 0, 2 ** 31 - 1, 48],
                         [-9, 0, 70, 48], [20, 10, 44, 38]])
    boxes = output.wait_for(1)[0].boxes
    assert [(box.roi.x_offset, box.roi.width) for box in boxes] == [(0, 64), (20, 24)]
    assert [box.truncated for box in boxes] == [True, False]


def bad_depth(stamp_ns):
    """Depth images that cannot be used, with what the node must say of them."""
    short, unknown, zero = (depth_message(stamp_ns, 1000) for _ in range(3))
    short.data, unknown.encoding, zero.header.stamp.secs = b'\0', '64FC1', 0
    zero.header.stamp.nsecs = 0
    return [(short, 'too short'), (unknown, '64FC1'), (zero, 'no stamp'),
            (depth_message(stamp_ns, 1000, (10, 10)), 'aligned')]


@pytest.mark.parametrize('number', range(4))
def test_depth_that_cannot_be_used_is_named_and_the_next_works(rig, output, now, number):
    message, reason = bad_depth(now)[number]
    rig.info.publish(camera_info(now))
    rig.depth.publish(message)
    rig.send_boxes(now)
    rospy.sleep(0.1)
    rig.send_camera(now + PERIOD)
    rig.send_boxes(now + PERIOD)
    wait_until(lambda: any(m.header.stamp == time_from(now + PERIOD) for m in output.messages), 'the next image')
    assert not any(m.header.stamp == time_from(now) for m in output.messages)
    if number != 2:  # with a stamp of zero the depth is refused first, and its boxes after it
        assert reason in diagnostics_of('bbox3d_node')[1]


def test_an_uncalibrated_camera_is_named(rig, output, now):
    rig.info.publish(camera_info(now, focal=0.0))
    wait_until(lambda: 'camera_info rejected' in diagnostics_of('bbox3d_node')[1], 'a warning')
    rig.send_camera(now + PERIOD)
    rig.send_boxes(now + PERIOD)
    output.wait_for(1)


def test_a_lens_that_is_not_known_is_named(rig, output, now):
    unknown = camera_info(now)
    unknown.distortion_model, unknown.D = 'ftheta', [0.9]
    rig.info.publish(unknown)
    wait_until(lambda: "distortion model is 'ftheta'" in diagnostics_of('bbox3d_node')[1], 'a warning')
    rig.send_camera(now + PERIOD)
    rig.send_boxes(now + PERIOD)
    output.wait_for(1)


def test_images_to_look_at_come_while_somebody_looks(rig, output, now):
    color = publisher_later('camera/color/image_raw')
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
        assert drawn.messages[-1].encoding == 'rgb8' and raw.messages[-1].data[:3] == b'\x63' * 3
        assert grey.messages[-1].encoding == 'mono8'
        pixels = np.frombuffer(drawn.messages[-1].data, np.uint8).reshape(48, 64, 3)
        assert (pixels == (255, 0, 0)).all(axis=2).any()  # a sample with depth
        assert drawn.messages[-1].header.stamp.to_nsec() >= now
    wait_until(lambda: unheard(rig, color, now + 200 * PERIOD), 'the end of the subscription to colour')


def publisher_later(topic):
    """A publisher that nobody listens to yet."""
    return rospy.Publisher(topic, Image, queue_size=10)


def unheard(rig, color, stamp_ns):
    """Whether the node has let go of the colour image, which it notices when it next lifts boxes."""
    rig.send_camera(stamp_ns)
    rig.send_boxes(stamp_ns)
    return color.get_num_connections() == 0


def test_a_changed_estimator_works_from_the_next_image_on(rig, output, now):
    """Half of the box is a person at 2 m, and half of it wall: to the median both are one."""
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
