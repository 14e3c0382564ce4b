"""ROS node that detects people in colour images with a network."""
import time

import rospy
from sensor_msgs.msg import Image

from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC
from ros_3d_bb.conversions.perception_msgs import stamp_of
from ros_3d_bb.detection.adaptive_size import AdaptiveSize
from ros_3d_bb.detection.network_detector import DetectionParams
from ros_3d_bb.detection.yolov5.backends import RuntimeParams, open_detector
from ros_3d_bb.nodes.common.detector_output import DetectorWorker
from ros_3d_bb.nodes.common.diagnostics import Diagnostics
from ros_3d_bb.nodes.common.reconfigure_server import ReconfigureServer
from ros_3d_bb.nodes.common.startup import Part, read_params
from ros_3d_bb.nodes.common.subscribers import subscribe
from ros_3d_bb.nodes.common.tf_lookup import Transforms
from ros_3d_bb.pipeline.detection_stage import CameraRotation, Yolov5NodeParams, detect_in_color


class Yolov5Node(object):
    """Detect people in colour images.

    Only the newest image is processed; images that arrive during a detection are skipped, except for the newest. With
    ~image_size 0, the input size is reduced until no image is skipped, and increased when there is time.
    Parameters: config/yolov5.yaml; some can be changed at run time.

    Subscribes
    ----------
    camera/color/image_raw : sensor_msgs/Image
        Colour image.
    /tf,/tf_static : tf2_msgs/TFMessage
        Transform from ~floor_frame to the camera, which tells the edge of the image that is up. Subscribed until it is
        available; not used if ~image_rotation is given or ~floor_frame is empty.
    """

    def __init__(self, part=Part()):
        params, detection, running = given = read_params(Yolov5NodeParams, DetectionParams, RuntimeParams,
                                                         namespace=part.namespace)
        self._detector = open_detector(params.weights, detection, running, rospy.logwarn)
        self._params, self._sizes = detection, AdaptiveSize()
        self._diagnostics = Diagnostics(part)
        self._diagnostics.show('image size', lambda: '%d pixels' % self._detector.input_px)
        if part.transforms is None:
            transforms = Transforms(wait_s=0)
            self._rotation = CameraRotation(params, transforms, transforms.close)
        else:
            self._rotation = CameraRotation(params, part.transforms)
        self._worker = DetectorWorker(params, self._diagnostics, self._detect, self._detector.names, part)
        subscribe(COLOR_TOPIC, Image, self._on_image, 1)
        rospy.loginfo('detecting %s with %s on %s', ', '.join(map(str, detection.classes)), params.weights,
                      self._detector.description)
        ReconfigureServer(given, lambda _params, detection, _running: self._set_params(detection), part.namespace)

    def _set_params(self, detection):
        """Use DetectionParams from the next image on, with the adaptive size if it is wanted.

        Raises ValueError, without any change, if one is invalid.
        """
        size = detection.image_size or self._sizes.size
        self._detector = self._detector.with_params(detection._replace(image_size=size))
        self._params = detection

    def _on_image(self, message):
        with self._diagnostics.receiving('colour images'):
            self._sizes.add_image(stamp_of(message))
            self._worker.offer(message)

    def _detect(self, message):
        start_s = time.monotonic()
        result = detect_in_color(self._detector, message, self._rotation.turns(message.header.frame_id))
        is_adaptive = not self._params.image_size and not self._detector.has_fixed_size
        if is_adaptive and self._sizes.add_detection(time.monotonic() - start_s):
            self._set_params(self._params)
            self._diagnostics.note('changes of the image size', 'detecting in images of %d pixels from now on, to keep '
                                   'up with the camera (~image_size 0)' % self._sizes.size)
        self._diagnostics.count('images processed')
        return result
