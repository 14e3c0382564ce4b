"""ROS node that detects people in depth and colour images without a trained network."""
import threading

import rospy
from sensor_msgs.msg import Image

from ros_3d_bb.conversions.camera_msgs import (COLOR_INFO_IMAGES, COLOR_TOPIC, DEPTH_TOPICS, INFO_TOPICS, RAW,
                                               info_topic_beside)
from ros_3d_bb.core.time_sync import arrival_clock_ns
from ros_3d_bb.detection.depth.person_clusters import DepthPeopleParams
from ros_3d_bb.nodes.common.detector_output import DetectorWorker
from ros_3d_bb.nodes.common.diagnostics import Diagnostics
from ros_3d_bb.nodes.common.part import Part
from ros_3d_bb.nodes.common.reconfigure_server import ReconfigureServer
from ros_3d_bb.nodes.common.startup import read_params, run_node
from ros_3d_bb.nodes.common.subscribers import KEPT_AT_ONCE, subscribe, subscribe_camera_info
from ros_3d_bb.nodes.common.tf_lookup import Transforms
from ros_3d_bb.pipeline.detection_stage import DepthDetectionStage, DepthDetectorParams
from ros_3d_bb.pipeline.rgbd_source import RgbdSource


class DepthDetectorNode(object):
    """Detect people in depth and colour images.

    No network weights are required. Parameters: config/depth_detector.yaml; most can be changed at run time. With
    ~depth raw, the depth images are on camera/depth/image_rect_raw and their camera_info on camera/depth/camera_info;
    the node registers them to the colour image, using the transform between both cameras in tf.

    Subscribes
    ----------
    camera/color/image_raw : sensor_msgs/Image
        Colour image.
    camera/aligned_depth_to_color/image_raw : sensor_msgs/Image
        Depth image, aligned to the colour image.
    camera/color/camera_info : sensor_msgs/CameraInfo
        Calibration of the colour camera.
    /tf : tf2_msgs/TFMessage
        Transform from ~floor_frame to the camera, which locates the floor, and between the cameras for raw depth. Not
        used if ~floor_frame is empty and depth is aligned.
    /tf_static : tf2_msgs/TFMessage
        As /tf.
    """

    def __init__(self, part=Part()):
        params, people = read_params(DepthDetectorParams, DepthPeopleParams, namespace=part.namespace)
        self._diagnostics = Diagnostics(part)
        depth_topic, is_raw = DEPTH_TOPICS[params.depth][0], params.depth == RAW
        depth_info_topic = info_topic_beside(rospy.resolve_name(depth_topic))
        transforms = (part.transforms or Transforms(wait_s=0)) if params.floor_frame or is_raw else None
        if transforms is not None and part.transforms is None:
            self._diagnostics.show('tf age', transforms.age)
        self._lock, self._detecting = threading.Lock(), threading.Lock()
        self._stage = DepthDetectionStage(params, people, self._diagnostics)
        self._worker = DetectorWorker(params, self._diagnostics, self._detect, self._stage.names, part)
        self._source = RgbdSource(params, self._diagnostics, self._worker.offer, transforms,
                                  (rospy.resolve_name(depth_topic), depth_info_topic,
                                   rospy.resolve_name(INFO_TOPICS[0])))
        subscribe_camera_info(INFO_TOPICS[0], COLOR_INFO_IMAGES[params.depth], self._on_camera_info)
        if is_raw:
            subscribe_camera_info(depth_info_topic, depth_topic, self._on_depth_camera_info, 1)
        subscribe(depth_topic, Image, self._on_depth, KEPT_AT_ONCE)
        subscribe(COLOR_TOPIC, Image, self._on_color)
        ReconfigureServer([params, people], self._reconfigure, part.namespace)

    def _reconfigure(self, params, people):
        with self._detecting:
            self._stage.reconfigure(params, people)

    def _on_camera_info(self, message):
        with self._diagnostics.receiving('camera_info'), self._lock:
            self._source.add_camera_info(message, arrival_clock_ns())

    def _on_depth_camera_info(self, message):
        with self._diagnostics.receiving('camera_info of depth'), self._lock:
            self._source.add_depth_camera_info(message)

    def _on_depth(self, message):
        with self._diagnostics.receiving('depth images'), self._lock:
            self._source.add_depth(message, arrival_clock_ns())

    def _on_color(self, message):
        with self._diagnostics.receiving('colour images'), self._lock:
            self._source.add_color(message, arrival_clock_ns())

    def _detect(self, *messages):
        with self._detecting:
            frame = self._source.frame(*messages)
            detections = self._stage.detect(frame)
        return None if detections is None else (frame.received_color, detections)


def main():
    """Run the node."""
    run_node('depth_detector_node', DepthDetectorNode)
