"""The chain from the images of one camera to 3D boxes, for the nodes and for bags."""
from ros_3d_bb.conversions.camera_msgs import uncompressed
from ros_3d_bb.conversions.perception_msgs import Boxes2D, boxes2d_from_msg, boxes3d_to_msg, header_of


class CameraPipeline(object):
    """Detection and estimation in the matched messages of an RgbdSource. Each image is decoded once.

    Its ports are nodes, or the pipeline of a bag. Each is connected by a method, unless it is in another process.
    """

    def __init__(self):
        self.source = None  # the RgbdSource, which calls `on_match`
        self._detection = self._offer = self._estimation = self._events = self._on_boxes3d = None

    def connect_detector(self, stage, offer):
        """Pass colour images with the messages that match them to `offer`. It passes them on to `detect`, at once or in
        a thread of its own; `stage` is the DepthDetectionStage."""
        self._detection, self._offer = stage, offer

    def connect_estimator(self, stage, events, on_boxes3d):
        """Estimate 3D boxes with an EstimationStage. `on_boxes3d(message, boxes3d, frame, depth_msg)` is called with
        the message of the 3D boxes, and the RgbdFrame and depth image that show them."""
        self._estimation, self._events, self._on_boxes3d = stage, events, on_boxes3d

    def on_match(self, trigger, depth_msg, camera):
        """Process the messages of one stamp, see `RgbdSource`."""
        if not isinstance(trigger, Boxes2D):
            self._offer(trigger, depth_msg, camera)
            return
        with self._events.rejecting('2D boxes'):
            frame, depth_msg = self._frame(trigger, depth_msg, camera)
            self._estimate(trigger, frame, depth_msg)

    def detect(self, color_msg, depth_msg, camera):
        """Return the RGB image of matched messages and its Detections, followed by the arguments with which `estimate`
        continues; None while the floor is unknown. Raises ValueError as `RgbdSource.frame`."""
        frame, depth_msg = self._frame(color_msg, depth_msg, camera)
        detections = self._detection.detect(frame)
        return None if detections is None else (frame.received.color, detections, frame, depth_msg)

    def estimate(self, boxes2d_msg, frame, depth_msg):
        """Process the published 2D boxes of a detection."""
        if self._estimation is None:
            return
        with self._events.receiving('2D boxes'):
            self._events.count('arrays of 2D boxes')
            self._estimate(boxes2d_from_msg(boxes2d_msg), frame, depth_msg)

    def _frame(self, trigger, depth_msg, camera):
        depth_msg = uncompressed(depth_msg)  # once for all stages
        return self.source.frame(trigger, depth_msg, camera), depth_msg

    def _estimate(self, boxes2d, frame, depth_msg):
        boxes3d = self._estimation.estimate(frame, boxes2d)
        message = boxes3d_to_msg(boxes3d, header_of(frame), frame.received.camera)
        self._on_boxes3d(message, boxes3d, frame, depth_msg)
