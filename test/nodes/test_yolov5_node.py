"""yolov5_node on images of a session. Needs a master because the node processes the newest of a stream of images."""

import numpy as np
import pytest
import rospy
from dynamic_reconfigure.client import Client
from sensor_msgs.msg import Image
from std_msgs.msg import Int32MultiArray
from std_srvs.srv import SetBool

from ros_3d_bb.conversions.image_msgs import fill_image, imgmsg_to_rgb
from ros_3d_bb.conversions.perception_msgs import boxes2d_from_msg, stamp_of
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.detection.boxes import iou
from ros_3d_bb.sessions.session_reader import read_color, read_session
from support.ros import TIMEOUT_S, Recorder, header_at, launched, publisher, wait_until

START = 1000 * NS


@pytest.fixture(scope='module')
def images(session_folder):
    """Three colour images with a person, and the person's box in each."""
    session = read_session(session_folder)
    frames = [session.frames[number] for number in (15, 45, 75)]
    return [(read_color(frame, session.camera), frame.boxes_px[0]) for frame in frames]


@pytest.fixture(scope='module')
def camera(weights):
    with launched('yolov5.launch', 'weights:=' + weights):
        yield publisher('camera/color/image_raw', Image)


@pytest.fixture(scope='module')
def recorder(camera):
    with Recorder('yolo_bounding_box', Int32MultiArray) as recorder:
        yield recorder


@pytest.fixture
def output(recorder):
    return recorder.emptied()


def color_message(image, stamp_ns):
    return fill_image(Image(header=header_at(stamp_ns)), image, 'rgb8')


def test_the_person_is_detected_and_the_array_has_stamp_and_frame(camera, output, images):
    image, box = images[0]
    camera.publish(color_message(image, START))
    message, = output.wait_for(1)
    boxes = boxes2d_from_msg(message)
    assert boxes.stamp_ns == START and boxes.frame_id == 'camera_color_optical_frame'
    assert boxes.labels == ('person',) and 0.25 < boxes.scores[0] < 1
    assert message.layout.dim[0].size == len(boxes.boxes) == 1 and message.layout.dim[1].size == 4
    assert iou(np.array(box, float), boxes.boxes)[0] > 0.8


def test_the_service_pauses_and_resumes(camera, output, images):
    enable = rospy.ServiceProxy('yolov5_node/enable', SetBool)
    assert 'paused' in enable(False).message
    camera.publish(color_message(images[0][0], START))
    assert output.stays_at(0)
    assert enable(True).success
    camera.publish(color_message(images[0][0], START + 5))
    assert boxes2d_from_msg(output.wait_for(1)[0]).stamp_ns == START + 5


def test_the_newest_image_is_processed_and_others_are_skipped(camera, output, images):
    """The images are nine times as large, so that a detection takes far longer than their interval."""
    big = [np.tile(image, (3, 3, 1)) for image, _box in images]
    for number in range(60):
        camera.publish(color_message(big[number % 3], START + number * NS // 200))
        rospy.sleep(0.005)
    wait_until(lambda: output.messages and boxes2d_from_msg(output.messages[-1]).stamp_ns == START + 59 * NS // 200,
               'the boxes of the last image')
    stamps = [boxes2d_from_msg(message).stamp_ns for message in output.messages]
    assert stamps == sorted(stamps) and len(stamps) < 60


def test_the_annotated_image_is_published_to_subscribers(camera, images):
    image, box = images[1]
    with Recorder('yolo_result_out', Image) as drawn:
        camera.publish(color_message(image, START + 7))
        message, = drawn.wait_for(1)
    assert stamp_of(message) == START + 7 and message.encoding == 'rgb8'
    changed = (imgmsg_to_rgb(message) != image).any(axis=2)
    lines, columns = np.nonzero(changed)
    assert changed.any() and abs(columns.max() - box[2]) < 30 and abs(lines.max() - box[3]) < 30


def test_changed_parameters_apply_from_the_next_image_on(camera, output, images):
    """An empty array means that no people were detected. A request with an unknown class is rejected as a whole."""
    client = Client('yolov5_node', timeout=TIMEOUT_S)
    changes = [({'confidence': 1.0}, 0), ({'confidence': 0.25}, 1), ({'confidence': 1.0, 'classes': 'unicorn'}, 1),
               ({'image_size': 320}, 1), ({'image_size': 0}, 1)]
    for number, (change, count) in enumerate(changes):
        client.update_configuration(change)
        camera.publish(color_message(images[0][0], START + number))
        assert len(boxes2d_from_msg(output.wait_for(number + 1)[-1]).boxes) == count
    client.close()
