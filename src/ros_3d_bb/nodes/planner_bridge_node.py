"""ROS node that converts tracks to the input messages of local planners and costmaps."""
import threading
from typing import NamedTuple

import rospy
import tf2_ros
from std_msgs.msg import Header

from ros_3d_bb.conversions.perception_msgs import TRACKS_TOPIC, stamp_of, time_from
from ros_3d_bb.core.object_classes import read_object_classes
from ros_3d_bb.core.params import CLASSES_FILE, LARGEST, Param, parameters
from ros_3d_bb.core.time_jumps import TimeJumps
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import TrackedObjectArray
from ros_3d_bb.nodes.common.diagnostics import Diagnostics
from ros_3d_bb.nodes.common.latest_tracks import received_tracks
from ros_3d_bb.nodes.common.startup import read_params
from ros_3d_bb.nodes.common.subscribers import subscribe
from ros_3d_bb.nodes.common.tf_lookup import Transforms
from ros_3d_bb.planning.planner_outputs import NAMES, outputs_from
from ros_3d_bb.planning.planner_view import SAME_FRAME, predicted_to, rounding_m, with_class_widths

CHECK_PERIOD_S = 0.1  # between checks of ~timeout, whatever ~resend_period is; chosen: a tenth of the default timeout
MAX_ROUNDING_M = 0.005  # largest rounding error of a coordinate: a tenth of a typical costmap cell


@parameters()
class PlannerBridgeParams(NamedTuple):
    outputs: list = Param(('costmap',), choices=NAMES)
    planner_frame: str = Param('')
    robot_frame: str = Param('base_link')
    timeout: float = Param(
        1.0, 'Tracks that are older than this on arrival are rejected. After this time without tracks, '
        'and at most 0.1 s later, all outputs are emptied, once. More than the pipeline takes from image to tracks.',
        's', limits=(0.001, LARGEST))
    resend_period: float = Param(
        0.1, 'After this time without new tracks, outputs that planners take for the present are predicted to now and '
        'sent again.', 's', limits=(0.001, LARGEST))
    classes_file: str = CLASSES_FILE
    tf_timeout: float = Param(0.2, 'How long to wait for each transform at the stamp of the tracks.', 's')
    points_prediction: float = Param(
        0.3, 'How far ahead costmaps are marked with predicted footprints; 0: current positions only. The costmap '
        'does not know when people will be there, so long times block free ways.', 's')
    point_spacing: float = Param(
        0.035, 'Distance between the points of a footprint; at most 0.7 of a cell of the costmap, whose grid is turned '
        'against that of the points.', 'm', limits=(0.001, LARGEST))
    clearing_range: float = Param(
        10.0, 'Radius of the ring of points around the robot up to which the costmap is cleared before people are '
        'marked; 0: no ring. At least the raytrace_range of the costmap.', 'm')
    robot_radius: float = Param(
        0.35, 'Radius of the robot around the origin of its frame. Costs of people are relative to the highest one in '
        'this disc, so that a robot in the way of a person leaves it.', 'm', limits=(0.1, 5.0))


class ReceivedTracks(NamedTuple):
    """The latest tracks, in the frame in which they were received.

    `transforms` maps the frame of each output, and whether it takes the latest transform, to the 4x4 matrix from the
    tracks' frame to it; frames that are unknown to tf are omitted.
    """

    stamp_ns: int
    arrival_ns: int
    frame_id: str
    tracks: list
    transforms: dict


class PlannerTopic(object):
    """An output topic. `held` are the ReceivedTracks that the planner holds, None if it holds none."""

    def __init__(self, output, diagnostics):
        self.output, self.held, self._diagnostics = output, None, diagnostics
        self._publisher = rospy.Publisher(output.topic, output.kind, queue_size=2)

    def send(self, tracks, stamp_ns, received):
        """Publish tracks in the output frame, if there are subscribers; `received` are the ReceivedTracks from which
        they were predicted."""
        self.held = received
        if not self._publisher.get_num_connections():
            return
        output = self.output
        frame_id = (output.frame or received.frame_id).lstrip('/')  # tf2 rejects frames with a slash
        header = Header(stamp=time_from(0 if output.latest_tf else stamp_ns), frame_id=frame_id)
        try:
            message = output.write(tracks, received.transforms[output.frame, output.latest_tf], header)
            if message is not None:
                self._publisher.publish(message)
        except Exception as error:  # a fault of one output must not keep the tracks from the others
            self._diagnostics.warn('outputs failed', '%s cannot be published (%r); the other outputs are published, '
                                   'and this one is tried again with the next tracks' % (output.topic, error))

    def empty(self, stamp_ns):
        """Publish an empty array in the frame of the last one, if planners need it."""
        if self.output.is_emptied:
            self.send([], stamp_ns, self.held)
        self.held = None


class PlannerBridgeNode(object):
    """Publish tracks in the message formats of planners.

    ~outputs selects the published topics. If no tracks arrive for ~timeout, an empty array is published once on each,
    except for ~clearing_points. Parameters: config/planner_bridge.yaml.

    Subscribes
    ----------
    ros_3d_bb/tracks : ros_3d_bb/TrackedObjectArray
        Tracks.
    /tf,/tf_static : tf2_msgs/TFMessage
        Transforms from the frame of the tracks to ~robot_frame (`costmap`) and ~planner_frame (`teb`, `mpc`).

    Publishes
    ---------
    ~points : sensor_msgs/PointCloud2
        `costmap`: current and predicted footprints of people, as points for an obstacle layer.
    ~costs : nav_msgs/OccupancyGrid
        `costmap`: costs of people and their predicted positions around the robot, up to 99 of 100, as the map of a
        StaticLayer of a local costmap. The stamp is 0, for which tf2 takes the latest transform.
    ~clearing_points : sensor_msgs/PointCloud2
        `costmap`: ring of points around the robot up to which the costmap is cleared before people are marked. Not
        published if ~clearing_range is 0, and while there are no valid tracks, so that a costmap can notice it.
    /people : people_msgs/People
        `people`: for social_navigation_layers. The stamp is 0, for which tf2 takes the latest transform.
    ~obstacles : costmap_converter/ObstacleArrayMsg
        `teb`: for teb_local_planner.
    ~objects : derived_object_msgs/ObjectArray
        `mpc`: for mpc_planner_jackal.
    ~detections : vision_msgs/Detection3DArray
        `vision`: for consumers of vision_msgs.
    """

    def __init__(self):
        self._params, = read_params(PlannerBridgeParams)
        if not self._params.robot_frame:
            raise ValueError('parameter ~robot_frame is empty; a frame such as base_link expected')
        self._classes = read_object_classes(self._params.classes_file)
        self._diagnostics = Diagnostics()
        self._topics = [PlannerTopic(output, self._diagnostics) for output in outputs_from(self._params)]
        self._lock = threading.Lock()
        self._received, self._jumps = None, TimeJumps()
        self._transforms = Transforms(self._params.tf_timeout)
        self._diagnostics.show('tf age', self._transforms.age)
        rospy.on_shutdown(self._empty_all)
        subscribe(TRACKS_TOPIC, TrackedObjectArray, self._on_tracks, 2)
        self._timers = [rospy.Timer(rospy.Duration.from_sec(period_s), on_timer, reset=True) for period_s, on_timer in
                        ((CHECK_PERIOD_S, self._empty_outdated), (self._params.resend_period, self._resend))]

    def _on_tracks(self, message):
        with self._diagnostics.receiving('tracks'):
            received = self._read(message)
            if received is None:
                self._diagnostics.count('tracks from before a time jump')
                return
            with self._lock:
                self._received = received
                for topic in self._topics:
                    self._send(topic, _now_ns())
            self._diagnostics.count('tracks forwarded')
            self._diagnostics.record_latency(message.header.stamp)

    def _read(self, message):
        """Convert a message to `ReceivedTracks`. Raises ValueError if the tracks must not be passed to planners;
        returns None if the reason is a jump in time.
        """
        stamp_ns, now_ns = stamp_of(message), _now_ns()
        self._jumps.see('ROS time', now_ns)
        self._jumps.see('stamps', stamp_ns)
        late_s = (now_ns - stamp_ns) / NS
        if abs(late_s) > self._params.timeout and self._jumps.are_recent():
            return None
        if abs(late_s) > self._params.timeout:
            raise ValueError('their stamp is %.3f s %s the clock, more than ~timeout (%g s); a bag needs use_sim_time'
                             % (abs(late_s), 'before' if late_s > 0 else 'after', self._params.timeout))
        tracks = received_tracks(message, self._diagnostics)
        return ReceivedTracks(stamp_ns, now_ns, message.header.frame_id, with_class_widths(tracks, self._classes),
                              self._transforms_at(message.header))

    def _transforms_at(self, header):
        """Return the `transforms` of ReceivedTracks, at the stamp of the tracks or latest."""
        transforms = {}
        for frame, latest in sorted(set((topic.output.frame, topic.output.latest_tf) for topic in self._topics)):
            try:
                transforms[frame, latest] = self._transform(frame, latest, header)
            except tf2_ros.TransformException as error:
                self._diagnostics.warn_unless(
                    self._jumps.are_recent(), 'no transform', 'no transform from %s to %s at %.3f: %s; nothing is '
                    'published in %s, and an empty array after ~timeout'
                    % (header.frame_id, frame, header.stamp.to_sec(), error, frame))
        return transforms

    def _transform(self, frame, latest, header):
        if frame in ('', header.frame_id):
            return SAME_FRAME
        if latest:
            return self._transforms.latest(frame, header.frame_id, self._params.timeout)[0]
        return self._transforms.lookup(frame, header.frame_id, header.stamp)

    def _send(self, topic, now_ns):
        """Publish the latest tracks on one topic, in the form its planner requires, if the transform is known."""
        received, output = self._received, topic.output
        frame_from_tracks = received.transforms.get((output.frame, output.latest_tf))
        if frame_from_tracks is None:
            return
        tracks, stamp_ns = received.tracks, received.stamp_ns
        if output.to_now:
            stamp_ns = max(now_ns, stamp_ns)
            tracks = predicted_to(tracks, (stamp_ns - received.stamp_ns) / NS)
        error_m = rounding_m(tracks, frame_from_tracks) if output.float32 else 0.0
        if error_m > MAX_ROUNDING_M:
            self._diagnostics.warn('coordinates rounded', '%s has errors of up to %.2g m, as its coordinates are large '
                                   'and float32; set ~planner_frame to a frame with its origin near the robot'
                                   % (output.topic, error_m))
        topic.send(tracks, stamp_ns, received)

    def _empty_outdated(self, _event):
        with self._diagnostics.rejecting('outputs'), self._lock:
            now_ns = _now_ns()
            self._jumps.see('ROS time', now_ns)
            for topic in self._topics:
                if topic.held is not None and not self._is_valid(topic.held, now_ns):
                    self._diagnostics.warn_unless(
                        self._jumps.are_recent(), 'outputs emptied', 'no valid tracks for %g s: %s %s until the next '
                        'ones arrive' % (self._params.timeout, topic.output.topic,
                                         'is emptied' if topic.output.is_emptied else 'is silent'))
                    topic.empty(now_ns)

    def _resend(self, _event):
        """Publish the outputs that planners interpret as current again, if there are no new tracks."""
        with self._diagnostics.rejecting('outputs'), self._lock:
            now_ns = _now_ns()
            for topic in self._topics:
                if (topic.output.to_now and topic.held is not None and self._is_valid(topic.held, now_ns)
                        and now_ns - self._received.arrival_ns >= self._params.resend_period * NS):
                    self._send(topic, now_ns)

    def _is_valid(self, received, now_ns):
        return 0 <= now_ns - received.arrival_ns <= self._params.timeout * NS

    def _empty_all(self):
        """Publish empty arrays at shutdown, so that planners do not keep the last tracks.

        They are the last messages: callbacks that are running, or are called later, find no topics.
        """
        with self._lock:
            topics, self._topics = self._topics, []
            for topic in topics:
                if topic.held is not None:
                    topic.empty(_now_ns())


def _now_ns():
    """Return the ROS time to which positions are predicted; image stamps use the same clock."""
    return rospy.get_rostime().to_nsec()
