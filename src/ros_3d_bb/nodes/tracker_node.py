"""The node that makes tracks of 3D boxes in a fixed frame."""
import functools
import threading
from typing import NamedTuple

import rospy
import tf2_ros
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header
from visualization_msgs.msg import MarkerArray

from ros_3d_bb.images import depth_from
from ros_3d_bb.markers import MarkerParams, MarkerWriter
from ros_3d_bb.messages import camera_from_message, detections_from_message, stamp_of, time_from, tracks_to_message
from ros_3d_bb.msg import BoundingBox3DArray, TrackedObjectArray
from ros_3d_bb.nodes.diagnostics import Diagnostics
from ros_3d_bb.nodes.startup import read_params, run_node
from ros_3d_bb.nodes.transforms import Transforms
from ros_3d_bb.nodes.transport import KEPT_AT_ONCE, subscribe
from ros_3d_bb.params import check_not_negative, nearest_name
from ros_3d_bb.stamped import NS, StampedCache, arrival_clock_ns
from ros_3d_bb.tracking.measuring import NoiseParams
from ros_3d_bb.tracking.prediction import PredictionParams
from ros_3d_bb.tracking.thesis import ThesisTracker, ThesisTrackerParams
from ros_3d_bb.tracking.tracked import View
from ros_3d_bb.tracking.tracker import Tracker, TrackerParams
from ros_3d_bb.tracking.visibility import depths_towards, edges_of

DEPTH_TOPIC = 'camera/aligned_depth_to_color/image_raw'
CAMERA_INFO_TOPIC = 'camera/color/camera_info'
TRACKING_PARAMS = ThesisTrackerParams, TrackerParams, NoiseParams, PredictionParams
JUMP_NS = NS  # stamps that go back by more are a jump in time, by less a late message


class TrackerNodeParams(NamedTuple):
    """See config/tracker.yaml."""

    tracker: str = 'kalman'
    target_frame: str = 'map'
    camera_frame: str = ''
    use_depth: bool = True
    depth_scale: float = 0.0
    depth_cache_length: float = 1.0
    stamp_tolerance: float = 0.005
    tf_timeout: float = 0.2


class TrackerNode(object):
    """Track 3D boxes in a fixed frame.

    Subscribes: ros_3d_bb/bb_3d, tf; camera/color/camera_info and camera/aligned_depth_to_color/image_raw, to tell who
    is out of view or hidden. Publishes: ros_3d_bb/tracks, visualization_marker_array, both with the stamp of the newest
    image. Without a transform at that stamp nothing is published and nobody ages. Parameters: config/tracker.yaml.
    """

    def __init__(self):
        self._params, marker_params, *tracking = read_params(TrackerNodeParams, MarkerParams, *TRACKING_PARAMS)
        _check(self._params)
        self._tracker = _tracker_of(self._params.tracker, *tracking)
        self._markers = MarkerWriter(marker_params)
        self._lock, self._camera_lock = threading.Lock(), threading.Lock()
        self._last_stamp_ns = 0
        self._camera, self._depths = None, StampedCache(int(self._params.depth_cache_length * NS))
        self._diagnostics = Diagnostics()
        self._transforms = Transforms(self._params.tf_timeout)
        self._tracks_pub = rospy.Publisher('ros_3d_bb/tracks', TrackedObjectArray, queue_size=10)
        self._markers_pub = rospy.Publisher('visualization_marker_array', MarkerArray, queue_size=10)
        self._subscribe()

    def _subscribe(self):
        subscribe('ros_3d_bb/bb_3d', BoundingBox3DArray, self._on_boxes)
        if self._params.tracker != 'thesis':  # which does not ask where the camera looks
            subscribe(CAMERA_INFO_TOPIC, CameraInfo, self._on_camera_info, 1)
            if self._params.use_depth:
                subscribe(DEPTH_TOPIC, Image, self._on_depth, KEPT_AT_ONCE)

    def _on_camera_info(self, message):
        with self._diagnostics.refusing('camera_info'):
            self._camera = camera_from_message(message)

    def _on_depth(self, message):
        with self._diagnostics.refusing('depth images'), self._camera_lock:
            self._depths.add(stamp_of(message), arrival_clock_ns(), message)

    def _on_boxes(self, message):
        with self._diagnostics.refusing('3D boxes'), self._lock:
            stamp_ns = stamp_of(message)
            self._follow_time(stamp_ns)
            tracks = self._track(stamp_ns, message)
            if tracks is None:
                return
            header = Header(stamp=time_from(self._last_stamp_ns), frame_id=self._params.target_frame)
            self._tracks_pub.publish(tracks_to_message(tracks, header))
            if self._markers_pub.get_num_connections():
                self._markers_pub.publish(self._markers.write(tracks, header))
            self._diagnostics.count('images tracked')

    def _track(self, stamp_ns, message):
        """The tracks after one array of boxes; None where there is no transform for it."""
        camera_frame = self._params.camera_frame or message.header.frame_id
        try:
            fixed_from_camera = self._transforms.lookup(self._params.target_frame, camera_frame, message.header.stamp)
        except tf2_ros.TransformException as error:
            self._tracker.skip(stamp_ns)
            self._diagnostics.warn('no transform', 'no transform from %s to %s at %.3f: %s; tracks are kept as they are'
                                   % (camera_frame, self._params.target_frame, stamp_ns / NS, error))
            return None
        return self._tracker.update(stamp_ns, detections_from_message(message, fixed_from_camera),
                                    self._view(stamp_ns, message.header.frame_id, fixed_from_camera))

    def _view(self, stamp_ns, frame_id, fixed_from_camera):
        """What the camera saw at a stamp, as far as it is known."""
        camera = self._camera
        if camera is None:
            return View(fixed_from_camera, camera=frame_id)
        with self._camera_lock:
            entry = self._depths.at(stamp_ns, int(self._params.stamp_tolerance * NS))
        depth_at = None
        if entry is not None:
            depth = depth_from(entry.value, self._params.depth_scale)
            if depth.values.shape == (camera.height, camera.width):  # bbox3d_node says what is wrong with any other
                depth_at = functools.partial(depths_towards, camera, depth)
        return View(fixed_from_camera, edges_of(camera), frame_id, depth_at)

    def _follow_time(self, stamp_ns):
        """Forget tracks and transforms where the stamps went back: a bag looped, or somebody sought in it."""
        if stamp_ns < self._last_stamp_ns - JUMP_NS:
            rospy.loginfo('time went back from %.3f to %.3f: tracks and transforms of the time before are forgotten',
                          self._last_stamp_ns / NS, stamp_ns / NS)
            self._tracker.reset()
            self._transforms.go_back()
            self._last_stamp_ns = stamp_ns
        self._last_stamp_ns = max(stamp_ns, self._last_stamp_ns)


def _tracker_of(name, thesis, *kalman):
    """The tracker of a name. Raises ValueError."""
    trackers = {'thesis': lambda: ThesisTracker(thesis), 'kalman': lambda: Tracker(*kalman)}
    if name not in trackers:
        raise ValueError('parameter ~tracker is %r; did you mean %s? Known: %s'
                         % (name, nearest_name(name, sorted(trackers)), ', '.join(sorted(trackers))))
    return trackers[name]()


def _check(params):
    if not params.target_frame:
        raise ValueError('parameter ~target_frame is empty; map or odom expected')
    check_not_negative(params, 'tf_timeout', 'depth_scale', 'depth_cache_length', 'stamp_tolerance')


def main():
    """Run the node."""
    run_node('tracker_node', TrackerNode)
