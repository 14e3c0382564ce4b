"""The node that finds people in colour images with YOLOv5."""
import rospy
from sensor_msgs.msg import Image

from ros_3d_bb.camera_messages import COLOR_TOPIC
from ros_3d_bb.detection.runtime import RuntimeParams
from ros_3d_bb.detection.yolov5 import DetectionParams
from ros_3d_bb.nodes.boxes_output import BoxesOutput, Switch
from ros_3d_bb.nodes.diagnostics import Diagnostics
from ros_3d_bb.nodes.startup import read_params, run_node
from ros_3d_bb.nodes.transport import subscribe
from ros_3d_bb.searching import Yolov5NodeParams, opened_yolov5, search_color
from ros_3d_bb.worker import NewestWorker


class Yolov5Node(object):
    """Find people in colour images.

    Subscribes: camera/color/image_raw. Publishes: yolo_bounding_box; yolo_result_out while somebody subscribes.
    Services: ~enable (std_srvs/SetBool) pauses and resumes. Parameters: config/yolov5.yaml.
    """

    def __init__(self):
        self._params, detection, running = read_params(Yolov5NodeParams, DetectionParams, RuntimeParams)
        self._detector = opened_yolov5(self._params.weights, detection, running, rospy.logwarn)
        self._diagnostics = Diagnostics()
        self._output = BoxesOutput(self._params.publish_empty)
        self._worker = NewestWorker(self._search, self._on_error)
        rospy.on_shutdown(self._worker.stop)
        self._switch = Switch(self._params.enabled, self._diagnostics)
        subscribe(COLOR_TOPIC, Image, self._on_image, 1)
        rospy.loginfo('looking for %s with %s on %s', ', '.join(map(str, detection.classes)), self._params.weights,
                      self._detector.description)

    def _on_image(self, message):
        if self._switch.on and self._worker.offer(message):
            self._diagnostics.count('images skipped for a newer one')

    def _search(self, message):
        with self._diagnostics.refusing('images'):
            if self._switch.on:  # it may have been paused since the image came
                self._detect(message)

    def _detect(self, message):
        image, found = search_color(self._detector, message)
        self._diagnostics.count('images searched')
        self._output.publish(message.header, image, found, self._detector.names)
        self._diagnostics.answered(message.header.stamp)
        self._switch.answered()

    def _on_error(self, error):
        self._diagnostics.warn('searches failed', 'the detector failed: %s; waiting for the next image' % error)


def main():
    """Run the node."""
    run_node('yolov5_node', Yolov5Node)
