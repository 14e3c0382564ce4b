"""The node that lifts 2D boxes into space with the depth image they belong to."""
import threading
from typing import NamedTuple

import rospy
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header, Int32MultiArray

from ros_3d_bb.error_model import corrected_boxes, read_error_model
from ros_3d_bb.estimation import check_rect, estimate_boxes, estimator_named
from ros_3d_bb.images import depth_from
from ros_3d_bb.messages import boxes2d_from_message, boxes3d_to_message, camera_from_message, stamp_of, time_from
from ros_3d_bb.msg import BoundingBox3DArray
from ros_3d_bb.nodes.diagnostics import Diagnostics
from ros_3d_bb.nodes.sample_images import SampleImages
from ros_3d_bb.nodes.startup import read_params, run_node
from ros_3d_bb.nodes.transport import KEPT_AT_ONCE, subscribe
from ros_3d_bb.params import check_not_negative
from ros_3d_bb.stamped import NS, Pairing, arrival_clock_ns

DEPTH_TOPIC = 'camera/aligned_depth_to_color/image_raw'
CAMERA_INFO_TOPIC = 'camera/color/camera_info'


class Bbox3dParams(NamedTuple):
    """See config/bbox3d.yaml."""

    estimator: str = 'foreground'
    stride: int = 20
    error_model: str = ''
    depth_scale: float = 0.0
    frame_id: str = ''
    cache_length: float = 1.0
    stamp_tolerance: float = 0.005
    assumed_delay: float = 0.05
    depth_image_range: float = 6.0


class Bbox3dNode(object):
    """Lift 2D boxes into the camera's optical frame.

    Subscribes: camera/aligned_depth_to_color/image_raw, camera/color/camera_info, yolo_bounding_box.
    Publishes: ros_3d_bb/bb_3d, with the stamp of the image that the boxes were found in; images to look at (see
    `SampleImages`) while somebody subscribes. Parameters: config/bbox3d.yaml.
    """

    def __init__(self):
        self._params, = read_params(Bbox3dParams)
        check_not_negative(self._params, 'depth_scale', 'cache_length', 'stamp_tolerance', 'assumed_delay',
                           'depth_image_range')
        self._estimator = estimator_named(self._params.estimator, self._params.stride)
        self._error_model = error_model_of(self._params)
        cache_ns, tolerance_ns, delay_ns = (int(seconds * NS) for seconds in (
            self._params.cache_length, self._params.stamp_tolerance, self._params.assumed_delay))
        self._pairing = Pairing(cache_ns, tolerance_ns, delay_ns)
        self._lock = threading.Lock()
        self._diagnostics = Diagnostics()
        self._boxes_pub = rospy.Publisher('ros_3d_bb/bb_3d', BoundingBox3DArray, queue_size=10)
        self._images = SampleImages(cache_ns, self._estimator.sample, self._params.depth_image_range)
        # Each depth image is kept for boxes that may come for it later, so none may be dropped on the way.
        subscribe(DEPTH_TOPIC, Image, self._on_depth, KEPT_AT_ONCE)
        subscribe(CAMERA_INFO_TOPIC, CameraInfo, self._on_camera_info, KEPT_AT_ONCE)
        subscribe('yolo_bounding_box', Int32MultiArray, self._on_boxes)

    def _on_camera_info(self, message):
        with self._diagnostics.refusing('camera_info'), self._lock:
            camera = camera_from_message(message)
            self._lift(self._pairing.add_camera(message.header.stamp.to_nsec(), arrival_clock_ns(), camera))

    def _on_depth(self, message):
        with self._diagnostics.refusing('depth images'), self._lock:
            self._lift(self._pairing.add_depth(stamp_of(message), arrival_clock_ns(), message))

    def _on_boxes(self, message):
        with self._diagnostics.refusing('2D boxes'), self._lock:
            boxes = boxes2d_from_message(message)
            if boxes.stamp_ns is None:
                rospy.loginfo_once('the 2D boxes carry no stamp: each array is paired with the depth image that came '
                                   'nearest to %.3f s before it (~assumed_delay)', self._params.assumed_delay)
            self._diagnostics.count('arrays of 2D boxes')
            self._lift(self._pairing.add_boxes(boxes.stamp_ns, arrival_clock_ns(), boxes))

    def _lift(self, pairs):
        """Publish the 3D boxes of arrays of 2D boxes, each with the frame that belongs to it."""
        for frame, boxes in pairs:
            with self._diagnostics.refusing('2D boxes'):
                depth = self._depth_of(frame, boxes)
                found = self._boxes3d(depth, [tuple(rect) for rect in boxes.boxes.tolist()], frame.camera)
                header = Header(stamp=time_from(frame.stamp_ns if boxes.stamp_ns is None else boxes.stamp_ns),
                                frame_id=self._params.frame_id or frame.depth.header.frame_id)
                self._boxes_pub.publish(boxes3d_to_message(found, header, frame.camera))
                self._images.publish(header, depth, found)
                self._diagnostics.count('images lifted')

    def _boxes3d(self, depth, rects_px, camera):
        """The 3D boxes of rectangles, without those that are unusable or show no depth of their own."""
        usable = [rect_px for rect_px in rects_px if self._is_usable(rect_px)]
        boxes = [box for box in estimate_boxes(depth, usable, camera, self._estimator) if box is not None]
        self._diagnostics.count('boxes lifted', len(boxes))
        self._diagnostics.count('boxes without depth', len(usable) - len(boxes))
        if self._error_model is None or not boxes:
            return boxes
        boxes = corrected_boxes(boxes, self._error_model)
        outside_m = self._error_model.distance_outside([box.center_m for box in boxes])
        self._diagnostics.count('boxes outside of the measured range', int((outside_m > 0).sum()))
        return boxes

    def _is_usable(self, rect_px):
        try:
            check_rect(rect_px)
            return True
        except ValueError as error:
            self._diagnostics.warn('2D boxes refused', '2D %s; the others in this image are used' % error)
            return False

    def _depth_of(self, frame, boxes):
        """The depth image of a frame. Raises ValueError where there is none, or it cannot belong to the camera."""
        if frame is None:
            raise ValueError(self._why_no_frame(boxes))
        depth = depth_from(frame.depth, self._params.depth_scale)
        if depth.values.shape != (frame.camera.height, frame.camera.width):
            raise ValueError('the depth image has %d x %d pixels, the colour camera %d x %d; depth must be aligned to '
                             'colour (realsense2_camera: align_depth:=true)'
                             % (depth.values.shape[::-1] + frame.camera[:2]))
        return depth

    def _why_no_frame(self, boxes):
        """What did not come, and on which topic it was expected."""
        newest_ns, kept_s = self._pairing.newest_ns, self._params.cache_length
        if newest_ns is None:
            return 'no depth image has come on %s' % rospy.resolve_name(DEPTH_TOPIC)
        if not self._pairing.has_camera:
            return 'no camera_info has come on %s' % rospy.resolve_name(CAMERA_INFO_TOPIC)
        if boxes.stamp_ns is None:
            return 'no depth image has come on %s within %.1f s' % (rospy.resolve_name(DEPTH_TOPIC), kept_s)
        return ('no depth image with their stamp %.3f came on %s; the newest has %.3f, and %.1f s are kept '
                '(~cache_length)' % (boxes.stamp_ns / NS, rospy.resolve_name(DEPTH_TOPIC), newest_ns / NS, kept_s))


def error_model_of(params):
    """The error model that the parameters name; None where they name none. Raises ValueError where it is unusable."""
    if not params.error_model:
        return None
    try:
        model = read_error_model(params.error_model)
    except OSError as error:
        raise ValueError('the error model cannot be read: %s; an absolute path expected' % error)
    model.check_estimator(params.estimator)
    return model


def main():
    """Run the node."""
    run_node('bbox3d_node', Bbox3dNode)
