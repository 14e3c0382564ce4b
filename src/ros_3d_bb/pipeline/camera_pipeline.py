"""The chain from the images of one camera to 3D boxes, for the nodes and for bags."""
from typing import Any, Callable, List, Optional, Tuple

from sensor_msgs.msg import Image
from std_msgs.msg import Int32MultiArray

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.camera.images import RgbdFrame
from ros_3d_bb.conversions.camera_msgs import uncompressed
from ros_3d_bb.conversions.perception_msgs import boxes2d_from_msg, boxes3d_to_msg, header_of
from ros_3d_bb.core.boxes2d import Boxes2D
from ros_3d_bb.core.event_counter import EventCounter
from ros_3d_bb.detection.boxes import Detections
from ros_3d_bb.estimation.box3d import Box3D
from ros_3d_bb.pipeline.rgbd_source import OnMatch, RgbdSource, Trigger


class CameraPipeline(object):
    """Detection and estimation in the matched messages of an RgbdSource. Each image is decoded once.

    `source_for` returns the RgbdSource, the attribute `source`, given its `on_match`. The other ports are nodes, or the
    pipeline of a bag. Each is connected by a method, unless it is in another process.
    """

    def __init__(self, source_for: Callable[[OnMatch], RgbdSource]) -> None:
        self.source, self._has_estimator = source_for(self._on_match), False

    def connect_detector(self, detect: Callable[[RgbdFrame], Optional[Detections]],
                         offer: Callable[[Image, Image, Camera], Any]) -> None:
        """Pass colour images with the messages that match them to `offer`. It passes them on to `self.detect`, at once
        or in a thread of its own; `detect` is that of a `Detector` that uses depth."""
        self._detect, self._offer = detect, offer

    def connect_estimator(self, estimate: Callable[[RgbdFrame, Boxes2D], List[Box3D]], events: EventCounter,
                          on_boxes3d: Callable[[Any, List[Box3D], RgbdFrame, Image], Any]) -> None:
        """Estimate 3D boxes with `estimate`, that of an EstimationStage. `on_boxes3d(message, boxes3d, frame,
        depth_msg)` is called with the message of the 3D boxes, and the frame and depth image that show them."""
        self._estimate, self._events, self._on_boxes3d, self._has_estimator = estimate, events, on_boxes3d, True

    def _on_match(self, trigger: Trigger, depth_msg: Image, camera: Camera) -> None:
        if not isinstance(trigger, Boxes2D):
            self._offer(trigger, depth_msg, camera)
            return
        with self._events.rejecting('2D boxes'):
            frame, depth_msg = self._frame(trigger, depth_msg, camera)
            self._estimate_in(trigger, frame, depth_msg)

    def detect(self, color_msg: Image, depth_msg: Image,
               camera: Camera) -> Optional[Tuple[Any, Detections, RgbdFrame, Image]]:
        """Return the RGB image of matched messages and its Detections, followed by the arguments with which `estimate`
        continues; None if there is no result. Raises ValueError as `RgbdSource.frame`."""
        frame, depth_msg = self._frame(color_msg, depth_msg, camera)
        detections = self._detect(frame)
        if detections is None:
            return None
        received = detections._replace(boxes=frame.received_rects(detections.boxes))
        return frame.received.color, received, frame, depth_msg

    def estimate(self, boxes2d_msg: Int32MultiArray, frame: RgbdFrame, depth_msg: Image) -> None:
        if not self._has_estimator:
            return
        with self._events.receiving('2D boxes'):
            self._events.count('arrays of 2D boxes')
            self._estimate_in(boxes2d_from_msg(boxes2d_msg), frame, depth_msg)

    def _frame(self, trigger: Trigger, depth_msg: Image, camera: Camera) -> Tuple[RgbdFrame, Image]:
        depth_msg = uncompressed(depth_msg)  # once for all stages
        return self.source.frame(trigger, depth_msg, camera), depth_msg

    def _estimate_in(self, boxes2d: Boxes2D, frame: RgbdFrame, depth_msg: Image) -> None:
        boxes3d = self._estimate(frame, boxes2d)
        message = boxes3d_to_msg(boxes3d, header_of(frame), frame.received.camera)
        self._on_boxes3d(message, boxes3d, frame, depth_msg)
