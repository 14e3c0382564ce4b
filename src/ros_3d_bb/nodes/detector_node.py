"""ROS node that detects people in the images of a camera."""
import threading

import rospy
from sensor_msgs.msg import Image

from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, INFO_TOPICS
from ros_3d_bb.conversions.perception_msgs import camera_from_msg
from ros_3d_bb.detection.detector import DetectorParams
from ros_3d_bb.nodes.common.detector_output import DetectorWorker
from ros_3d_bb.nodes.common.diagnostics import Diagnostics
from ros_3d_bb.nodes.common.reconfigure_server import ReconfigureServer
from ros_3d_bb.nodes.common.rgbd_inputs import RgbdInputs
from ros_3d_bb.nodes.common.startup import Part, read_params, stored_params
from ros_3d_bb.nodes.common.subscribers import subscribe, subscribe_camera_info
from ros_3d_bb.nodes.common.tf_lookup import Transforms
from ros_3d_bb.pipeline.detection_stage import CameraRotation, detect_in_color
from ros_3d_bb.pipeline.detectors import open_named, row_named


class DetectorNode(object):
    """Detect people in colour images, or in depth and colour images, with one of the detectors.

    With ~detector yolov5, the size of the network's input is the largest with which detections take less time than the
    period of the images, and with which people are detected up to ~detection_range, which depends on the focal length.
    If the smallest such size is too slow, the node detects in every n-th image. ~image_size fixes the size.
    ~detector depth needs no weights. Depth images are subscribed only by detectors that use them. Parameters: config/,
    in the file with the name of the detector; some can be changed at run time.

    Subscribes
    ----------
    camera/color/image_raw : sensor_msgs/Image
        Colour image.
    """

    def __init__(self, part=Part()):
        row = row_named(stored_params(part.namespace).get('detector', DetectorParams().detector))
        self.params, *_own = given = read_params(DetectorParams, *row.own, namespace=part.namespace)
        self._diagnostics, self._detecting = Diagnostics(part), threading.Lock()
        self._detector, self._camera, self.inputs = open_named(self._diagnostics, *given), None, None
        if row.uses_depth:
            self.inputs = RgbdInputs(self.params, self._diagnostics, part.transforms)
            part = part._replace(next_stage=self.inputs.pipeline.estimate)
        self._worker = DetectorWorker(self.params, self._diagnostics, self._detect, self._detector.names, part)
        self._choose_sizes()
        if self._worker.pace.size:
            self._diagnostics.show('image size', lambda: '%d pixels' % self._worker.pace.size)
        if self.inputs is None:
            self._subscribe_color(part.transforms)
        else:
            self.inputs.pipeline.connect_detector(self._detector.detect, self._worker.offer)
            subscribe(COLOR_TOPIC, Image, self.inputs.receiver('colour images', self.inputs.pipeline.source.add_color))
        if self._detector.description:
            rospy.loginfo('detecting with %s', self._detector.description)
        ReconfigureServer(given, self._reconfigure, part.namespace)

    def _subscribe_color(self, shared):
        if shared is None:
            transforms = Transforms(wait_s=0)
            self._rotation = CameraRotation(self.params, transforms, transforms.close)
        else:
            self._rotation = CameraRotation(self.params, shared)
        subscribe_camera_info(INFO_TOPICS[0], COLOR_TOPIC, self._on_camera_info, 1)
        subscribe(COLOR_TOPIC, Image, self._on_image, 1)

    def _reconfigure(self, *params):
        with self._detecting:
            self._detector.reconfigure(*params)
            self._choose_sizes()

    def _choose_sizes(self):
        self._worker.pace.use_sizes(self._detector.sizes(self._camera))

    def _on_camera_info(self, message):
        with self._diagnostics.receiving('camera_info'):
            self._camera = camera_from_msg(message)
            self._choose_sizes()

    def _on_image(self, message):
        with self._diagnostics.receiving('colour images'):
            self._worker.offer(message)

    def _detect(self, *messages):
        with self._detecting:
            self._detector.size = self._worker.pace.size
            detected = (self._detect_in_color if self.inputs is None else self.inputs.pipeline.detect)(*messages)
        if detected is not None:
            self._diagnostics.count('images processed')
        return detected

    def _detect_in_color(self, message):
        image, detections = detect_in_color(self._detector, message, self._rotation.turns(message.header.frame_id))
        return image, detections, image
