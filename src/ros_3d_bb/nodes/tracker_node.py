"""The node that makes tracks of 3D boxes in a fixed frame."""
import threading
from typing import NamedTuple

import rospy
import tf2_ros
from std_msgs.msg import Header
from visualization_msgs.msg import MarkerArray

from ros_3d_bb.markers import MarkerWriter
from ros_3d_bb.messages import detections_from_message, stamp_of, tracks_to_message
from ros_3d_bb.msg import BoundingBox3DArray, TrackedObjectArray
from ros_3d_bb.nodes.diagnostics import Diagnostics
from ros_3d_bb.nodes.startup import read_params, run_node
from ros_3d_bb.nodes.transforms import Transforms
from ros_3d_bb.params import check_not_negative
from ros_3d_bb.stamped import NS
from ros_3d_bb.tracking.thesis import ThesisTracker, ThesisTrackerParams

JUMP_NS = NS  # stamps that go back by more are a jump in time, by less a late message


class TrackerNodeParams(NamedTuple):
    """See config/tracker.yaml."""

    tracker: str = 'thesis'
    target_frame: str = 'map'
    camera_frame: str = ''
    tf_timeout: float = 0.2
    marker_lifetime: float = 2.0


class TrackerNode(object):
    """Track 3D boxes in a fixed frame.

    Subscribes: ros_3d_bb/bb_3d, tf. Publishes: ros_3d_bb/tracks, visualization_marker_array, both with the stamp of
    the image. Without a transform at that stamp nothing is published and nobody ages. Parameters: config/tracker.yaml.
    """

    def __init__(self):
        self._params, tracking = read_params(TrackerNodeParams, ThesisTrackerParams)
        _check(self._params)
        self._tracker = ThesisTracker(tracking)
        self._markers = MarkerWriter(self._params.marker_lifetime)
        self._lock = threading.Lock()
        self._last_stamp_ns = 0
        self._diagnostics = Diagnostics()
        self._transforms = Transforms(self._params.tf_timeout)
        self._tracks_pub = rospy.Publisher('ros_3d_bb/tracks', TrackedObjectArray, queue_size=10)
        self._markers_pub = rospy.Publisher('visualization_marker_array', MarkerArray, queue_size=10)
        rospy.Subscriber('ros_3d_bb/bb_3d', BoundingBox3DArray, self._on_boxes, queue_size=10)

    def _on_boxes(self, message):
        with self._diagnostics.refusing('3D boxes'), self._lock:
            stamp_ns = stamp_of(message)
            self._follow_time(stamp_ns)
            tracks = self._track(stamp_ns, message)
            if tracks is None:
                return
            header = Header(stamp=message.header.stamp, frame_id=self._params.target_frame)
            self._tracks_pub.publish(tracks_to_message(tracks, header))
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
        return self._tracker.update(stamp_ns, detections_from_message(message, fixed_from_camera))

    def _follow_time(self, stamp_ns):
        """Forget tracks and transforms where the stamps went back: a bag looped, or somebody sought in it."""
        if stamp_ns < self._last_stamp_ns - JUMP_NS:
            rospy.loginfo('time went back from %.3f to %.3f: tracks and transforms of the time before are forgotten',
                          self._last_stamp_ns / NS, stamp_ns / NS)
            self._tracker.reset()
            self._transforms.go_back()
            self._last_stamp_ns = stamp_ns
        self._last_stamp_ns = max(stamp_ns, self._last_stamp_ns)


def _check(params):
    if params.tracker != 'thesis':
        raise ValueError('parameter ~tracker is %r; thesis expected' % params.tracker)
    if not params.target_frame:
        raise ValueError('parameter ~target_frame is empty; map or odom expected')
    check_not_negative(params, 'tf_timeout', 'marker_lifetime')


def main():
    """Run the node."""
    run_node('tracker_node', TrackerNode)
