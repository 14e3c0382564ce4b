"""ROS node that detects people in colour images with YOLOv5."""
import rospy
from sensor_msgs.msg import Image

from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC
from ros_3d_bb.core.latest_worker import NewestWorker
from ros_3d_bb.detection.yolov5.backends import RuntimeParams
from ros_3d_bb.detection.yolov5.detector import DetectionParams
from ros_3d_bb.nodes.common.detector_output import BoxesOutput, Switch
from ros_3d_bb.nodes.common.diagnostics import Diagnostics
from ros_3d_bb.nodes.common.reconfigure_server import ReconfigureServer
from ros_3d_bb.nodes.common.startup import read_params, run_node
from ros_3d_bb.nodes.common.subscribers import subscribe
from ros_3d_bb.pipeline.detection_stage import Yolov5NodeParams, opened_yolov5, search_color


class Yolov5Node(object):
    """Detect people in colour images.

    Only the newest image is processed; images that arrive during a detection are skipped, except for the newest.
    Parameters: config/yolov5.yaml; some can be changed at run time.

    Subscribes
    ----------
    camera/color/image_raw : sensor_msgs/Image
        Colour image.
    """

    def __init__(self):
        params, detection, running = given = read_params(Yolov5NodeParams, DetectionParams, RuntimeParams)
        self._detector = opened_yolov5(params.weights, detection, running, rospy.logwarn)
        self._diagnostics = Diagnostics()
        self._output = BoxesOutput(params.publish_empty)
        self._worker = NewestWorker(self._search, self._on_error)
        rospy.on_shutdown(self._worker.stop)
        self._switch = Switch(params.enabled, self._diagnostics)
        subscribe(COLOR_TOPIC, Image, self._on_image, 1)
        rospy.loginfo('looking for %s with %s on %s', ', '.join(map(str, detection.classes)), params.weights,
                      self._detector.description)
        self._tuning = ReconfigureServer(given, self._tune)

    def _tune(self, _params, detection, _running):
        self._detector = self._detector.with_params(detection)  # each image uses either old or new parameters

    def _on_image(self, message):
        with self._diagnostics.receiving('colour images'):
            if not self._switch.on:
                self._diagnostics.count('images while paused')
                return
            self._switch.offered()
            if self._worker.offer(message):
                self._diagnostics.count('images skipped for a newer one')

    def _search(self, message):
        with self._diagnostics.rejecting('images'), self._switch.searching():
            if self._switch.on:
                self._detect(message)
            else:  # the detector was paused after the image arrived
                self._diagnostics.count('images while paused')

    def _detect(self, message):
        detector = self._detector
        image, found = search_color(detector, message)
        self._diagnostics.count('images searched')
        self._output.publish(message.header, image, found, detector.names)
        self._diagnostics.record_latency(message.header.stamp)

    def _on_error(self, error):
        self._diagnostics.warn('searches failed', 'the detector failed: %s; waiting for the next image' % error)


def main():
    """Run the node."""
    run_node('yolov5_node', Yolov5Node)
