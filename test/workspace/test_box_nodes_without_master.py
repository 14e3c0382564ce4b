import os
from unittest import mock

import numpy as np
import pytest
from sensor_msgs.msg import Image
from std_msgs.msg import Int32MultiArray
from std_srvs.srv import SetBoolRequest

from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, DEPTH_TOPIC, INFO_TOPICS
from ros_3d_bb.conversions.image_msgs import fill_image, imgmsg_to_depth, imgmsg_to_rgb
from ros_3d_bb.conversions.perception_msgs import (BOXES3D_TOPIC, BOXES_TOPIC, boxes2d_from_msg, boxes3d_to_msg,
                                                   stamp_of, time_from)
from ros_3d_bb.core.detection_pace import WINDOW
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.detection.boxes import iou
from ros_3d_bb.detection.network_detector import DetectionParams
from ros_3d_bb.detection.yolov5.backends import RuntimeParams
from ros_3d_bb.estimation.box3d import Box3D
from ros_3d_bb.nodes.bbox3d_node import Bbox3dNode
from ros_3d_bb.nodes.common import detector_output
from ros_3d_bb.nodes.detector_node import DetectorNode
from ros_3d_bb.nodes.viewer_node import ViewerNode
from ros_3d_bb.sessions.session_reader import read_color, read_depth, read_session
from ros_3d_bb.visualization.image_overlay import VALID_COLOR
from ros_3d_bb_lab.simulation.ros.scenario_to_bag import simulated_messages
from ros_3d_bb_lab.simulation.scenario import scenario_from
from ros_3d_bb_lab.simulation.simulator import Simulator
from support.inputs import CAMERA, TARGETS, good_messages, send_image
from support.launching import loaded
from support.masterless import masterless
from support.ros import depth_message, header_at

START_NS = 1000 * NS


@pytest.fixture
def connections():
    """A node that takes the depth of the person as it is."""
    with masterless({'estimator': 'median'}) as made:
        made.node = Bbox3dNode()
        yield made


def test_boxes_become_3d_in_the_frame_and_at_the_stamp_of_the_image(connections):
    send_image(connections, START_NS)
    message = connections.publishers[BOXES3D_TOPIC].newest
    assert (message.header.stamp, message.header.frame_id) == (time_from(START_NS), 'camera')
    box, = message.boxes
    center, size = box.center.position, box.size
    assert center.z == pytest.approx(2.0) and abs(center.x) < 0.04 and abs(center.y) < 0.1
    assert (size.x, size.y, size.z) == pytest.approx((12 / 60 * 2.0, 36 / 60 * 2.0, 12 / 60 * 2.0))
    assert box.center.orientation.w == 1.0 and min(box.position_covariance[::4]) >= 0.01  # without an error model
    assert (box.roi.x_offset, box.roi.y_offset, box.roi.width, box.roi.height) == (26, 8, 12, 36)
    assert box.support == 1.0 and box.truncated_edges == box.BOTTOM


def test_boxes_without_a_stamp_get_the_image_that_arrived_before_them(connections, monkeypatch):
    """Of two images 0.4 s apart, the one 0.05 s (~assumed_delay) before."""
    monkeypatch.setattr('ros_3d_bb.nodes.common.rgbd_inputs.arrival_clock_ns', lambda: connections.now.to_nsec())
    for stamp_ns, depth_mm in (START_NS, 1500), (START_NS + 2 * NS // 5, 2000):
        connections.now = time_from(stamp_ns)
        connections.send(INFO_TOPICS[0], good_messages(stamp_ns)[INFO_TOPICS[0]])
        connections.send(DEPTH_TOPIC, depth_message(stamp_ns, depth_mm))
    connections.now = time_from(stamp_ns + NS // 20)
    connections.send(BOXES_TOPIC, Int32MultiArray(data=[20, 10, 44, 38]))
    message = connections.publishers[BOXES3D_TOPIC].newest
    assert message.header.stamp == time_from(stamp_ns) and message.boxes[0].center.position.z == pytest.approx(2.0)


def test_debug_images_are_published_while_they_have_subscribers(connections):
    images = {name: connections.publishers['ros_3d_bb/' + name] for name in ('color', 'raw', 'depth')}
    for number in range(3):  # colour is subscribed with the first boxes
        send_image(connections, START_NS + number * NS // 30)
        connections.send(COLOR_TOPIC, Image())  # without a stamp
    assert (imgmsg_to_rgb(images['color'].newest) == VALID_COLOR).all(axis=2).any()
    assert np.unique(imgmsg_to_rgb(images['raw'].newest)).tolist() == [90]
    assert images['depth'].newest.encoding == 'mono8'
    for publisher in images.values():
        publisher.connections = 0
    send_image(connections, START_NS + NS)
    assert connections.subscribers[COLOR_TOPIC].unregister.called


PEOPLE = [{'start': [4.0, 0.8], 'facing': 3.1, 'height': 1.8}, {'start': [5.0, -0.9], 'facing': 1.6, 'height': 1.7}]


def answer(frame_id='camera_color_optical_frame', **scenario):
    """The boxes and the annotated image of one image, the counts of the node, and the true boxes."""
    simulator = Simulator(scenario_from(dict({'rate': 10.0, 'people': PEOPLE}, **scenario)))
    frame = simulator.frame(0)
    with masterless({'detector': 'depth'}) as connections:
        node = DetectorNode()
        for topic, message in simulated_messages(simulator, frame, START_NS):
            topic = '/tf' if topic == 'tf' else topic
            if topic != '/tf':
                message.header.frame_id = frame_id
            if topic in connections.subscribers:
                connections.send(topic, message)
        outputs = [connections.publishers[topic].newest for topic in (BOXES_TOPIC, 'yolo_result_out')]
    return outputs + [node._diagnostics.counts, [person.box_px for person in frame.people]]


@pytest.mark.parametrize('frame_id', ['camera_color_optical_frame', 'unknown_to_tf'])
def test_people_are_detected_with_stamp_and_frame_of_the_image(frame_id):
    """Without a transform, the floor is fitted to the depth image."""
    message, drawn, counts, true_boxes = answer(frame_id)
    found = boxes2d_from_msg(message)
    assert (found.stamp_ns, found.frame_id) == (START_NS, frame_id) and drawn.header.stamp.to_nsec() == START_NS
    assert len(found.boxes) == len(true_boxes)
    assert all(iou(np.array(box, float), found.boxes.astype(float)).max() > 0.5 for box in true_boxes)
    assert set(found.labels) == {'person'} and (found.scores > 0).all()
    assert ('tilt of the camera unknown' in counts) == (frame_id == 'unknown_to_tf')


def test_nothing_is_published_while_no_floor_is_known():
    """Neither from tf nor from a depth image: an empty array would mean that there are no people."""
    message, _drawn, counts, _true_boxes = answer('unknown_to_tf', people=[], robot={'pitch': -0.9})
    assert message is None and counts['images without floor'] == 1


@pytest.fixture
def camera(weights):
    """The connections of the node, whose workers work at once."""
    parameters, _nodes = loaded('detector.launch', 'weights:=' + weights)
    with masterless({name.rpartition('/')[2]: value for name, value in parameters.items()}) as connections:
        yield connections


@pytest.fixture
def image(session_folder):
    session = read_session(session_folder)
    return read_color(session.frames[15], session.camera), session.frames[15].boxes_px[0]


def newest(camera):
    message = camera.publishers[BOXES_TOPIC].newest
    return message and boxes2d_from_msg(message)


def sent(camera, image, stamp_ns=START_NS):
    camera.send(COLOR_TOPIC, fill_image(Image(header=header_at(stamp_ns)), image, 'rgb8'))
    return newest(camera)


@pytest.mark.needs('torch')
def test_the_person_is_detected_and_drawn_at_the_stamp_of_the_image(camera, image):
    DetectorNode()
    pixels, box = image
    boxes, drawn = sent(camera, pixels), camera.publishers['yolo_result_out'].newest
    assert boxes.stamp_ns == START_NS == stamp_of(drawn) and boxes.frame_id == 'camera_color_optical_frame'
    assert boxes.labels == ('person',) and 0.25 < boxes.scores[0] < 1
    assert iou(np.array(box, float), boxes.boxes).tolist() > [0.8]
    lines, columns = np.nonzero((imgmsg_to_rgb(drawn) != pixels).any(axis=2))
    assert abs(columns.max() - box[2]) < 30 and abs(lines.max() - box[3]) < 30


@pytest.mark.needs('torch')
def test_the_service_pauses_and_changed_parameters_apply_to_later_images(camera, image):
    """An empty array means that no people were detected."""
    node = DetectorNode()
    assert 'paused' in node._worker._on_request(SetBoolRequest(False)).message
    assert sent(camera, image[0]) is None and node._worker._on_request(SetBoolRequest(True)).success
    for changes, count in (({'confidence': 1.0}, 0), ({}, 1), ({'image_size': 320}, 1), ({'image_size': 0}, 1)):
        node._reconfigure(node.params, DetectionParams(**changes), RuntimeParams())
        assert len(sent(camera, image[0]).boxes) == count
    with pytest.raises(ValueError, match='unicorn'):
        node._reconfigure(node.params, DetectionParams(confidence=1.0, classes=['unicorn']), RuntimeParams())
    assert len(sent(camera, image[0]).boxes) == 1


def test_a_slow_network_gets_smaller_images_as_the_range_permits_and_then_fewer_at_a_steady_rate():
    """All detections take 50 ms, at 30 Hz."""
    clock = mock.Mock(monotonic=mock.Mock(side_effect=np.arange(0, 1000, 0.05)))
    with masterless({'weights': 'blind.pt'}) as connections, mock.patch.object(detector_output, 'time', clock):
        node, sizes, stamps_ns = TARGETS['detector_node yolov5'].make(), [], []
        for number in range(4 * WINDOW):
            messages = good_messages(START_NS + number * NS // 30)
            for topic in (INFO_TOPICS[0], COLOR_TOPIC):
                connections.send(topic, messages[topic])
            sizes.append(node._worker.pace.size)
            stamps_ns.append(newest(connections).stamp_ns)
    assert [sizes[count * WINDOW - 1] for count in (1, 2, 3)] == [448, 384, 384]  # 320 is too small for 8 m
    assert set(np.diff(stamps_ns[:3 * WINDOW])) <= {NS // 30, NS // 30 + 1}
    assert len(set(stamps_ns[3 * WINDOW - 1:])) == 1 + WINDOW // 2
    assert node._diagnostics.counts['changes of image size or rate'] == 3
    assert node._diagnostics.counts['images skipped for a steady rate'] == WINDOW - WINDOW // 2


@pytest.fixture
def viewer(tmp_path):
    parameters, _nodes = loaded('viewer.launch', 'session:=%s' % (tmp_path / 'a session'), 'window:=false')
    with masterless({name.rpartition('/')[2]: value for name, value in parameters.items()}) as connections:
        connections.node, connections.folder = ViewerNode(), parameters['/viewer_node/session']
        yield connections


def test_captures_are_appended_and_an_image_is_stored_once(viewer):
    viewer.send(COLOR_TOPIC, Image())  # rejected
    assert not viewer.node.capture()[0] and not os.path.exists(viewer.folder)
    box = Box3D(np.array([0.5, 0.1, 3.0]), np.array([0.5, 1.7, 0.5]), (26, 8, 38, 44), 0.75, (False,) * 4)
    for number, label in enumerate('AB'):
        messages = good_messages(START_NS + number)
        messages[BOXES3D_TOPIC] = boxes3d_to_msg([box], messages[BOXES3D_TOPIC].header, CAMERA)
        send_image(viewer, START_NS + number, messages)
        with mock.patch('rospy.get_param_cached', return_value=label):
            assert viewer.node.capture()[0] and not viewer.node.capture()[0]
    session = read_session(viewer.folder)
    assert (session.camera, session.frame_id) == (CAMERA, 'camera')
    assert [(frame.stamp_ns, frame.label) for frame in session.frames] == [(START_NS, 'A'), (START_NS + 1, 'B')]
    for frame in session.frames:
        np.testing.assert_array_equal(read_color(frame, session.camera), imgmsg_to_rgb(messages[COLOR_TOPIC]))
        np.testing.assert_array_equal(read_depth(frame, session).values, imgmsg_to_depth(messages[DEPTH_TOPIC]).values)
        assert frame.boxes_px == ((26, 8, 38, 44),)
        np.testing.assert_allclose([detection.estimate_m for detection in frame.detections], [[0.5, 0.1, 3.0]])
