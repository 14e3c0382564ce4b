"""ROS node that tracks 3D boxes in a fixed frame."""
import functools
import threading

import rospy
from sensor_msgs.msg import CameraInfo, Image
from visualization_msgs.msg import MarkerArray

from ros_3d_bb.conversions.camera_msgs import DEPTH_TOPIC, INFO_TOPICS, topic_of
from ros_3d_bb.conversions.perception_msgs import BOXES3D_TOPIC, TRACKS_TOPIC, tracks_to_msg
from ros_3d_bb.core.time_sync import arrival_clock_ns
from ros_3d_bb.msg import BoundingBox3DArray, TrackedObjectArray
from ros_3d_bb.nodes.common.diagnostics import Diagnostics
from ros_3d_bb.nodes.common.persistent_track_ids import PersistentTrackIds
from ros_3d_bb.nodes.common.reconfigure_server import ReconfigureServer
from ros_3d_bb.nodes.common.startup import read_params, run_node
from ros_3d_bb.nodes.common.subscribers import KEPT_AT_ONCE, subscribe
from ros_3d_bb.nodes.common.tf_lookup import Transforms
from ros_3d_bb.pipeline.tracking_stage import TRACKING_PARAMS, TrackerNodeParams, TrackingStage
from ros_3d_bb.visualization.markers import MARKERS_TOPIC, MarkerParams, MarkerWriter


class TrackerNode(object):
    """Track 3D boxes in a fixed frame.

    If there is no transform at the stamp of the boxes, nothing is published and tracks do not age. Parameters:
    config/tracker.yaml; many can be changed at run time. With ~cameras, the node subscribes to the boxes, camera_info
    and depth images of each camera: for the camera front these are front/ros_3d_bb/bb_3d, front/color/camera_info and
    front/aligned_depth_to_color/image_raw.

    Subscribes
    ----------
    ros_3d_bb/bb_3d : ros_3d_bb/BoundingBox3DArray
        3D boxes.
    camera/color/camera_info : sensor_msgs/CameraInfo
        Calibration, used to determine which tracks are out of view; not with ~tracker thesis.
    camera/aligned_depth_to_color/image_raw : sensor_msgs/Image
        Depth image, used to determine which tracks are occluded; not with ~tracker thesis or without ~use_depth.
    /tf : tf2_msgs/TFMessage
        Pose of the camera in ~target_frame.
    /tf_static : tf2_msgs/TFMessage
        As /tf.

    Publishes
    ---------
    ros_3d_bb/tracks : ros_3d_bb/TrackedObjectArray
        Tracks in ~target_frame, with the stamp of the newest image.
    visualization_marker_array : visualization_msgs/MarkerArray
        The tracks as markers for RViz; published only if there are subscribers.
    """

    def __init__(self):
        params, marker_params, *tracking = given = read_params(TrackerNodeParams, MarkerParams, *TRACKING_PARAMS)
        self._markers = MarkerWriter(marker_params)
        self._lock = threading.Lock()
        self._diagnostics = Diagnostics()
        transforms = Transforms(params.tf_timeout)
        self._diagnostics.show('tf age', transforms.age)
        self._tracking_stage = TrackingStage(params, tracking, self._diagnostics, transforms)
        self._numbers = PersistentTrackIds(self._diagnostics)
        self._tracks_pub = rospy.Publisher(TRACKS_TOPIC, TrackedObjectArray, queue_size=10)
        self._markers_pub = rospy.Publisher(MARKERS_TOPIC, MarkerArray, queue_size=10)
        for camera in self._tracking_stage.cameras:
            self._subscribe(camera)
        self._tuning = ReconfigureServer(given, self._tune)

    def _tune(self, _params, marker_params, *tracking):
        with self._lock:
            self._tracking_stage.reconfigure(tracking)
            self._markers.reconfigure(marker_params)

    def _subscribe(self, camera):
        def of_camera(callback):
            return functools.partial(callback, camera=camera)
        subscribe(topic_of(camera, BOXES3D_TOPIC), BoundingBox3DArray, of_camera(self._on_boxes))
        with_camera, with_depth = self._tracking_stage.looks
        if with_camera:
            subscribe(topic_of(camera, INFO_TOPICS[0]), CameraInfo, of_camera(self._on_camera_info), 1)
        if with_depth:
            subscribe(topic_of(camera, DEPTH_TOPIC), Image, of_camera(self._on_depth), KEPT_AT_ONCE)

    def _on_camera_info(self, message, camera):
        with self._diagnostics.receiving('camera_info'):
            self._tracking_stage.add_camera_info(message, camera)

    def _on_depth(self, message, camera):
        with self._diagnostics.receiving('depth images'):
            self._tracking_stage.add_depth(message, arrival_clock_ns(), camera)

    def _on_boxes(self, message, camera):
        with self._diagnostics.receiving('3D boxes'):
            # Not under the lock: waiting for the transform of one camera must not delay the others.
            located = self._tracking_stage.locate(message, arrival_clock_ns(), camera)
            if located is None:
                return
            with self._lock:
                followed = self._tracking_stage.follow(located)
                if followed is not None:
                    self._publish(followed)

    def _publish(self, followed):
        tracks = self._numbers.assign(followed.tracks)
        self._tracks_pub.publish(tracks_to_msg(tracks, followed.header))
        self._diagnostics.record_latency(followed.header.stamp)
        if self._markers_pub.get_num_connections():
            self._markers_pub.publish(self._markers.write(tracks, followed.header))


def main():
    """Run the node."""
    run_node('tracker_node', TrackerNode)
