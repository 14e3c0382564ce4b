"""Detection stage: 2D bounding boxes in frames or colour images."""
import math
from typing import Any, Callable, NamedTuple, Optional, Tuple

import numpy as np
import tf2_ros
from sensor_msgs.msg import Image

from ros_3d_bb.camera.camera_model import transform_from
from ros_3d_bb.camera.images import AUTO, RgbdFrame, turned_boxes, turned_image, turns_for
from ros_3d_bb.conversions.image_msgs import imgmsg_to_rgb
from ros_3d_bb.conversions.perception_msgs import stamp_of
from ros_3d_bb.core.event_counter import EventCounter
from ros_3d_bb.core.params import (DEPTH, DEPTH_SCALE, ENABLED, IMAGE_ROTATION, PUBLISH_EMPTY, STAMP_TOLERANCE, Param,
                                   parameters)
from ros_3d_bb.detection.boxes import Detections
from ros_3d_bb.detection.depth.detector import DepthPeople
from ros_3d_bb.detection.depth.ground_plane import CameraPose, camera_pose_above, floor_from_transform
from ros_3d_bb.detection.depth.person_clusters import DepthPeopleParams
from ros_3d_bb.pipeline.transform_buffer import TransformBuffer, upright_transform


@parameters()
class Yolov5NodeParams(NamedTuple):
    """Parameters of yolov5_node, except those of the network and its runtime."""

    weights: str = Param('')
    floor_frame: str = Param('base_link')
    frame_id: str = Param('')
    image_rotation: str = IMAGE_ROTATION
    enabled: bool = ENABLED
    publish_empty: bool = PUBLISH_EMPTY


@parameters()
class DepthDetectorParams(NamedTuple):
    """Parameters of depth_detector_node, except those of the detector."""

    floor_frame: str = Param('base_link')
    floor_height: float = Param(
        -0.065, 'Height of the floor in floor_frame. The default fits base_link of a Jackal.', 'm',
        limits=(-10000, 10000), live=(-1, 1))
    depth_scale: float = DEPTH_SCALE
    frame_id: str = Param('')
    depth: str = DEPTH
    image_rotation: str = IMAGE_ROTATION
    stamp_tolerance: float = STAMP_TOLERANCE
    enabled: bool = ENABLED
    publish_empty: bool = PUBLISH_EMPTY


def detect_in_color(detector: Any, message: Image, turns: int = 0) -> Tuple[np.ndarray, Detections]:
    """Return a colour image as RGB, (height, width, 3), and the Detections of a `NetworkDetector` in it.

    The detector receives the image upright, after `turns` clockwise quarter turns. Raises ValueError if the image or
    its stamp cannot be used.
    """
    stamp_of(message)
    image = imgmsg_to_rgb(message)
    upright = turned_image(image, turns)
    detections = detector.detect(upright)
    return image, detections._replace(boxes=turned_boxes(detections.boxes, -turns, *upright.shape[1::-1]))


class CameraRotation(object):
    """Quarter turns that make the images of one camera upright, from ~image_rotation or tf.

    The transform is looked up until that from ~floor_frame is available, and not again: the camera is fixed to the
    robot. It is not used if ~image_rotation is given, or no ~floor_frame. `on_known` is called once no further lookups
    are necessary.
    """

    def __init__(self, params: Any, transforms: TransformBuffer, on_known: Callable[[], Any] = lambda: None) -> None:
        self._params, self._transforms, self._on_known = params, transforms, on_known
        self._turns = None
        if params.image_rotation != AUTO or not params.floor_frame:
            self._turns = turns_for(params.image_rotation, None)
            on_known()

    def turns(self, frame_id: str) -> int:
        """Clockwise quarter turns of the images, whose header has this frame; 0 while they are unknown."""
        if self._turns is None:
            try:
                floor_frame, camera_from_floor = upright_transform(self._transforms, self._params.floor_frame,
                                                                   self._params.frame_id or frame_id)
            except tf2_ros.TransformException:  # reported by the estimation stage, which needs the same transform
                return 0
            turns = turns_for(AUTO, camera_from_floor[:3, 2])
            if floor_frame != self._params.floor_frame:  # it may still arrive
                return turns
            self._turns = turns
            self._on_known()
        return self._turns


class DepthDetectionStage(object):
    """Detect people in frames with `detection.depth`; `params` are DepthDetectorParams, `people` DepthPeopleParams."""

    names = ('person',)

    def __init__(self, params: DepthDetectorParams, people: DepthPeopleParams, events: EventCounter) -> None:
        self._params, self._events, self._detector = params, events, DepthPeople(people)

    def reconfigure(self, params: DepthDetectorParams, people: DepthPeopleParams) -> None:
        """Change the parameters. If they are invalid, raise ValueError and keep the old ones."""
        self._detector.reconfigure(people)
        self._params = params

    def detect(self, frame: RgbdFrame) -> Optional[Detections]:
        """Return the Detections in the received image of an RgbdFrame; None while the floor is unknown."""
        floor = None  # the detector fits it
        if frame.camera_from_floor is not None and frame.is_floor_known:
            base_from_floor = transform_from((0, 0, self._params.floor_height), (0, 0, 0, 1))
            floor = floor_from_transform(frame.camera_from_floor.dot(base_from_floor))
        detections = self._detector.detect(frame.color, frame.depth, frame.camera, floor)
        if detections is None:
            self._events.warn('images without floor', 'tf gives no floor, and none is visible in the depth image; no '
                              'detection; waiting for the next image')
            return None
        if floor is not None and self._detector.floor is not floor:
            self._events.warn('floors contradicted', 'tf gives %s, and the depth image shows %s; the latter is used; '
                              'check the camera mount and ~floor_height'
                              % tuple(_described(camera_pose_above([used])) for used in (floor, self._detector.floor)))
        self._events.count('images processed')
        return detections._replace(boxes=frame.received_rects(detections.boxes))


def _described(pose: CameraPose) -> str:
    return 'a camera %.2f m above the floor, tilted by %.1f and rolled by %.1f degrees' % (
        pose.height_m, math.degrees(pose.tilt_rad), math.degrees(pose.roll_rad))
