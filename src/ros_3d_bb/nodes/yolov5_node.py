"""ROS node that detects people in colour images with a network."""
import rospy
from sensor_msgs.msg import Image

from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC
from ros_3d_bb.detection.network_detector import DetectionParams
from ros_3d_bb.detection.yolov5.backends import RuntimeParams
from ros_3d_bb.nodes.common.detector_output import DetectorWorker
from ros_3d_bb.nodes.common.diagnostics import Diagnostics
from ros_3d_bb.nodes.common.reconfigure_server import ReconfigureServer
from ros_3d_bb.nodes.common.startup import read_params, run_node
from ros_3d_bb.nodes.common.subscribers import subscribe
from ros_3d_bb.nodes.common.tf_lookup import Transforms
from ros_3d_bb.pipeline.detection_stage import CameraRotation, Yolov5NodeParams, detect_in_color, opened_yolov5


class Yolov5Node(object):
    """Detect people in colour images.

    Only the newest image is processed; images that arrive during a detection are skipped, except for the newest.
    Parameters: config/yolov5.yaml; some can be changed at run time.

    Subscribes
    ----------
    camera/color/image_raw : sensor_msgs/Image
        Colour image.
    /tf : tf2_msgs/TFMessage
        Transform from ~floor_frame to the camera, which tells the edge of the image that is up. Subscribed until it is
        available; not used if ~image_rotation is given or ~floor_frame is empty.
    /tf_static : tf2_msgs/TFMessage
        As /tf.
    """

    def __init__(self):
        params, detection, running = given = read_params(Yolov5NodeParams, DetectionParams, RuntimeParams)
        self._detector = opened_yolov5(params.weights, detection, running, rospy.logwarn)
        self._diagnostics = Diagnostics()
        transforms = Transforms(wait_s=0)
        self._rotation = CameraRotation(params, transforms, transforms.close)
        self._worker = DetectorWorker(params, self._diagnostics, self._detect, self._detector.names)
        subscribe(COLOR_TOPIC, Image, self._on_image, 1)
        rospy.loginfo('detecting %s with %s on %s', ', '.join(map(str, detection.classes)), params.weights,
                      self._detector.description)
        ReconfigureServer(given, self._reconfigure)

    def _reconfigure(self, _params, detection, _running):
        self._detector = self._detector.with_params(detection)  # each image uses either old or new parameters

    def _on_image(self, message):
        with self._diagnostics.receiving('colour images'):
            self._worker.offer(message)

    def _detect(self, message):
        result = detect_in_color(self._detector, message, self._rotation.turns(message.header.frame_id))
        self._diagnostics.count('images processed')
        return result


def main():
    """Run the node."""
    run_node('yolov5_node', Yolov5Node)
