import numpy as np
import pytest
from geometry_msgs.msg import Point, Vector3
from hypothesis import given, strategies as st
from sensor_msgs.msg import CameraInfo
from std_msgs.msg import Header, Int32MultiArray, MultiArrayDimension

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.conversions.camera_msgs import CameraFrame, info_of_images, info_topic_beside, messages_of
from ros_3d_bb.conversions.perception_msgs import (boxes2d_from_msg, boxes2d_to_msg, boxes3d_to_msg, camera_from_msg,
                                                   stamp_of, time_from, tracks_from_msg, tracks_to_msg, usable_boxes3d)
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.estimation.box3d import Box3D
from ros_3d_bb.msg import BoundingBox3D, BoundingBox3DArray, TrackedObject
from ros_3d_bb.tracking.types import OCCLUDED, OUT_OF_VIEW, VISIBLE, TrackedObject as Track, detections_from_boxes
from support.masterless import on_the_wire
from support.people import mounted
from support.ros import header_at

INT32 = st.integers(-2 ** 31, 2 ** 31 - 1)
STAMP = st.integers(1, 2 ** 32 * NS - 1)


@given(st.lists(st.tuples(INT32, INT32, INT32, INT32), max_size=20), STAMP, st.sampled_from(['camera', 'a/b_c', '']))
def test_2d_boxes_and_their_stamp_survive_to_the_nanosecond(boxes, stamp_ns, frame_id):
    message = boxes2d_to_msg(np.array(boxes, float).reshape(-1, 4), header_at(stamp_ns, frame_id))
    back = boxes2d_from_msg(on_the_wire(message))
    assert back.boxes.tolist() == [list(box) for box in boxes]
    assert back.stamp_ns == stamp_ns and back.frame_id == frame_id
    assert message.layout.dim[0].size == len(boxes) and message.layout.data_offset == 0


def labelled(label):
    message = Int32MultiArray(data=[1, 2, 3, 4])
    message.layout.dim = [MultiArrayDimension(label=label)]
    return message


def test_2d_boxes_without_stamp_and_classes_are_people_with_unknown_scores():
    for message in Int32MultiArray(data=[1, 2, 3, 4]), labelled('boxes'):
        boxes = boxes2d_from_msg(on_the_wire(message))
        assert boxes.stamp_ns is None and boxes.boxes.tolist() == [[1, 2, 3, 4]]
        assert boxes.labels == ('person',) and boxes.scores.tolist() == [0]


@pytest.mark.parametrize('frame_id', ['camera', 'a;b', 'a;classes', ''])
def test_2d_boxes_are_rounded_and_keep_classes_and_scores(frame_id):
    boxes = np.array([[0.4, 1.6, 2.5, -0.6], [5, 6, 7, 8]])
    message = boxes2d_to_msg(boxes, header_at(NS, frame_id), ['person', 'traffic light'], [0.9134, 0.42])
    assert message.data == [0, 2, 2, -1, 5, 6, 7, 8]
    assert message.layout.dim[0].label == (
        'boxes;stamp=1.000000000;frame=%s;classes=person,traffic light;scores=0.913,0.42' % frame_id)
    back = boxes2d_from_msg(on_the_wire(message))
    assert back.frame_id == frame_id and back.stamp_ns == NS
    assert back.labels == ('person', 'traffic light') and back.scores.tolist() == [0.913, 0.42]


def test_class_names_keep_what_the_array_can_carry():
    message = boxes2d_to_msg([(1, 2, 3, 4)] * 3, header_at(NS), [' fire hydrant', 'a;b,c', ''])
    assert boxes2d_from_msg(message).labels == ('fire hydrant', 'a_b_c', '_')


@pytest.mark.parametrize('convert,message,reason', [
    (boxes2d_from_msg, labelled('boxes;stamp=1.5'), 'expected'),
    (boxes2d_from_msg, labelled('boxes;stamp=-1.000000000'), 'expected'),
    (boxes2d_from_msg, labelled('boxes;stamp=1.000000000;frame=a;classes=dog,cat'), '2 classes for 1 boxes'),
    (boxes2d_from_msg, labelled('boxes;stamp=1.000000000;frame=a;classes=dog;scores=0.5,0.5'), '2 scores for 1 boxes'),
    (boxes2d_from_msg, labelled('boxes;classes=dog;scores=high'), 'unusable scores'),
    (boxes2d_from_msg, labelled('boxes;classes=dog;scores=nan'), 'the score nan; 0..1 expected'),
    (boxes2d_from_msg, labelled('boxes;classes=dog;scores=1.01'), 'the score 1.01; 0..1 expected'),
    (boxes2d_from_msg, labelled('boxes;classes=do\x07g'), '1 to 64 printable ASCII characters'),
    (boxes2d_from_msg, Int32MultiArray(data=[1] * 3), 'multiple of 4'),
    (boxes2d_from_msg, Int32MultiArray(data=[1] * 4004), '1001 2D boxes'),
    (camera_from_msg, CameraInfo(width=640, height=480), 'it is empty'),
    (camera_from_msg, CameraInfo(width=640, height=480, K=[0, 0, 320, 0, 610, 240, 0, 0, 1]), 'fx=0'),
    (camera_from_msg, CameraInfo(width=640, height=480, K=[600, 0, 700, 0, 600, 240, 0, 0, 1]), 'principal point'),
    (camera_from_msg, CameraInfo(width=640, height=480, K=[3600, 0, 320, 0, 3600, 240, 0, 0, 1]), 'view is 10.2'),
    (camera_from_msg, CameraInfo(width=640, height=480, K=[60, 0, 320, 0, 60, 240, 0, 0, 1]), 'view is 158.8'),
    (stamp_of, BoundingBox3DArray(header=Header(frame_id='a')), "BoundingBox3DArray of frame 'a' has no stamp"),
    (stamp_of, BoundingBox3DArray(header=header_at(2 ** 31 * NS)), 'year 2038')])
def test_messages_are_rejected(convert, message, reason):
    with pytest.raises(ValueError, match=reason):
        convert(message)


@pytest.mark.parametrize('lens', [('', ()), ('plumb_bob', (0.1, -0.2, 0.001, 0.002, 0.3)),
                                  ('rational_polynomial', (8.5, 5.2, 1e-4, -5e-5, 0.21, 8.9, 8.0, 1.35)),
                                  ('equidistant', (0.0, 0.0, 0.0, 0.0))])
def test_camera_info_has_the_lens_distortion(lens):
    camera = Camera(640, 480, 600, 610, 320, 240, *lens)
    frame = CameraFrame(header_at(5), camera, np.zeros((480, 640, 3), np.uint8),
                        DepthImage(np.zeros((480, 640), np.uint16), 0.001), [])
    infos = [on_the_wire(message) for _topic, message in messages_of(frame) if isinstance(message, CameraInfo)]
    assert [camera_from_msg(info) for info in infos] == [camera, camera]
    assert infos[0].distortion_model == (lens[0] or 'plumb_bob') and len(infos[0].D) == (len(lens[1]) or 5)


def box_of(width_m=0.5, height_m=1.7, x_m=0.0, y_m=0.0, edge='', covariance_m2=np.zeros((3, 3)), **fields):
    box = BoundingBox3D(position_covariance=np.ravel(covariance_m2).tolist(), truncated=bool(edge),
                        truncated_edges=getattr(BoundingBox3D, edge) if edge else 0, **fields)
    box.center.position = Point(x_m, y_m, 3.0)
    box.size = Vector3(width_m, height_m, width_m)
    return box


def detection_of(box, roll_deg=0, pitch_deg=0, yaw_deg=0):
    """The detection of a camera 1 m above the map that points along x, rolled clockwise as seen by the camera."""
    boxes, _faults = usable_boxes3d(BoundingBox3DArray(boxes=[box]))
    detection, = detections_from_boxes(boxes, mounted(1.0, pitch_deg, roll_deg, yaw_deg))
    return detection


@pytest.mark.parametrize('covariance_m2', [None, np.diag([0.01, 0.04, 0.09])])
def test_3d_boxes_survive(covariance_m2):
    sent = Box3D(np.array([0.1, 0.2, 3.0]), np.array([0.5, 1.7, 0.5]), (10, 20, 64, 48), 0.75,
                 (False, False, True, True), covariance_m2, 'dog', 0.625,
                 appearance=(0.25, 0.5, 4.0, -0.5, 0.125, 3.5) if covariance_m2 is None else None)
    camera = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)
    boxes, _faults = usable_boxes3d(on_the_wire(boxes3d_to_msg([sent], header_at(1), camera)))
    back = boxes[0]
    for field, value in sent._asdict().items():
        np.testing.assert_array_equal(getattr(back, field), value)


def test_intrinsics_are_those_of_the_cropped_and_decimated_images():
    """As of the nodelet crop_decimate: from column 200 and row 40 on, every second pixel of 400 x 300."""
    info = CameraInfo(width=640, height=480, K=[600, 0, 320, 0, 610, 240, 0, 0, 1])
    whole = camera_from_msg(info)
    info.binning_x = info.binning_y = 2
    assert camera_from_msg(info)[:6] == (320, 240, 300, 305, 160, 120)
    info.roi.x_offset, info.roi.y_offset, info.roi.width, info.roi.height = 200, 40, 400, 300
    part = camera_from_msg(info)
    assert part[:2] == (200, 150)
    np.testing.assert_allclose(part.deproject([[5, 8]], 2.0), whole.deproject([[200 + 2 * 5, 40 + 2 * 8]], 2.0))


@pytest.mark.parametrize('wrong', [
    {'x_m': float('nan')}, {'x_m': 1e300}, {'width_m': 0.0}, {'width_m': float('nan')}, {'width_m': 10.0},
    {'height_m': 10.93}, {'covariance_m2': -np.eye(3)}, {'covariance_m2': np.full((3, 3), np.nan)},
    {'covariance_m2': 1e308 * np.eye(3)}, {'covariance_m2': [[1, 5, 0], [5, 1, 0], [0, 0, 1]]},
    {'appearance': [0.0] * 5}, {'appearance': [np.inf] * 6}, {'score': np.nan}, {'score': -0.1},
    {'score': 1.5}, {'label': 'a;b'}, {'label': 'x' * 65}, {'label': u'\u9f8d'}])
def test_an_unusable_3d_box_does_not_affect_the_others(wrong):
    good, other = box_of(x_m=-1.0), box_of(x_m=2.0, width_m=9.99, covariance_m2=np.eye(3))
    usable, faults = usable_boxes3d(BoundingBox3DArray(header=header_at(7), boxes=[good, box_of(**wrong), other]))
    assert list(usable) == [0, 2] and len(faults) == 1
    detections = detections_from_boxes(usable, np.eye(4))
    assert [(detection.index, detection.position_m[0]) for detection in detections] == [(0, -1.0), (2, 2.0)]


def test_detections_are_upright_in_the_fixed_frame():
    """Width and depth of the cylinder are horizontal, its height is z; covariances are rotated."""
    detection = detection_of(box_of(0.6, 1.8, 0.5, 0.1, covariance_m2=np.diag([0.01, 0.04, 0.09])))
    np.testing.assert_allclose(detection.position_m, (3, -0.5, 0.9))
    np.testing.assert_allclose(detection.size_m, (0.6, 0.6, 1.8))
    np.testing.assert_allclose(detection.covariance_m2, np.diag([0.09, 0.01, 0.04]), atol=1e-12)
    unknown = box_of()
    unknown.truncated = True  # no edge is trusted if the truncated edges are unknown
    assert detection_of(unknown).truncated_edges == (True,) * 4


@pytest.mark.parametrize('roll_deg,size_m,edge', [
    (0, (0.5, 1.75), 'TOP'), (90, (1.75, 0.5), 'LEFT'), (180, (0.5, 1.75), 'BOTTOM'), (-90, (1.75, 0.5), 'RIGHT'),
    (20, (0.5, 1.75), 'TOP'), (70, (1.75, 0.5), 'LEFT'), (-160, (0.5, 1.75), 'BOTTOM')])
def test_people_are_upright_for_any_mount_of_the_camera(roll_deg, size_m, edge):
    """The head is truncated."""
    detection = detection_of(box_of(*size_m, edge=edge), roll_deg)
    np.testing.assert_allclose(detection.size_m, (0.5, 0.5, 1.75))
    assert detection.truncated_edges == (False, True, False, False)


def test_tracks_survive_and_fill_every_field():
    prediction_m, variances = np.array([[1.5, 2, 3], [2, 2, 3]]), np.array([2 * np.eye(3), 3 * np.eye(3)])
    sent = Track(7, np.array([1.0, 2, 3]), np.array([0.5, 0.5, 1.7]), np.array([1.0, 0, 0]), VISIBLE, True, NS,
                 2 * NS, prediction_m, 0.5, np.diag([0.01, 0.02, 0.03, 0.04, 0.05, 0.06]), variances)
    for track in sent, sent._replace(covariance=None, prediction_covariance_m2=None):
        message = on_the_wire(tracks_to_msg([track], header_at(2 * NS, 'map')))
        back, = tracks_from_msg(message)
        np.testing.assert_array_equal(back.covariance, track.covariance)
        np.testing.assert_array_equal(back.prediction_covariance_m2, track.prediction_covariance_m2)
        np.testing.assert_array_equal(back.prediction_m, prediction_m)
    published, = message.objects
    assert message.header.frame_id == 'map' and (published.id, published.status) == (7, TrackedObject.VISIBLE)
    assert published.moving and published.pose.pose.orientation.w == 1 and published.pose.pose.position.x == 1
    assert published.twist.twist.linear.x == 1 and published.size == Vector3(0.5, 0.5, 1.7)
    assert (published.first_seen, published.last_seen) == (time_from(NS), time_from(2 * NS))
    assert published.prediction_step.to_sec() == 0.5 and published.prediction[-1].pose.position.x == 2


def test_states_have_the_numbers_of_the_message():
    numbers = TrackedObject.VISIBLE, TrackedObject.OCCLUDED, TrackedObject.OUT_OF_VIEW
    assert numbers == (VISIBLE, OCCLUDED, OUT_OF_VIEW)


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
