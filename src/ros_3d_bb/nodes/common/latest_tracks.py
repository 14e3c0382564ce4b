"""The newest tracks that a node has received, as long as they are recent."""
from typing import Any, NamedTuple

import rospy
import tf2_ros

from ros_3d_bb.conversions.perception_msgs import TRACKS_TOPIC, stamp_of, tracks_from_msg
from ros_3d_bb.core.object_classes import read_object_classes
from ros_3d_bb.core.time_jumps import TimeJumps
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import TrackedObjectArray
from ros_3d_bb.nodes.common.subscribers import subscribe
from ros_3d_bb.nodes.common.tf_lookup import Transforms
from ros_3d_bb.planning.planner_view import usable_tracks, with_class_widths, with_usable_covariances


def received_tracks(message, diagnostics):
    """The usable tracks of a TrackedObjectArray; the others, and unusable covariances, are counted and reported."""
    tracks, faults = usable_tracks(tracks_from_msg(message))
    diagnostics.count_dropped('tracks', faults)
    tracks, faults = with_usable_covariances(tracks)
    diagnostics.count_dropped('covariances', faults)
    return tracks


class Tracks(NamedTuple):
    """Valid tracks of one image; their stamp and frame; their age in seconds, as `newest` returns them; and the current
    pose (4, 4) of their frame in that of the robot, as `RobotTracks.around` returns them."""

    tracks: list
    stamp_ns: int
    frame_id: str
    age_s: float = 0.0
    robot_from_tracks: Any = None
    pose_age_s: float = 0.0


class LatestTracks(object):
    """Receive tracks, and give out the newest ones until their image is older than a timeout.

    `on_tracks` is called with each new Tracks.

    Subscribes
    ----------
    ros_3d_bb/tracks : ros_3d_bb/TrackedObjectArray
        Tracks.
    """

    def __init__(self, diagnostics, timeout_s, on_tracks=lambda _tracks: None):
        self._diagnostics, self._timeout_s, self._on_tracks = diagnostics, timeout_s, on_tracks
        self._newest, self._jumps = None, TimeJumps()
        subscribe(TRACKS_TOPIC, TrackedObjectArray, self._on_message, 2)

    def newest(self):
        """Return the newest Tracks; None if they are too old or the clock went back."""
        newest, now_ns = self._newest, rospy.get_rostime().to_nsec()
        self._jumps.see('ROS time', now_ns)
        if newest is None:
            return None
        age_s = (now_ns - newest.stamp_ns) / NS
        return newest._replace(age_s=max(age_s, 0.0)) if abs(age_s) <= self._timeout_s else None

    def report_missing(self, consequence):
        """Warn that there are none; shortly after a jump in time, only count it, because those of the new time follow.
        """
        self._diagnostics.warn_unless(self._jumps.are_recent(), 'no recent tracks', 'no recent tracks: ' + consequence)

    def _on_message(self, message):
        with self._diagnostics.receiving('tracks'):
            self._jumps.see('stamps', stamp_of(message))
            tracks = received_tracks(message, self._diagnostics)
            received = Tracks(tracks, stamp_of(message), message.header.frame_id.lstrip('/'))
            self._newest = received
            self._on_tracks(received)
            self._diagnostics.record_latency(message.header.stamp)


class RobotTracks(LatestTracks):
    """As LatestTracks, with the pose of the robot, to which the same timeout applies.

    The parameters `params` are `timeout`, `robot_frame` and `classes_file`.

    Subscribes
    ----------
    ros_3d_bb/tracks : ros_3d_bb/TrackedObjectArray
        Tracks.
    /tf,/tf_static : tf2_msgs/TFMessage
        Pose of the robot in the frame of the tracks.
    """

    def __init__(self, diagnostics, params, on_tracks=lambda _tracks: None):
        if not params.robot_frame:
            raise ValueError('parameter ~robot_frame is empty; a frame such as base_link expected')
        self._classes = read_object_classes(params.classes_file)
        self._robot_frame, self._transforms = params.robot_frame, Transforms(wait_s=0)
        diagnostics.show('tf age', self._transforms.age)
        super(RobotTracks, self).__init__(diagnostics, params.timeout, on_tracks)

    def around(self):
        """Return the newest Tracks with at least the widths of their classes (`with_class_widths`); None if they or the
        pose are older than the timeout, or the pose is unknown."""
        newest = self.newest()
        robot_from_tracks, pose_age_s = (None, 0.0) if newest is None else self.robot_from(newest.frame_id)
        if robot_from_tracks is None:
            return None
        return newest._replace(tracks=with_class_widths(newest.tracks, self._classes),
                               robot_from_tracks=robot_from_tracks, pose_age_s=pose_age_s)

    def robot_from(self, frame_id):
        """Return the latest pose of a frame in that of the robot, (4, 4), and its age in seconds; None, 0 if it is
        unknown, or further than the timeout from ROS time."""
        try:
            return self._transforms.latest(self._robot_frame, frame_id, self._timeout_s)
        except tf2_ros.TransformException as error:
            self._diagnostics.warn_unless(
                self._transforms.have_jumped(), 'no transform', 'no transform from %s to %s: %s; waiting for it'
                % (frame_id, self._robot_frame, error))
            return None, 0.0
