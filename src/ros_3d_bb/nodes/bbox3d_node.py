"""ROS node that estimates 3D bounding boxes from 2D bounding boxes and the depth image with the same stamp."""
import threading

import rospy
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Int32MultiArray

from ros_3d_bb.conversions.camera_msgs import DEPTH_TOPIC, INFO_TOPICS
from ros_3d_bb.conversions.perception_msgs import BOXES3D_TOPIC, BOXES_TOPIC, boxes3d_to_msg
from ros_3d_bb.core.time_sync import NS, arrival_clock_ns
from ros_3d_bb.msg import BoundingBox3DArray
from ros_3d_bb.nodes.common.alignment_check import DepthCameraCheck
from ros_3d_bb.nodes.common.debug_images import SampleImages
from ros_3d_bb.nodes.common.diagnostics import Diagnostics
from ros_3d_bb.nodes.common.reconfigure_server import ReconfigureServer
from ros_3d_bb.nodes.common.startup import read_params, run_node
from ros_3d_bb.nodes.common.subscribers import KEPT_AT_ONCE, subscribe
from ros_3d_bb.pipeline.estimation_stage import Bbox3dParams, EstimationStage


class Bbox3dNode(object):
    """Estimate 3D boxes from 2D boxes and depth images.

    Each array of 2D boxes is paired with the depth image of the same stamp, regardless of the detector's latency.
    Parameters: config/bbox3d.yaml; some can be changed at run time.

    Subscribes
    ----------
    yolo_bounding_box : std_msgs/Int32MultiArray
        2D boxes.
    camera/aligned_depth_to_color/image_raw : sensor_msgs/Image
        Depth image, aligned to the colour image.
    camera/color/camera_info : sensor_msgs/CameraInfo
        Calibration of the colour camera.

    Publishes
    ---------
    ros_3d_bb/bb_3d : ros_3d_bb/BoundingBox3DArray
        3D boxes in the optical frame of the camera, with the stamp of the image in which they were detected.
    """

    def __init__(self):
        params, = read_params(Bbox3dParams)
        self._diagnostics = Diagnostics()
        self._estimation_stage = EstimationStage(params, self._diagnostics, self._on_frame,
                                                 rospy.resolve_name(DEPTH_TOPIC),
                                                 rospy.resolve_name(INFO_TOPICS[0]))
        self._lock = threading.Lock()
        self._boxes_pub = rospy.Publisher(BOXES3D_TOPIC, BoundingBox3DArray, queue_size=10)
        self._images = SampleImages(int(params.cache_length * NS), self._estimation_stage.sample,
                                    params.depth_image_range,
                                    self._diagnostics)
        self._alignment = DepthCameraCheck(with_frames=not params.frame_id)
        self._diagnostics.check(self._alignment.faults)
        # Depth images are cached until their boxes arrive, so the subscriber queues must not drop any.
        subscribe(DEPTH_TOPIC, Image, self._on_depth, KEPT_AT_ONCE)
        subscribe(INFO_TOPICS[0], CameraInfo, self._on_camera_info, KEPT_AT_ONCE)
        subscribe(BOXES_TOPIC, Int32MultiArray, self._on_boxes)
        self._tuning = ReconfigureServer([params], self._tune)

    def _tune(self, params):
        with self._lock:
            self._estimation_stage.reconfigure(params)
            self._images.reconfigure(self._estimation_stage.sample, params.depth_image_range)

    def _on_camera_info(self, message):
        self._alignment.color = message
        with self._diagnostics.receiving('camera_info'), self._lock:
            self._estimation_stage.add_camera_info(message, arrival_clock_ns())

    def _on_depth(self, message):
        self._alignment.depth_frame = message.header.frame_id
        with self._diagnostics.receiving('depth images'), self._lock:
            self._estimation_stage.add_depth(message, arrival_clock_ns())

    def _on_boxes(self, message):
        with self._diagnostics.receiving('2D boxes'), self._lock:
            self._estimation_stage.add_boxes(message, arrival_clock_ns())

    def _on_frame(self, boxes2d, depth_msg, camera):
        """Publish the 3D boxes of one image, once its 2D boxes, depth image and camera model have arrived."""
        with self._diagnostics.rejecting('2D boxes'):
            header, depth, boxes3d = self._estimation_stage.estimate(boxes2d, depth_msg, camera)
            self._boxes_pub.publish(boxes3d_to_msg(boxes3d, header, camera))
            self._diagnostics.record_latency(header.stamp)
            self._images.publish(header, depth, boxes3d)


def main():
    """Run the node."""
    run_node('bbox3d_node', Bbox3dNode)
