"""ROS node that detects people in depth and colour images without a trained network."""
import threading

import rospy
from sensor_msgs.msg import CameraInfo, Image

from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, DEPTH_TOPIC, INFO_TOPICS
from ros_3d_bb.core.latest_worker import NewestWorker
from ros_3d_bb.core.time_sync import arrival_clock_ns
from ros_3d_bb.detection.depth.person_clusters import DepthPeopleParams
from ros_3d_bb.nodes.common.detector_output import BoxesOutput, Switch
from ros_3d_bb.nodes.common.diagnostics import Diagnostics
from ros_3d_bb.nodes.common.reconfigure_server import ReconfigureServer
from ros_3d_bb.nodes.common.startup import read_params, run_node
from ros_3d_bb.nodes.common.subscribers import KEPT_AT_ONCE, subscribe
from ros_3d_bb.nodes.common.tf_lookup import Transforms
from ros_3d_bb.pipeline.detection_stage import DepthDetectorParams, RgbdDetectionStage


class DepthDetectorNode(object):
    """Detect people in depth and colour images.

    No network weights are required. Parameters: config/depth_detector.yaml; most can be changed at run time.

    Subscribes
    ----------
    camera/color/image_raw : sensor_msgs/Image
        Colour image.
    camera/aligned_depth_to_color/image_raw : sensor_msgs/Image
        Depth image, aligned to the colour image.
    camera/color/camera_info : sensor_msgs/CameraInfo
        Calibration of the colour camera.
    /tf : tf2_msgs/TFMessage
        Transform from ~floor_frame to the camera, which locates the floor. Not used if ~floor_frame is empty.
    /tf_static : tf2_msgs/TFMessage
        As /tf.
    """

    def __init__(self):
        params, people = read_params(DepthDetectorParams, DepthPeopleParams)
        self._diagnostics = Diagnostics()
        transforms = Transforms(wait_s=0) if params.floor_frame else None
        if transforms is not None:
            self._diagnostics.show('tf age', transforms.age)
        self._search = RgbdDetectionStage(params, people, self._diagnostics, self._on_frame, transforms)
        self._lock, self._searching = threading.Lock(), threading.Lock()
        self._output = BoxesOutput(params.publish_empty)
        self._worker = NewestWorker(self._work, self._on_error)
        rospy.on_shutdown(self._worker.stop)
        self._switch = Switch(params.enabled, self._diagnostics)
        subscribe(INFO_TOPICS[0], CameraInfo, self._on_camera_info, KEPT_AT_ONCE)
        subscribe(DEPTH_TOPIC, Image, self._on_depth, KEPT_AT_ONCE)
        subscribe(COLOR_TOPIC, Image, self._on_color)
        self._tuning = ReconfigureServer([params, people], self._tune)

    def _tune(self, params, people):
        with self._searching:
            self._search.reconfigure(params, people)

    def _on_camera_info(self, message):
        with self._diagnostics.receiving('camera_info'), self._lock:
            self._search.add_camera_info(message, arrival_clock_ns())

    def _on_depth(self, message):
        with self._diagnostics.receiving('depth images'), self._lock:
            self._search.add_depth(message, arrival_clock_ns())

    def _on_color(self, message):
        with self._diagnostics.receiving('colour images'), self._lock:
            self._search.add_color(message, arrival_clock_ns())

    def _on_frame(self, color_msg, depth_msg, camera):
        """Pass the images and the camera model of one stamp to the worker thread."""
        if not self._switch.on:
            self._diagnostics.count('images while paused')
            return
        self._switch.offered()
        if self._worker.offer((color_msg, depth_msg, camera)):
            self._diagnostics.count('images skipped for a newer one')

    def _work(self, frame):
        with self._diagnostics.rejecting('images'), self._switch.searching(), self._searching:
            if not self._switch.on:  # the detector may have been paused in the meantime
                self._diagnostics.count('images while paused')
                return
            color_msg, depth_msg, camera = frame
            found = self._search.search(color_msg, depth_msg, camera)
            if found is not None:
                image, detections = found
                self._output.publish(color_msg.header, image, detections, names=self._search.names)
                self._diagnostics.record_latency(color_msg.header.stamp)

    def _on_error(self, error):
        self._diagnostics.warn('searches failed', 'the detector failed: %s; waiting for the next image' % error)


def main():
    """Run the node."""
    run_node('depth_detector_node', DepthDetectorNode)
