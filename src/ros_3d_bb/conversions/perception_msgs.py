"""Conversions between ROS messages and the detections, boxes, tracks, cameras and maps of this package."""
import functools
import math
import re
from typing import Any, Dict, Iterable, List, Optional, Sequence, Tuple

import genpy
import numpy as np
from geometry_msgs.msg import PoseWithCovariance, TransformStamped
from sensor_msgs.msg import CameraInfo
from std_msgs.msg import Header, Int32MultiArray, MultiArrayDimension
from tf2_msgs.msg import TFMessage

from ros_3d_bb import msg
from ros_3d_bb.camera.camera_model import Camera, Vector, check_intrinsics, transform_from
from ros_3d_bb.camera.images import RgbdFrame
from ros_3d_bb.core.boxes2d import Boxes2D
from ros_3d_bb.core.object_classes import MAX_COORDINATE_M, MAX_SIZE_M, PERSON, label_fault, score_fault, usable_label
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.estimation.box3d import Box3D
from ros_3d_bb.msg import BoundingBox3D, BoundingBox3DArray, TrackedObjectArray
from ros_3d_bb.tracking.ignored_areas import OccupiedCells
from ros_3d_bb.tracking.types import TrackedObject

BOXES_TOPIC, BOXES3D_TOPIC, TRACKS_TOPIC = 'yolo_bounding_box', 'ros_3d_bb/bb_3d', 'ros_3d_bb/tracks'
NEWEST = genpy.Time(0)  # tf returns the latest transform for stamp 0
LATEST_NS = 2 ** 31 * NS  # limit of stamps, as their differences must fit into a ROS duration
EDGE_FLAGS = BoundingBox3D.LEFT, BoundingBox3D.TOP, BoundingBox3D.RIGHT, BoundingBox3D.BOTTOM
ROUNDING = 1e-9  # tolerance of eigenvalues of a covariance, relative to its largest element if that exceeds 1
APPEARANCE_NUMBERS = 6  # see BoundingBox3D.msg
MAX_BOXES = 1000  # more boxes in one image are an error of the publisher and would stall the pipeline
# Classes and scores follow the frame in the label of 2D boxes; frames may contain semicolons.
CLASSES = re.compile(r'(?:;classes=([^;]*))?(?:;scores=([^;]*))?\Z')
OCCUPIED = 65  # of 100, as from map_server (occupied_thresh)
CORNERS = 'x1 y1 x2 y2'  # label of the second dimension, followed by the size of the image if it is known
IMAGE_SIZE = re.compile(r' in ([0-9]{1,9}) x ([0-9]{1,9})\Z')


def time_from(stamp_ns: int) -> genpy.Time:
    return genpy.Time(*divmod(stamp_ns, NS))


def stamp_of(message: Any) -> int:
    """Return the stamp of a message in integer nanoseconds.

    Raises ValueError if the stamp is zero, because the message cannot be paired or transformed, or if it exceeds the
    range of tf2, which would terminate the process.
    """
    stamp_ns = message.header.stamp.to_nsec()
    if stamp_ns == 0:
        raise ValueError('the %s of frame %r has no stamp (zero)' % (type(message).__name__, message.header.frame_id))
    if stamp_ns >= LATEST_NS:
        raise ValueError('the %s of frame %r has the stamp %d s, of the year 2038 or later'
                         % (type(message).__name__, message.header.frame_id, stamp_ns // NS))
    return stamp_ns


def stamp_if_any(message: Any) -> Optional[int]:
    """Return the stamp as `stamp_of`, or None if it is zero: for messages without a fixed time, such as CameraInfo."""
    return stamp_of(message) if message.header.stamp else None


def check_transforms(message: TFMessage) -> None:
    """Raise ValueError if a stamp in a tf2_msgs/TFMessage exceeds the range of tf2, see `stamp_of`."""
    for transform in message.transforms:
        if transform.header.stamp.to_nsec() >= LATEST_NS:
            raise ValueError('the transform of %s has the stamp %d s, of the year 2038 or later'
                             % (transform.child_frame_id, transform.header.stamp.secs))


def boxes2d_to_msg(boxes: np.ndarray, header: Header, labels: Optional[Sequence[str]] = None,
                   scores: Optional[Vector] = None,
                   image_size: Optional[Sequence[int]] = None) -> Int32MultiArray:
    """Convert 2D boxes to std_msgs/Int32MultiArray, with the stamp and frame of their image in the layout.

    `boxes` (n, 4) are x1, y1, x2, y2 in pixels, which are rounded to integers; `header` is that of the image. `labels`
    are the class names of the boxes, and `scores` are 0..1; both follow in the layout if they are given. Characters of
    class names that the layout cannot carry are replaced (`usable_label`). The (width, height) of the image shows
    whether it has the size of the camera_info.
    """
    message = Int32MultiArray(data=np.rint(boxes).astype(int).ravel().tolist())
    label = 'boxes;stamp=%d.%09d;frame=%s' % (header.stamp.secs, header.stamp.nsecs, header.frame_id)
    if labels is not None and len(boxes):
        label += ';classes=' + ','.join(map(usable_label, labels))
    if scores is not None and len(boxes):
        label += ';scores=' + ','.join('%.3g' % score for score in scores)
    message.layout.dim = [MultiArrayDimension(label=label, size=len(boxes), stride=4 * len(boxes)),
                          MultiArrayDimension(label=CORNERS, size=4, stride=4)]
    if image_size is not None:
        message.layout.dim[1].label += ' in %d x %d' % tuple(image_size)
    return message


def detections2d_to_msg(detections: Any, names: Sequence[str], header: Header,
                        image_size: Sequence[int]) -> Int32MultiArray:
    return boxes2d_to_msg(detections.boxes, header, [names[number] for number in detections.classes],
                          detections.scores, image_size)


def boxes2d_from_msg(message: Int32MultiArray) -> Boxes2D:
    """Convert an Int32MultiArray, with or without stamp, classes and scores in its layout, to Boxes2D.

    Without classes, the boxes are those of people; without scores, their scores are unknown. Raises ValueError if the
    length is not a multiple of 4, there are too many boxes, or the label is malformed: the stamp is not a number, there
    is not one class or one score for each box, or one of them is invalid.
    """
    if len(message.data) % 4:
        raise ValueError('2D boxes have %d numbers; a multiple of 4 expected (x1 y1 x2 y2 each)' % len(message.data))
    if len(message.data) > 4 * MAX_BOXES:
        raise ValueError('%d 2D boxes in one image; at most %d expected' % (len(message.data) // 4, MAX_BOXES))
    boxes = np.array(message.data, np.int64).reshape(-1, 4)
    dimensions = message.layout.dim
    label = dimensions[0].label if dimensions else ''
    size = IMAGE_SIZE.search(dimensions[1].label) if len(dimensions) > 1 else None
    image_size = size and (int(size.group(1)), int(size.group(2)))
    classes_and_scores: Any = CLASSES.search(label)  # which matches any text
    labels, scores = _labels_and_scores(len(boxes), *classes_and_scores.groups())
    fields = {}
    for field in label[:classes_and_scores.start()].split(';', 2):
        name, _equals, value = field.partition('=')
        fields[name] = value
    if 'stamp' not in fields:
        return Boxes2D(boxes, None, '', labels, scores, image_size)
    secs, _dot, nsecs = fields['stamp'].partition('.')
    if not (secs.isdigit() and nsecs.isdigit() and len(nsecs) == 9):
        raise ValueError('2D boxes have the label %r; boxes;stamp=<secs>.<nsecs, 9 digits>;frame=<frame_id> expected'
                         % label)
    return Boxes2D(boxes, int(secs) * NS + int(nsecs), fields.get('frame', ''), labels, scores, image_size)


def _labels_and_scores(count: int, classes: Optional[str], scores: Optional[str]) -> Tuple[Tuple[str, ...], np.ndarray]:
    """Class names and scores of `count` boxes from the texts in a label, which are None if they are missing."""
    labels, numbers = (PERSON,) * count, np.zeros(count)
    for name, text in (('classes', classes), ('scores', scores)):
        if text and text.count(',') + 1 != count:
            raise ValueError('2D boxes have %d %s for %d boxes; one for each box expected'
                             % (text.count(',') + 1, name, count))
    if classes:
        labels = tuple(classes.split(','))
        for fault in filter(None, map(label_fault, set(labels))):
            raise ValueError('2D boxes have %s' % fault)
    if scores:
        try:
            numbers = np.array(list(map(float, scores.split(','))))
        except ValueError as error:
            raise ValueError('2D boxes have unusable scores: %s' % error)
        for fault in filter(None, map(score_fault, numbers)):
            raise ValueError('2D boxes have %s' % fault)
    return labels, numbers


def with_stamp(message: Any, stamp: genpy.Time) -> Any:
    """Replace the stamp of a message: in its header, the headers of its transforms, or the label of its 2D boxes.

    Frames are kept. Messages with a header are modified in place, because images are large. Returns the message.
    """
    if hasattr(message, 'layout'):
        boxes = boxes2d_from_msg(message)
        return boxes2d_to_msg(boxes.boxes, Header(stamp=stamp, frame_id=boxes.frame_id), boxes.labels, boxes.scores,
                              boxes.image_size)
    for part in getattr(message, 'transforms', [message]):
        part.header.stamp = stamp
    return message


def camera_from_msg(message: CameraInfo) -> Camera:
    """Convert a sensor_msgs/CameraInfo to a camera model with intrinsics and lens distortion, of the images that it
    belongs to: K is that of the full resolution, of which `roi` and `binning` are a part.

    realsense2_camera labels the inverse Brown-Conrady model of librealsense as plumb_bob; the two differ by a few
    hundredths of a pixel. Raises ValueError if K is zero, as for an uncalibrated camera, or does not belong to images
    of that size, or as `Camera`.
    """
    roi = message.roi
    size = message.width, message.height
    part = (roi.x_offset, roi.y_offset, roi.width or message.width, roi.height or message.height)
    binning = message.binning_x or 1, message.binning_y or 1
    return _camera_of(size, part, binning, tuple(message.K), message.distortion_model, tuple(message.D))


@functools.lru_cache(maxsize=16)  # cameras send their calibration with each image
def _camera_of(size: Tuple[int, int], part: Tuple[int, int, int, int], binning: Tuple[int, int],
               matrix: Tuple[float, ...], distortion_model: str, distortion: Tuple[float, ...]) -> Camera:
    if not any(matrix):
        raise ValueError('it is empty (all of K is zero): the driver does not know the calibration of the camera')
    check_intrinsics(Camera(*size, matrix[0], matrix[4], matrix[2], matrix[5]))
    (left, top, width, height), (binning_x, binning_y) = part, binning
    return Camera(width // binning_x, height // binning_y, matrix[0] / binning_x, matrix[4] / binning_y,
                  (matrix[2] - left) / binning_x, (matrix[5] - top) / binning_y, distortion_model, distortion)


def transform_from_msg(message: TransformStamped) -> np.ndarray:
    """Convert a geometry_msgs/TransformStamped to a 4x4 matrix, header.frame_id from child_frame_id."""
    translation, rotation = message.transform.translation, message.transform.rotation
    return transform_from((translation.x, translation.y, translation.z),
                          (rotation.x, rotation.y, rotation.z, rotation.w))


def header_of(frame: RgbdFrame) -> Header:
    """Return the header of the 3D boxes in an RgbdFrame, whose positions are those at the stamp of the depth image."""
    return Header(stamp=time_from(frame.depth_stamp_ns), frame_id=frame.frame_id)


def boxes3d_to_msg(boxes: Iterable[Box3D], header: Header, camera: Camera) -> BoundingBox3DArray:
    """Convert 3D boxes (`box3d.Box3D`) to BoundingBox3DArray. Inverse of `usable_boxes3d`."""
    array = BoundingBox3DArray(header=header)
    for box in boxes:
        score, support = np.array((box.score, box.support), np.float32).tolist()  # as received, as in process_bag
        message = BoundingBox3D(label=box.label, score=score, support=support, truncated=any(box.truncated_edges))
        for flag, is_cut in zip(EDGE_FLAGS, box.truncated_edges):
            message.truncated_edges |= flag if is_cut else 0
        _set_position(message.center, box.center_m.tolist())
        _set_xyz(message.size, box.size_m.tolist())
        if box.covariance_m2 is not None:
            message.position_covariance = np.ravel(box.covariance_m2).tolist()
        message.appearance = box.appearance or ()
        x1, y1, x2, y2 = box.rect_px
        x1, x2 = min(max(x1, 0), camera.width), min(max(x2, 0), camera.width)
        y1, y2 = min(max(y1, 0), camera.height), min(max(y2, 0), camera.height)
        message.roi.x_offset, message.roi.width = x1, x2 - x1
        message.roi.y_offset, message.roi.height = y1, y2 - y1
        array.boxes.append(message)
    return array


def _box3d_from_msg(box: BoundingBox3D) -> Box3D:
    covariance_m2 = np.reshape(box.position_covariance, (3, 3)) if any(box.position_covariance) else None
    roi = box.roi
    rect_px = (roi.x_offset, roi.y_offset, roi.x_offset + roi.width, roi.y_offset + roi.height)
    edges: Any = tuple([bool(box.truncated_edges & flag) for flag in EDGE_FLAGS])
    if box.truncated and not any(edges):
        edges = (True,) * len(EDGE_FLAGS)  # the truncated edges are unknown, so no edge is trusted
    return Box3D(_xyz(box.center.position), _xyz(box.size), rect_px, box.support, edges, covariance_m2,
                 box.label or PERSON, box.score, appearance=tuple(box.appearance) or None)


def usable_boxes3d(message: BoundingBox3DArray) -> Tuple[Dict[int, Box3D], List[str]]:
    """Convert the 3D boxes of a BoundingBox3DArray that can be tracked. Inverse of `boxes3d_to_msg`.

    Returns {index in the message: `box3d.Box3D`}, and a sentence about the fault of each other box. Raises
    ValueError if there are too many boxes.
    """
    if len(message.boxes) > MAX_BOXES:
        raise ValueError('%d 3D boxes in one image; at most %d expected' % (len(message.boxes), MAX_BOXES))
    usable, faults = {}, []
    for index, box_msg in enumerate(message.boxes):
        box = _box3d_from_msg(box_msg)
        fault = _box3d_fault(box, box_msg.position_covariance)
        if fault:
            faults.append('3D box %d has %s' % (index, fault))
        else:
            usable[index] = box
    return usable, faults


def _box3d_fault(box: Box3D, position_covariance: Sequence[float]) -> str:
    """Describe what is wrong with a Box3D from a message, '' if it can be tracked."""
    if not box.is_plausible:
        return ('centre (%g, %g, %g) and size (%g, %g); finite numbers and sizes of more than 0 and less than %g m '
                'expected' % (tuple(box.center_m) + tuple(box.size_m[:2]) + (MAX_SIZE_M,)))
    if not _is_covariance(position_covariance):
        return ('the position_covariance %s; a finite, positive semi-definite matrix, or zeros where it is not known, '
                'expected' % list(position_covariance))
    if box.appearance is not None and not (
            len(box.appearance) == APPEARANCE_NUMBERS and np.isfinite(box.appearance).all()):
        return 'the appearance %s; %d finite numbers expected' % (list(box.appearance), APPEARANCE_NUMBERS)
    return label_fault(box.label) or score_fault(box.score)


def _is_covariance(elements_m2: Sequence[float]) -> bool:
    """Whether a 3x3 matrix, given by rows, is finite and positive semi-definite.

    It is if the Gaussian elimination of its symmetric part, plus the tolerance, has positive pivots. For single small
    matrices, arithmetic is several times as fast as numpy's eigenvalues.
    """
    if not (math.isfinite(sum(elements_m2)) and max(map(abs, elements_m2)) < MAX_COORDINATE_M):
        return False
    xx, xy, xz, yx, yy, yz, zx, zy, zz = elements_m2
    tolerance_m2 = ROUNDING * max(1, max(elements_m2)) / 2
    xy, xz, yz = (xy + yx) / 2, (xz + zx) / 2, (yz + zy) / 2
    pivot_x = xx + tolerance_m2
    if pivot_x <= 0:
        return False
    pivot_y, yz = yy + tolerance_m2 - xy * xy / pivot_x, yz - xy * xz / pivot_x
    return pivot_y > 0 and zz + tolerance_m2 - xz * xz / pivot_x - yz * yz / pivot_y > 0


def tracks_to_msg(tracks: Iterable[TrackedObject], header: Header) -> TrackedObjectArray:
    return TrackedObjectArray(header=header, objects=[_track_to_msg(track) for track in tracks])


def _track_to_msg(track: TrackedObject) -> Any:
    message = msg.TrackedObject(id=track.id, label=track.label, score=track.score, detection=track.detection,
                                status=track.status, moving=track.moving,
                                first_seen=time_from(track.first_seen_ns), last_seen=time_from(track.last_seen_ns),
                                prediction_step=genpy.Duration.from_sec(track.prediction_step_s))
    _set_xyz(message.size, track.size_m.tolist())
    _set_xyz(message.twist.twist.linear, track.velocity_mps.tolist())
    _set_position(message.pose.pose, track.position_m.tolist())
    for position_m in track.prediction_m.tolist():
        pose = PoseWithCovariance()
        point, pose.pose.orientation.w = pose.pose.position, 1.0
        point.x, point.y, point.z = position_m
        message.prediction.append(pose)
    if track.covariance is not None:
        message.pose.covariance, message.twist.covariance, *ahead = _covariances_6x6(track, track.covariance)
        for pose, covariance in zip(message.prediction, ahead):
            pose.covariance = covariance
    return message


def _covariances_6x6(track: TrackedObject, covariance: np.ndarray) -> List[List[float]]:
    """Flattened 6x6 covariances, as in geometry_msgs, of the position, the velocity and the predicted positions of a
    track; zeros for the rotation: an upright cylinder is rotationally symmetric."""
    full = np.zeros((2 + len(track.prediction_m), 6, 6))
    full[0, :3, :3], full[1, :3, :3] = covariance[:3, :3], covariance[3:, 3:]
    if track.prediction_covariance_m2 is not None:
        full[2:, :3, :3] = track.prediction_covariance_m2
    return full.reshape(-1, 36).tolist()


def tracks_from_msg(message: TrackedObjectArray) -> List[TrackedObject]:
    """Convert a TrackedObjectArray to a list of `types.TrackedObject`.

    The message contains neither the instantaneous velocity, which is set to the velocity of the track, nor the
    cross-covariance of position and velocity, which is set to zero.
    """
    return [_track_from_msg(track) for track in message.objects]


def _track_from_msg(track: Any) -> TrackedObject:
    velocity_mps = _xyz(track.twist.twist.linear)
    prediction_m = np.array([_xyz(pose.pose.position) for pose in track.prediction]).reshape(-1, 3)
    covariance = prediction_covariance_m2 = None
    if any(track.pose.covariance):
        covariance = np.zeros((6, 6))
        covariance[:3, :3], covariance[3:, 3:] = _covariance_3x3(track.pose), _covariance_3x3(track.twist)
        prediction_covariance_m2 = np.array([_covariance_3x3(pose) for pose in track.prediction]).reshape(-1, 3, 3)
    return TrackedObject(track.id, _xyz(track.pose.pose.position), _xyz(track.size), velocity_mps,
                         track.status, track.moving, track.first_seen.to_nsec(), track.last_seen.to_nsec(),
                         prediction_m, track.prediction_step.to_sec(), covariance, prediction_covariance_m2,
                         track.label or PERSON, track.score, track.detection)


def occupied_from_msg(message: Any) -> OccupiedCells:
    """Convert a nav_msgs/OccupancyGrid to OccupiedCells. Raises ValueError if it is invalid."""
    info, place, turn = message.info, message.info.origin.position, message.info.origin.orientation
    yaw = 2 * np.arctan2(turn.z, turn.w)
    if len(message.data) != info.width * info.height or not info.resolution > 0 or not np.isfinite(
            [place.x, place.y, yaw, info.resolution]).all():
        raise ValueError('it has %d cells of %g m, %d x %d at (%g, %g); cells of a positive size, their number, and '
                         'a finite place expected' % (len(message.data), info.resolution, info.width, info.height,
                                                      place.x, place.y))
    cells = np.reshape(np.array(message.data, np.int8), (info.height, info.width)) >= OCCUPIED
    return OccupiedCells(cells, info.resolution, (place.x, place.y, float(yaw)))


def _covariance_3x3(with_covariance: Any) -> np.ndarray:
    return np.reshape(with_covariance.covariance, (6, 6))[:3, :3]


def _set_position(pose: Any, position_m: Sequence[float]) -> None:
    _set_xyz(pose.position, position_m)
    pose.orientation.w = 1.0


def _set_xyz(message: Any, values: Sequence[float]) -> None:
    message.x, message.y, message.z = values


def _xyz(message: Any) -> np.ndarray:
    return np.array([message.x, message.y, message.z])
