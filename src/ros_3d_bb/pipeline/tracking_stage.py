"""Tracking stage: tracks from 3D boxes and transforms, shared by tracker_node and process_bag."""
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
from ros_3d_bb.tracking.thesis_tracker import ThesisTracker, ThesisTrackerParams
from ros_3d_bb.tracking.track import PredictionParams
from ros_3d_bb.tracking.tracker import Tracker, TrackerParams
from ros_3d_bb.tracking.types import CameraView

TRACKING_PARAMS = ThesisTrackerParams, TrackerParams, NoiseParams, PredictionParams
TRACKERS = {'thesis': (ThesisTracker, slice(0, 1)), 'kalman': (Tracker, slice(1, 4))}  # and their TRACKING_PARAMS
NAMESPACE = re.compile(r'/?[A-Za-z]\w*(/\w+)*$')


@parameters()
class TrackerNodeParams(NamedTuple):
    """Parameters of tracker_node, except those of the trackers and markers."""

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
    """A BoundingBox3DArray with the transform of its camera at the stamp.

    `camera` is the namespace of the camera, '' for a single one; `fixed_from_camera` has shape (4, 4); `jumps` counts
    the backward jumps in time before the message arrived.
    """

    message: Any
    camera: str
    fixed_from_camera: np.ndarray
    jumps: int


class TrackingResult(NamedTuple):
    """The tracks (`types.TrackedObject`) after an update; the header has the newest stamp and the fixed frame."""

    header: Header
    tracks: list


class TrackingStage(object):
    """Track 3D boxes in a fixed frame.

    If there is no transform at the stamp of the boxes, no result is returned and tracks do not age. Each message is
    passed with the namespace of its camera, '' for a single one; boxes and depth images also with their arrival time
    `now_ns` (integer nanoseconds) on a clock chosen by the caller. The methods are thread-safe.

    Parameters
    ----------
    params : TrackerNodeParams
    tracking : list
        One instance of each of `TRACKING_PARAMS`.
    events : event_counter.EventCounter
    transforms
        Its `lookup(target_frame, source_frame, stamp)` returns target_from_source (4, 4) or raises
        tf2_ros.TransformException; `go_back()` is called after a backward jump in time.

    Raises
    ------
    ValueError
        If a parameter is invalid.
    """

    def __init__(self, params, tracking, events, transforms):
        _check(params)
        self._params, self._events, self._transforms = params, events, transforms
        self._tracker = _trackers_of(tracking)[params.tracker]
        self._images_lock, self._tracks_lock = threading.Lock(), threading.Lock()
        self._clocks = CameraClocks()
        self._newest_ns = {}  # newest stamp of the tracked images, by camera
        self._jumps = 0  # number of backward jumps in time
        self._frames = {}  # by camera
        self._intrinsics = {}
        self._depths = {camera: MessageCache(int(params.depth_cache_length * NS)) for camera in self.cameras}

    @property
    def cameras(self):
        """Namespaces of the cameras."""
        return tuple(self._params.cameras) or ('',)

    def reconfigure(self, tracking):
        """Use other tracking parameters for the next boxes; tracks are kept. Raises ValueError as the constructor."""
        _trackers_of(tracking)  # validates the parameters of both trackers
        with self._tracks_lock:
            self._tracker.reconfigure(*tracking[TRACKERS[self._params.tracker][1]])

    @property
    def looks(self):
        """Whether camera_info is used, and whether depth images are used."""
        with_camera = self._params.tracker != 'thesis'  # the thesis tracker does not use the field of view
        return with_camera, with_camera and self._params.use_depth

    def add_camera_info(self, message, camera=''):
        """Add a sensor_msgs/CameraInfo. Raises ValueError if it cannot be used."""
        self._intrinsics[camera] = camera_from_msg(message)

    def add_depth(self, message, now_ns, camera=''):
        """Add a depth image. Raises ValueError if it has no stamp."""
        with self._images_lock:
            self._depths[camera].add(stamp_of(message), now_ns, message)

    def add_boxes(self, message, now_ns, camera=''):
        """Process a BoundingBox3DArray: `locate` it, then `follow` its boxes.

        Returns
        -------
        TrackingResult or None
            None if the transform is missing, or if the stamp is inconsistent with those of the other cameras.

        Raises
        ------
        ValueError
            If the message cannot be used.
        """
        located = self.locate(message, now_ns, camera)
        return None if located is None else self.follow(located)

    def locate(self, message, now_ns, camera=''):
        """Look up the pose of the camera at the stamp of a BoundingBox3DArray. The lookup may wait for tf.

        Returns
        -------
        LocatedBoxes or None
            None under the same conditions as in `add_boxes`.

        Raises
        ------
        ValueError
            If the message cannot be used.
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
            self._events.warn('no transform', 'no transform from %s to %s at %.3f: %s; tracks are kept as they are'
                              % (frame_id, self._params.target_frame, stamp_ns / NS, error))
            return None

    def follow(self, located):
        """Update the tracks with located boxes.

        Parameters
        ----------
        located : LocatedBoxes

        Returns
        -------
        TrackingResult or None
            None if time jumped back after the boxes were located.

        Raises
        ------
        ValueError
            If none of the boxes can be used.
        """
        message, camera, fixed_from_camera, jumps = located
        stamp_ns = stamp_of(message)
        if camera:
            self._check_frame(message.header.frame_id, camera)
        usable, faults = usable_boxes3d(message)
        self._events.count_dropped('3D boxes', faults)
        detections = detections_from_msg(usable, fixed_from_camera)
        with self._tracks_lock:
            if jumps != self._jumps:
                self._events.warn('images of the time before', 'boxes at %.3f are left out: time went back while their '
                                  'transform was waited for' % (stamp_ns / NS))
                return None
            if faults and not usable.boxes:  # differs from an image without people
                self._tracker.skip(stamp_ns, camera or message.header.frame_id)
                raise ValueError('none of their %d boxes can be used; tracks are kept as they are' % len(faults))
            tracks = self._tracker.update(stamp_ns, detections, self._view(stamp_ns, located))
            self._clocks.track(camera)
            self._newest_ns[camera] = max(stamp_ns, self._newest_ns.get(camera, stamp_ns))
            newest_ns = max(self._newest_ns.values())
        self._events.count('images tracked')
        return TrackingResult(Header(stamp=time_from(newest_ns), frame_id=self._params.target_frame), tracks)

    def _view(self, stamp_ns, located):
        """Return the CameraView at a stamp, with intrinsics and depth if they are known."""
        name = located.camera or located.message.header.frame_id
        camera = self._intrinsics.get(located.camera)
        if camera is None:
            return CameraView(located.fixed_from_camera, camera=name)
        with self._images_lock:
            entry = self._depths[located.camera].nearest(stamp_ns, int(self._params.stamp_tolerance * NS))
        depth_at = None
        if entry is not None:
            with self._events.rejecting('depth images'):  # the boxes are usable without depth
                depth = imgmsg_to_depth(entry.value, self._params.depth_scale)
                if depth.values.shape == (camera.height, camera.width):  # otherwise bbox3d_node reports the fault
                    depth_at = functools.partial(depths_towards, camera, depth)
        return CameraView(located.fixed_from_camera, camera, name, depth_at)

    def _is_jump_back(self, stamp_ns, now_ns, camera):
        """Whether an accepted image is a backward jump in time, and not a camera that lags behind an ended one."""
        ahead = {other: newest_ns for other, newest_ns in self._newest_ns.items() if stamp_ns < newest_ns - JUMP_NS}
        return (camera in ahead or any(self._clocks.is_tracked(other, now_ns) for other in ahead)
                or stamp_ns < max(ahead.values(), default=stamp_ns) - LONGEST_LAG_NS)

    def _go_back(self, stamp_ns):
        """Discard tracks and transforms after a backward jump in time, as when a bag is looped or rewound."""
        self._events.note('jumps back in time', 'time went back from %.3f to %.3f: tracks and transforms of the '
                          'time before are forgotten' % (max(self._newest_ns.values()) / NS, stamp_ns / NS))
        self._tracker.reset()
        self._transforms.go_back()
        self._newest_ns = {}
        self._jumps += 1

    def _leave_out(self, stamp_ns, camera, right):
        """Warn that the stamp of boxes is inconsistent with `right`, the camera whose clock is trusted."""
        newest_ns = max(self._newest_ns.values(), default=stamp_ns)
        event = 'images ahead of other cameras' if stamp_ns > newest_ns else 'images of the time before'
        self._events.warn(event, 'boxes of %s at %.3f are left out: their stamp is %.3f s from the newest one, '
                          'and %s has the right time; such boxes are tracked if that camera follows or ends'
                          % (camera, stamp_ns / NS, (stamp_ns - newest_ns) / NS, right))

    def _check_frame(self, frame_id, camera):
        """Report cameras that share a frame, because tf then places them at the same position."""
        if self._frames.get(camera) == frame_id:
            return
        self._frames[camera] = frame_id
        cameras = [other for other in self.cameras if self._frames.get(other) == frame_id]
        if len(cameras) > 1:
            self._events.note('cameras with one frame', 'the boxes of %s are all in the frame %s: they are taken for '
                              'those of cameras in one place; each camera needs a frame of its own'
                              % (' and '.join(cameras), frame_id))


def _trackers_of(tracking):
    """Create all trackers, {name: tracker}. Raises ValueError if the parameters of one of them are invalid."""
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
