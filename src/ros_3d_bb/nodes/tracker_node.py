"""ROS node that tracks 3D boxes in a fixed frame."""
import functools

import rospy
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import Image
from visualization_msgs.msg import MarkerArray

from ros_3d_bb.conversions.camera_msgs import (COLOR_INFO_IMAGES, DEPTH_TOPICS, INFO_TOPICS, RAW, info_topic_beside,
                                               topic_of)
from ros_3d_bb.conversions.perception_msgs import BOXES3D_TOPIC, TRACKS_TOPIC, tracks_to_msg
from ros_3d_bb.core.latest_worker import NewestWorker
from ros_3d_bb.core.time_sync import arrival_clock_ns
from ros_3d_bb.msg import BoundingBox3DArray, TrackedObjectArray
from ros_3d_bb.nodes.common.diagnostics import Diagnostics
from ros_3d_bb.nodes.common.reconfigure_server import ReconfigureServer
from ros_3d_bb.nodes.common.startup import Part, read_params
from ros_3d_bb.nodes.common.subscribers import KEPT_AT_ONCE, subscribe, subscribe_camera_info
from ros_3d_bb.nodes.common.tf_lookup import Transforms
from ros_3d_bb.pipeline.tracking_stage import TRACKING_PARAMS, TrackerNodeParams, TrackingStage
from ros_3d_bb.visualization.markers import MARKERS_TOPIC, MarkerParams, MarkerWriter

RESERVED_IDS = 1000  # IDs per reservation: a restarted tracker skips up to as many
LARGEST_PARAM = 2 ** 31 - 1  # largest integer of a ROS parameter


class TrackerNode(object):
    """Track 3D boxes in a fixed frame.

    If there is no transform at the stamp of the boxes, nothing is published and tracks do not age. Parameters:
    config/tracker.yaml; many can be changed at run time. With ~cameras, the node subscribes to the boxes, camera_info
    and depth images of each camera: for the camera front these are front/ros_3d_bb/bb_3d, front/color/camera_info and
    front/aligned_depth_to_color/image_raw. With ~depth raw, the depth images are on camera/depth/image_rect_raw
    (front/depth/image_rect_raw) and their camera_info on camera/depth/camera_info.

    Subscribes
    ----------
    ros_3d_bb/bb_3d : ros_3d_bb/BoundingBox3DArray
        3D boxes.
    camera/color/camera_info : sensor_msgs/CameraInfo
        Calibration, used to determine which tracks are out of view.
    camera/aligned_depth_to_color/image_raw : sensor_msgs/Image
        Depth image, used to determine which tracks are occluded; only with ~use_depth.
    map : nav_msgs/OccupancyGrid
        Static map in ~target_frame, in whose occupied cells no track starts; only with ~use_map.
    /tf,/tf_static : tf2_msgs/TFMessage
        Pose of the camera in ~target_frame.

    Publishes
    ---------
    ros_3d_bb/tracks : ros_3d_bb/TrackedObjectArray
        Tracks in ~target_frame, with the stamp of the newest image.
    visualization_marker_array : visualization_msgs/MarkerArray
        The tracks as markers for RViz; published only if there are subscribers.
    """

    def __init__(self, part=Part()):
        params, marker_params, *tracking = given = read_params(TrackerNodeParams, MarkerParams, *TRACKING_PARAMS,
                                                               namespace=part.namespace)
        self._markers = MarkerWriter(marker_params)
        self._diagnostics = Diagnostics(part)
        self.transforms = Transforms(params.tf_timeout)
        self._diagnostics.show('tf age', self.transforms.age)
        self._track_ids = TrackIdReservation(self._diagnostics, part)
        self._stage = TrackingStage(params, tracking, self._diagnostics, self.transforms, self._on_tracks,
                                    self._track_ids.last_id)
        self._tracks_pub = rospy.Publisher(TRACKS_TOPIC, TrackedObjectArray, queue_size=10)
        self._markers_pub = rospy.Publisher(MARKERS_TOPIC, MarkerArray, queue_size=10)
        for camera_name in self._stage.views:
            self._subscribe(camera_name, params, part.subscribes)
        self._uses_depth = params.use_depth
        if params.use_map:
            subscribe('map', OccupancyGrid, self._on_map, 1, is_irregular=True)
        self._markers.areas_m = self._stage.ignored.polygons_m
        ReconfigureServer(given, self._reconfigure, part.namespace)

    def _subscribe(self, camera_name, params, with_boxes):
        depth_topic = topic_of(camera_name, DEPTH_TOPICS[params.depth][0])

        def of_camera(callback):
            return functools.partial(callback, camera_name=camera_name)
        if with_boxes:
            subscribe(topic_of(camera_name, BOXES3D_TOPIC), BoundingBox3DArray, of_camera(self._on_boxes))
        images_topic = topic_of(camera_name, COLOR_INFO_IMAGES[params.depth])
        subscribe_camera_info(topic_of(camera_name, INFO_TOPICS[0]), images_topic, of_camera(self._on_camera_info), 1)
        if params.use_depth and with_boxes:
            subscribe(depth_topic, Image, of_camera(self._on_depth), KEPT_AT_ONCE)
        if params.use_depth and params.depth == RAW:
            depth_info_topic = info_topic_beside(rospy.resolve_name(depth_topic))
            subscribe_camera_info(depth_info_topic, depth_topic, of_camera(self._on_depth_camera_info), 1)

    def _reconfigure(self, params, marker_params, *tracking):
        with self._stage.lock:
            self._stage.reconfigure(params, tracking)
            self._markers.reconfigure(marker_params)
            self._markers.areas_m = self._stage.ignored.polygons_m

    def _on_map(self, message):
        with self._diagnostics.receiving('maps'):
            self._stage.set_map(message)
            self._diagnostics.count('maps used')

    def _on_camera_info(self, message, camera_name):
        with self._diagnostics.receiving('camera_info'):
            self._stage.views[camera_name].add_camera_info(message)

    def _on_depth_camera_info(self, message, camera_name):
        with self._diagnostics.receiving('camera_info of depth'):
            self._stage.views[camera_name].add_depth_camera_info(message)

    def _on_depth(self, message, camera_name):
        with self._diagnostics.receiving('depth images'):
            self._stage.views[camera_name].add_depth(message, arrival_clock_ns())

    def on_frame(self, message, depth_msg):
        if self._uses_depth:
            self._on_depth(depth_msg, '')
        self._on_boxes(message)

    def _on_boxes(self, message, camera_name=''):
        with self._diagnostics.receiving('3D boxes'):
            self._stage.add_boxes(message, arrival_clock_ns(), camera_name)

    def _on_tracks(self, tracks, header):
        self._track_ids.reserve(tracks)
        if self._tracks_pub.get_num_connections():
            self._tracks_pub.publish(tracks_to_msg(tracks, header))
        self._diagnostics.record_latency(header.stamp)
        if self._markers_pub.get_num_connections():
            self._markers.views_m = self._stage.views_m
            self._markers_pub.publish(self._markers.write(tracks, header))


class TrackIdReservation(object):
    """Reserves track IDs, so that they remain unique when the tracker is killed and restarted.

    The largest reserved ID is stored on the parameter server, which outlives the node. The parameter is outside the
    node's namespace (`/tracker_node_numbers`), because roslaunch clears private parameters. IDs are also assigned while
    the master is unreachable. `last_id` is the last ID that was reserved before the node was started. Raises ValueError
    if the parameter is not a valid ID.
    """

    def __init__(self, diagnostics, part=Part()):
        self._diagnostics, self._name = diagnostics, part.node_name + '_numbers'
        self.last_id = rospy.get_param(self._name, 0)
        if type(self.last_id) is not int or not 0 <= self.last_id <= LARGEST_PARAM - RESERVED_IDS:
            raise ValueError('parameter %s is %r; the largest track ID so far expected' % (self._name, self.last_id))
        self._reserved = self.last_id + RESERVED_IDS
        rospy.set_param(self._name, self._reserved)
        # In a separate thread, because an unresponsive master must not block the tracks.
        self._worker = NewestWorker(self._store, self._on_error)

    def reserve(self, tracks):
        """Reserve further IDs before those of the tracks, which are ordered by ID, reach the last reserved one."""
        if tracks and tracks[-1].id > self._reserved - RESERVED_IDS // 2:
            self._worker.offer(tracks[-1].id + RESERVED_IDS)

    def _store(self, last_id):
        rospy.set_param(self._name, last_id)
        self._reserved = last_id

    def _on_error(self, error):
        self._diagnostics.warn('track IDs not reserved', 'the ROS master does not accept the parameter %s (%s): a '
                               'restarted tracker may assign the same track IDs again; trying again'
                               % (self._name, error))
