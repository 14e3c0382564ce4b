"""ROS node that detects people in depth and colour images without a trained network."""
import threading

from sensor_msgs.msg import Image

from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC
from ros_3d_bb.detection.depth.person_clusters import DepthPeopleParams
from ros_3d_bb.nodes.common.detector_output import DetectorWorker
from ros_3d_bb.nodes.common.diagnostics import Diagnostics
from ros_3d_bb.nodes.common.reconfigure_server import ReconfigureServer
from ros_3d_bb.nodes.common.rgbd_inputs import RgbdInputs
from ros_3d_bb.nodes.common.startup import Part, read_params
from ros_3d_bb.nodes.common.subscribers import subscribe
from ros_3d_bb.pipeline.detection_stage import DepthDetectionStage, DepthDetectorParams


class DepthDetectorNode(object):
    """Detect people in depth and colour images.

    No network weights are required. Parameters: config/depth_detector.yaml; most can be changed at run time.

    Subscribes
    ----------
    camera/color/image_raw : sensor_msgs/Image
        Colour image.
    """

    def __init__(self, part=Part()):
        params, people = read_params(DepthDetectorParams, DepthPeopleParams, namespace=part.namespace)
        self._diagnostics = Diagnostics(part)
        self._detecting = threading.Lock()
        self._stage = DepthDetectionStage(params, people, self._diagnostics)
        self.params, self.inputs = params, RgbdInputs(params, self._diagnostics, part.transforms)
        self._pipeline = self.inputs.pipeline
        worker = DetectorWorker(params, self._diagnostics, self._detect, self._stage.names,
                                part._replace(next_stage=self._pipeline.estimate))
        self._pipeline.connect_detector(self._stage.detect, worker.offer)
        subscribe(COLOR_TOPIC, Image, self.inputs.receiver('colour images', self._pipeline.source.add_color))
        ReconfigureServer([params, people], self._reconfigure, part.namespace)

    def _reconfigure(self, params, people):
        with self._detecting:
            self._stage.reconfigure(params, people)

    def _detect(self, *messages):
        with self._detecting:
            return self._pipeline.detect(*messages)
