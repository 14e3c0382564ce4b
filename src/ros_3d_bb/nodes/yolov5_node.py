"""ROS node that detects people in colour images with a network."""
import rospy
from sensor_msgs.msg import Image

from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, INFO_TOPICS
from ros_3d_bb.conversions.perception_msgs import camera_from_msg
from ros_3d_bb.core.detection_pace import SIZES, sizes_for_range
from ros_3d_bb.detection.network_detector import DetectionParams
from ros_3d_bb.detection.yolov5.backends import RuntimeParams, open_detector
from ros_3d_bb.nodes.common.detector_output import DetectorWorker
from ros_3d_bb.nodes.common.diagnostics import Diagnostics
from ros_3d_bb.nodes.common.reconfigure_server import ReconfigureServer
from ros_3d_bb.nodes.common.startup import Part, read_params
from ros_3d_bb.nodes.common.subscribers import subscribe, subscribe_camera_info
from ros_3d_bb.nodes.common.tf_lookup import Transforms
from ros_3d_bb.pipeline.detection_stage import CameraRotation, Yolov5NodeParams, detect_in_color


class Yolov5Node(object):
    """Detect people in colour images.

    The size of the network's input is the largest with which detections take less time than the period of the images,
    and with which people are detected up to ~detection_range. If the smallest such size is too slow, the node detects
    in every n-th image. ~image_size fixes the size. Parameters: config/yolov5.yaml; some can be changed at run time.

    Subscribes
    ----------
    camera/color/image_raw : sensor_msgs/Image
        Colour image.
    camera/color/camera_info : sensor_msgs/CameraInfo
        Focal length, from which the size for ~detection_range follows.
    /tf,/tf_static : tf2_msgs/TFMessage
        Transform from ~floor_frame to the camera, which tells the edge of the image that is up. Subscribed until it is
        available; not used if ~image_rotation is given or ~floor_frame is empty.
    """

    def __init__(self, part=Part()):
        params, detection, running = given = read_params(Yolov5NodeParams, DetectionParams, RuntimeParams,
                                                         namespace=part.namespace)
        self._detector = open_detector(params.weights, detection, running, rospy.logwarn)
        self._params, self._camera = detection, None
        self._diagnostics = Diagnostics(part)
        self._diagnostics.show('image size', lambda: '%d pixels' % self._worker.pace.size)
        if part.transforms is None:
            transforms = Transforms(wait_s=0)
            self._rotation = CameraRotation(params, transforms, transforms.close)
        else:
            self._rotation = CameraRotation(params, part.transforms)
        self._worker = DetectorWorker(params, self._diagnostics, self._detect, self._detector.names, part)
        self._set_params(detection)
        subscribe_camera_info(INFO_TOPICS[0], COLOR_TOPIC, self._on_camera_info, 1)
        subscribe(COLOR_TOPIC, Image, self._on_image, 1)
        rospy.loginfo('detecting %s with %s on %s', ', '.join(map(str, detection.classes)), params.weights,
                      self._detector.description)
        ReconfigureServer(given, lambda _params, detection, _running: self._set_params(detection), part.namespace)

    def _set_params(self, detection):
        """Use DetectionParams from the next image on. Raises ValueError, without any change, if one is invalid."""
        self._detector = self._detector.with_params(detection)
        self._params = detection
        self._worker.pace.use_sizes(self._sizes())

    def _sizes(self):
        """Sizes of the network's input to choose from."""
        if self._params.image_size or self._detector.has_fixed_size:
            return (self._detector.input_px,)
        if self._camera is None:
            return SIZES
        return sizes_for_range(self._params.detection_range, self._camera.fx,
                               max(self._camera.width, self._camera.height))

    def _on_camera_info(self, message):
        with self._diagnostics.receiving('camera_info'):
            self._camera = camera_from_msg(message)
            self._worker.pace.use_sizes(self._sizes())

    def _on_image(self, message):
        with self._diagnostics.receiving('colour images'):
            self._worker.offer(message)

    def _detect(self, message):
        detector = self._detector.with_params(self._params._replace(image_size=self._worker.pace.size))
        image, detections = detect_in_color(detector, message, self._rotation.turns(message.header.frame_id))
        self._diagnostics.count('images processed')
        return image, detections, image
