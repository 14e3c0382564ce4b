"""Detection stage: 2D bounding boxes in colour images, which are turned upright."""
from typing import Any, Callable, Tuple

import numpy as np
import tf2_ros
from sensor_msgs.msg import Image

from ros_3d_bb.camera.images import AUTO, turned_boxes, turned_image, turns_for
from ros_3d_bb.conversions.image_msgs import imgmsg_to_rgb
from ros_3d_bb.conversions.perception_msgs import stamp_of
from ros_3d_bb.detection.boxes import Detections
from ros_3d_bb.detection.detector import Detector
from ros_3d_bb.pipeline.transform_buffer import TransformBuffer, upright_transform


def detect_in_color(detector: Detector, message: Image, turns: int = 0) -> Tuple[np.ndarray, Detections]:
    """Return a colour image as RGB, (height, width, 3), and the Detections of a Detector in it.

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
