"""From 3D boxes and transforms to tracks: what tracker_node and process_bag do with messages."""
import functools
import re
import threading
from typing import Any, NamedTuple

import numpy as np
import tf2_ros
from std_msgs.msg import Header

from ros_3d_bb.conversions.image_msgs import imgmsg_to_depth
from ros_3d_bb.conversions.perception_msgs import (camera_from_msg, detections_from_msg, stamp_of, time_from,
                                                   usable_boxes3d)
from ros_3d_bb.core.camera_clocks import LONGEST_LAG_NS, CameraClocks
from ros_3d_bb.core.params import DEPTH_SCALE, STAMP_TOLERANCE, Param, parameters
from ros_3d_bb.core.time_sync import JUMP_NS, NS, MessageCache
from ros_3d_bb.tracking.measurement_model import NoiseParams
from ros_3d_bb.tracking.occlusion import depths_towards
from ros_3d_bb.tracking.prediction import PredictionParams
from ros_3d_bb.tracking.thesis_tracker import ThesisTracker, ThesisTrackerParams
from ros_3d_bb.tracking.tracker import Tracker, TrackerParams
from ros_3d_bb.tracking.types import CameraView

TRACKING_PARAMS = ThesisTrackerParams, TrackerParams, NoiseParams, PredictionParams
TRACKERS = {'thesis': (ThesisTracker, slice(0, 1)), 'kalman': (Tracker, slice(1, 4))}  # with their part of those
NAMESPACE = re.compile(r'/?[A-Za-z]\w*(/\w+)*$')


@parameters()
class TrackerNodeParams(NamedTuple):
    """Parameters of tracker_node beside those of the trackers and of the markers."""

    tracker: str = Param(
        'kalman', 'Tracking algorithm. kalman: a Kalman filter for each person, which weighs boxes by their '
        'covariance, models outliers and occlusion, and re-identifies people after it. thesis: greedy nearest '
        'neighbour, averaged velocity and straight prediction, for comparison.', choices=('kalman', 'thesis'))
    target_frame: str = Param('map')
    cameras: list = Param(())
    camera_frame: str = Param('')
    use_depth: bool = Param(True, 'Whether depth images are used to find out that a person is occluded.')
    depth_scale: float = DEPTH_SCALE
    depth_cache_length: float = Param(1.0, 'How long depth images are kept for the boxes of the same stamp.', 's')
    stamp_tolerance: float = STAMP_TOLERANCE
    tf_timeout: float = Param(0.2, 'How long to wait for the transform at the stamp of the boxes.', 's')


class LocatedBoxes(NamedTuple):
    """A BoundingBox3DArray of a camera (its namespace, '' for the only one) whose transform is known, (4, 4), and how
    often time had gone back until it came.
    """

    message: Any
    camera: str
    fixed_from_camera: np.ndarray
    jumps: int


class TrackingResult(NamedTuple):
    """The tracks (`types.TrackedObject`) after one image; the header has the newest stamp and the fixed frame."""

    header: Header
    tracks: list


class TrackingStage(object):
    """Follow 3D boxes in a fixed frame. Without a transform at their stamp there is no answer and nobody ages.

    Each message comes with the namespace of its camera, '' for the only one; boxes and depth also with when they
    arrived, `now_ns` on a clock of the caller's. Methods may be called from any thread.

    Parameters
    ----------
    params : TrackerNodeParams
    tracking : list
        One instance of each of `TRACKING_PARAMS`.
    tally : event_counter.EventCounter
    transforms
        Its `lookup(target_frame, source_frame, stamp)` returns target_from_source (4, 4) or raises
        tf2_ros.TransformException; `go_back()` is called where time went back.

    Raises
    ------
    ValueError
        If a parameter makes no sense.
    """

    def __init__(self, params, tracking, tally, transforms):
        _check(params)
        self._params, self._tally, self._transforms = params, tally, transforms
        self._tracker = _trackers_of(tracking)[params.tracker]
        self._images_lock, self._tracks_lock = threading.Lock(), threading.Lock()
        self._clocks = CameraClocks()
        self._newest_ns = {}  # by camera, of the images that were tracked
        self._jumps = 0  # how often time has gone back
        self._frames = {}  # by camera
        self._intrinsics = {}
        self._depths = {camera: MessageCache(int(params.depth_cache_length * NS)) for camera in self.cameras}

    @property
    def cameras(self):
        """The namespaces of the cameras."""
        return tuple(self._params.cameras) or ('',)

    def reconfigure(self, tracking):
        """Take the next boxes with other parameters of tracking; tracks go on. Raises ValueError as at the start."""
        _trackers_of(tracking)  # also what the other one would refuse is refused
        with self._tracks_lock:
            self._tracker.reconfigure(*tracking[TRACKERS[self._params.tracker][1]])

    @property
    def looks(self):
        """Whether camera_info is of use, and depth images."""
        with_camera = self._params.tracker != 'thesis'  # which does not ask where the camera looks
        return with_camera, with_camera and self._params.use_depth

    def add_camera_info(self, message, camera=''):
        """Take a sensor_msgs/CameraInfo. Raises ValueError where it cannot be used."""
        self._intrinsics[camera] = camera_from_msg(message)

    def add_depth(self, message, now_ns, camera=''):
        """Take a depth image. Raises ValueError where it carries no stamp."""
        with self._images_lock:
            self._depths[camera].add(stamp_of(message), now_ns, message)

    def add_boxes(self, message, now_ns, camera=''):
        """Take a BoundingBox3DArray: `locate` it and `follow` what is in it.

        Returns
        -------
        TrackingResult or None
            None where there is no transform for it, or where its stamp is not of the time of the other cameras.

        Raises
        ------
        ValueError
            If it cannot be used.
        """
        located = self.locate(message, now_ns, camera)
        return None if located is None else self.follow(located)

    def locate(self, message, now_ns, camera=''):
        """Find out where the camera of a BoundingBox3DArray was, which may have to be waited for.

        Returns
        -------
        LocatedBoxes or None
            As of `add_boxes`, and ValueError, too.
        """
        stamp_ns = stamp_of(message)
        frame_id = self._params.camera_frame or message.header.frame_id
        with self._tracks_lock:
            right = self._clocks.accept(stamp_ns, now_ns, camera)
            if right is not None:
                self._leave_out(stamp_ns, camera, right)
                return None
            if self._is_jump_back(stamp_ns, now_ns, camera):
                self._go_back(stamp_ns)
            jumps = self._jumps
        try:
            return LocatedBoxes(message, camera, self._transforms.lookup(self._params.target_frame, frame_id,
                                                                         message.header.stamp), jumps)
        except tf2_ros.TransformException as error:
            with self._tracks_lock:
                if jumps == self._jumps:
                    self._tracker.skip(stamp_ns, camera or message.header.frame_id)
            self._tally.warn('no transform', 'no transform from %s to %s at %.3f: %s; tracks are kept as they are'
                             % (frame_id, self._params.target_frame, stamp_ns / NS, error))
            return None

    def follow(self, located):
        """Track what is in a Located.

        Returns
        -------
        TrackingResult or None
            None where time went back since it was located. Raises ValueError as `add_boxes`.
        """
        message, camera, fixed_from_camera, jumps = located
        stamp_ns = stamp_of(message)
        if camera:
            self._check_frame(message.header.frame_id, camera)
        usable, faults = usable_boxes3d(message)
        self._tally.leave_out('3D boxes', faults)
        if faults and not usable.boxes:  # not the same as an image without people
            with self._tracks_lock:
                self._tracker.skip(stamp_ns, camera or message.header.frame_id)
            raise ValueError('none of their %d boxes can be used; tracks are kept as they are' % len(faults))
        detections = detections_from_msg(usable, fixed_from_camera)
        with self._tracks_lock:
            if jumps != self._jumps:
                self._tally.warn('images of the time before', 'boxes at %.3f are left out: time went back while their '
                                 'transform was waited for' % (stamp_ns / NS))
                return None
            tracks = self._tracker.update(stamp_ns, detections, self._view(stamp_ns, located))
            self._clocks.track(camera)
            self._newest_ns[camera] = max(stamp_ns, self._newest_ns.get(camera, stamp_ns))
            newest_ns = max(self._newest_ns.values())
        self._tally.count('images tracked')
        return TrackingResult(Header(stamp=time_from(newest_ns), frame_id=self._params.target_frame), tracks)

    def _view(self, stamp_ns, located):
        """What the camera saw at a stamp, as far as it is known."""
        name = located.camera or located.message.header.frame_id
        camera = self._intrinsics.get(located.camera)
        if camera is None:
            return CameraView(located.fixed_from_camera, camera=name)
        with self._images_lock:
            entry = self._depths[located.camera].nearest(stamp_ns, int(self._params.stamp_tolerance * NS))
        depth_at = None
        if entry is not None:
            with self._tally.rejecting('depth images'):  # the boxes are good without
                depth = imgmsg_to_depth(entry.value, self._params.depth_scale)
                if depth.values.shape == (camera.height, camera.width):  # bbox3d_node says what is wrong with others
                    depth_at = functools.partial(depths_towards, camera, depth)
        return CameraView(located.fixed_from_camera, camera, name, depth_at)

    def _is_jump_back(self, stamp_ns, now_ns, camera):
        """Whether time went back with an image that was accepted; not where a camera lags behind one that has ended."""
        ahead = {other: newest_ns for other, newest_ns in self._newest_ns.items() if stamp_ns < newest_ns - JUMP_NS}
        return (camera in ahead or any(self._clocks.is_tracked(other, now_ns) for other in ahead)
                or stamp_ns < max(ahead.values(), default=stamp_ns) - LONGEST_LAG_NS)

    def _go_back(self, stamp_ns):
        """Forget tracks and transforms: a bag looped, or somebody sought in it."""
        self._tally.note('jumps back in time', 'time went back from %.3f to %.3f: tracks and transforms of the '
                         'time before are forgotten' % (max(self._newest_ns.values()) / NS, stamp_ns / NS))
        self._tracker.reset()
        self._transforms.go_back()
        self._newest_ns = {}
        self._jumps += 1

    def _leave_out(self, stamp_ns, camera, right):
        """Warn that boxes are not of the time of the camera that is right."""
        newest_ns = max(self._newest_ns.values(), default=stamp_ns)
        event = 'images ahead of other cameras' if stamp_ns > newest_ns else 'images of the time before'
        self._tally.warn(event, 'boxes of %s at %.3f are left out: their stamp is %.3f s from the newest one, '
                         'and %s has the right time; such boxes are tracked if that camera follows or ends'
                         % (camera, stamp_ns / NS, (stamp_ns - newest_ns) / NS, right))

    def _check_frame(self, frame_id, camera):
        """Say so where two cameras have one frame: tf then takes them to be in one place."""
        if self._frames.get(camera) == frame_id:
            return
        self._frames[camera] = frame_id
        cameras = [other for other in self.cameras if self._frames.get(other) == frame_id]
        if len(cameras) > 1:
            self._tally.note('cameras with one frame', 'the boxes of %s are all in the frame %s: they are taken for '
                             'those of cameras in one place; each camera needs a frame of its own'
                             % (' and '.join(cameras), frame_id))


def _trackers_of(tracking):
    """New trackers by name. Raises ValueError where the parameters of one of them make no sense."""
    return {name: make(*tracking[own]) for name, (make, own) in TRACKERS.items()}


def _check(params):
    if not params.target_frame:
        raise ValueError('parameter ~target_frame is empty; map or odom expected')
    for camera in params.cameras:
        if not (isinstance(camera, str) and NAMESPACE.match(camera)) or list(params.cameras).count(camera) > 1:
            raise ValueError('parameter ~cameras is %s; different namespaces expected, such as front, rear'
                             % list(params.cameras))
    if params.cameras and params.camera_frame:
        raise ValueError('parameter ~camera_frame is %r, and ~cameras are %s; one frame serves one camera only'
                         % (params.camera_frame, ', '.join(params.cameras)))
    if params.cameras and params.tracker == 'thesis':
        raise ValueError('parameter ~tracker is thesis, and ~cameras are %s; that tracker knows one camera only'
                         % ', '.join(params.cameras))
