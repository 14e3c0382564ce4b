"""yolov5_node on images of a session, without a master."""
import numpy as np
import pytest
from sensor_msgs.msg import Image
from std_srvs.srv import SetBoolRequest

from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC
from ros_3d_bb.conversions.image_msgs import fill_image, imgmsg_to_rgb
from ros_3d_bb.conversions.perception_msgs import BOXES_TOPIC, boxes2d_from_msg, stamp_of
from ros_3d_bb.core.latest_worker import NewestWorker
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.detection.boxes import iou
from ros_3d_bb.detection.network_detector import DetectionParams
from ros_3d_bb.nodes.common import detector_output
from ros_3d_bb.nodes.yolov5_node import Yolov5Node
from ros_3d_bb.sessions.session_reader import read_color, read_session
from support.launching import loaded
from support.masterless import masterless
from support.ros import header_at, wait_until

START_NS = 1000 * NS
pytestmark = pytest.mark.needs('torch')


@pytest.fixture
def camera(weights):
    """The connections of the node, whose workers work at once."""
    parameters, _nodes = loaded('yolov5.launch', 'weights:=' + weights)
    with masterless({name.rpartition('/')[2]: value for name, value in parameters.items()}) as connections:
        yield connections


@pytest.fixture
def image(session_folder):
    """A colour image with a person, and the person's box."""
    session = read_session(session_folder)
    return read_color(session.frames[15], session.camera), session.frames[15].boxes_px[0]


def newest(camera):
    message = camera.publishers[BOXES_TOPIC].newest
    return message and boxes2d_from_msg(message)


def sent(camera, image, stamp_ns=START_NS):
    """The newest boxes after an image."""
    camera.send(COLOR_TOPIC, fill_image(Image(header=header_at(stamp_ns)), image, 'rgb8'))
    return newest(camera)


def test_the_person_is_detected_and_drawn_at_the_stamp_of_the_image(camera, image):
    Yolov5Node()
    pixels, box = image
    boxes, drawn = sent(camera, pixels), camera.publishers['yolo_result_out'].newest
    assert boxes.stamp_ns == START_NS == stamp_of(drawn) and boxes.frame_id == 'camera_color_optical_frame'
    assert boxes.labels == ('person',) and 0.25 < boxes.scores[0] < 1
    assert iou(np.array(box, float), boxes.boxes).tolist() > [0.8]
    lines, columns = np.nonzero((imgmsg_to_rgb(drawn) != pixels).any(axis=2))
    assert abs(columns.max() - box[2]) < 30 and abs(lines.max() - box[3]) < 30


def test_the_service_pauses_and_changed_parameters_apply_from_the_next_image_on(camera, image):
    """An empty array means that no people were detected."""
    node = Yolov5Node()
    assert 'paused' in node._worker._on_request(SetBoolRequest(False)).message
    assert sent(camera, image[0]) is None and node._worker._on_request(SetBoolRequest(True)).success
    for changes, count in (({'confidence': 1.0}, 0), ({}, 1), ({'image_size': 320}, 1), ({'image_size': 0}, 1)):
        node._set_params(DetectionParams(**changes))
        assert len(sent(camera, image[0]).boxes) == count
    with pytest.raises(ValueError, match='unicorn'):
        node._set_params(DetectionParams(confidence=1.0, classes=['unicorn']))
    assert len(sent(camera, image[0]).boxes) == 1


def test_the_newest_image_is_processed_and_others_are_skipped(camera, image, monkeypatch):
    monkeypatch.setattr(detector_output, 'NewestWorker', NewestWorker)
    node = Yolov5Node()
    for number in range(60):
        sent(camera, image[0], START_NS + number)
    wait_until(lambda: newest(camera) and newest(camera).stamp_ns == START_NS + 59, 'the boxes of the last image')
    assert camera.publishers[BOXES_TOPIC].count + node._diagnostics.counts['images skipped for a newer one'] == 60
