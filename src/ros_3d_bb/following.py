"""From 3D boxes and transforms to tracks: what tracker_node and process_bag do with messages."""
import functools
import threading
from typing import NamedTuple

import tf2_ros
from std_msgs.msg import Header

from ros_3d_bb.images import depth_from
from ros_3d_bb.messages import camera_from_message, detections_from_message, stamp_of, time_from
from ros_3d_bb.params import check_not_negative, nearest_name
from ros_3d_bb.stamped import NS, StampedCache
from ros_3d_bb.tracking.measuring import NoiseParams
from ros_3d_bb.tracking.prediction import PredictionParams
from ros_3d_bb.tracking.thesis import ThesisTracker, ThesisTrackerParams
from ros_3d_bb.tracking.tracked import View
from ros_3d_bb.tracking.tracker import Tracker, TrackerParams
from ros_3d_bb.tracking.visibility import depths_towards, edges_of

TRACKING_PARAMS = ThesisTrackerParams, TrackerParams, NoiseParams, PredictionParams
TRACKERS = {'thesis': (ThesisTracker, slice(0, 1)), 'kalman': (Tracker, slice(1, 4))}  # with their part of those
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


class Followed(NamedTuple):
    """The tracks (`tracked.TrackedObject`) after one image; the header has the newest stamp and the fixed frame."""

    header: Header
    tracks: list


class Follower(object):
    """Follow 3D boxes in a fixed frame. Without a transform at their stamp there is no answer and nobody ages.

    Depth images and camera_info are those of one camera, that of the boxes.

    Parameters
    ----------
    params : TrackerNodeParams
    tracking : list
        One instance of each of `TRACKING_PARAMS`.
    tally : tally.Tally
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
        self._camera_lock = threading.Lock()  # images come while a transform is waited for
        self._newest_ns = None  # of the images that were taken
        self._camera, self._depths = None, StampedCache(int(params.depth_cache_length * NS))

    def tune(self, tracking):
        """Take the next boxes with other parameters of tracking; tracks go on. Raises ValueError as at the start."""
        _trackers_of(tracking)  # also what the other one would refuse is refused
        self._tracker.tune(*tracking[TRACKERS[self._params.tracker][1]])

    @property
    def looks(self):
        """Whether camera_info is of use, and depth images."""
        with_camera = self._params.tracker != 'thesis'  # which does not ask where the camera looks
        return with_camera, with_camera and self._params.use_depth

    def add_camera_info(self, message):
        """Take a sensor_msgs/CameraInfo. Raises ValueError where it cannot be used."""
        self._camera = camera_from_message(message)

    def add_depth(self, message, now_ns):
        """Take a depth image. Raises ValueError where it carries no stamp."""
        with self._camera_lock:
            self._depths.add(stamp_of(message), now_ns, message)

    def add_boxes(self, message):
        """Take a BoundingBox3DArray.

        Returns
        -------
        Followed or None
            None where there is no transform for it.

        Raises
        ------
        ValueError
            If it cannot be used.
        """
        stamp_ns = stamp_of(message)
        self._follow_time(stamp_ns)
        tracks = self._track(stamp_ns, message)
        if tracks is None:
            return None
        self._newest_ns = stamp_ns if self._newest_ns is None else max(stamp_ns, self._newest_ns)
        self._tally.count('images tracked')
        return Followed(Header(stamp=time_from(self._newest_ns), frame_id=self._params.target_frame), tracks)

    def _track(self, stamp_ns, message):
        """The tracks after one array of boxes; None where there is no transform for it."""
        camera_frame = self._params.camera_frame or message.header.frame_id
        try:
            fixed_from_camera = self._transforms.lookup(self._params.target_frame, camera_frame, message.header.stamp)
        except tf2_ros.TransformException as error:
            self._tracker.skip(stamp_ns)
            self._tally.warn('no transform', 'no transform from %s to %s at %.3f: %s; tracks are kept as they are'
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
            with self._tally.refusing('depth images'):  # the boxes are good without
                depth = depth_from(entry.value, self._params.depth_scale)
                if depth.values.shape == (camera.height, camera.width):  # bbox3d_node says what is wrong with others
                    depth_at = functools.partial(depths_towards, camera, depth)
        return View(fixed_from_camera, edges_of(camera), frame_id, depth_at)

    def _follow_time(self, stamp_ns):
        """Forget tracks and transforms where the stamps went back: a bag looped, or somebody sought in it."""
        if self._newest_ns is not None and stamp_ns < self._newest_ns - JUMP_NS:
            self._tally.note('jumps back in time', 'time went back from %.3f to %.3f: tracks and transforms of the '
                             'time before are forgotten' % (self._newest_ns / NS, stamp_ns / NS))
            self._tracker.reset()
            self._transforms.go_back()
            self._newest_ns = None


def _trackers_of(tracking):
    """New trackers by name. Raises ValueError where the parameters of one of them make no sense."""
    return {name: make(*tracking[own]) for name, (make, own) in TRACKERS.items()}


def _check(params):
    if params.tracker not in TRACKERS:
        raise ValueError('parameter ~tracker is %r; did you mean %s? Known: %s'
                         % (params.tracker, nearest_name(params.tracker, sorted(TRACKERS)),
                            ', '.join(sorted(TRACKERS))))
    if not params.target_frame:
        raise ValueError('parameter ~target_frame is empty; map or odom expected')
    check_not_negative(params, 'tf_timeout', 'depth_scale', 'depth_cache_length', 'stamp_tolerance')
