"""Tracking stage: tracks from 3D boxes and transforms, shared by tracker_node and process_bag."""
import collections
import re
import threading
from typing import Any, Callable, Deque, Dict, List, NamedTuple, Optional, Tuple

import numpy as np
import tf2_ros
from nav_msgs.msg import OccupancyGrid
from std_msgs.msg import Header

from ros_3d_bb.camera.alignment import POSE, target_frame_fault, viewing_fault
from ros_3d_bb.conversions.perception_msgs import stamp_of, time_from, usable_boxes3d
from ros_3d_bb.core.detector_model import DetectorModel
from ros_3d_bb.core.event_counter import EventCounter
from ros_3d_bb.core.object_classes import read_object_classes
from ros_3d_bb.core.params import (CLASSES_FILE, DEPTH, DEPTH_SCALE, SET_BY_LAUNCH, STAMP_TOLERANCE, NestedList, Param,
                                   parameters)
from ros_3d_bb.core.time_sync import JITTER, NS, CameraClocks, median_period_ns
from ros_3d_bb.estimation.error_model import error_model_of_param
from ros_3d_bb.pipeline.camera_views import CameraViews
from ros_3d_bb.pipeline.ignored_places import IgnoredPlaces, areas_of
from ros_3d_bb.pipeline.tracking_frame import AUTO, ImagePose, TrackingFrame, transformed
from ros_3d_bb.pipeline.transform_buffer import TransformBuffer
from ros_3d_bb.tracking.manoeuvres import LONGEST_NS
from ros_3d_bb.tracking.measurement_model import NoiseParams
from ros_3d_bb.tracking.prediction import PredictionParams
from ros_3d_bb.tracking.tracker import Tracker, TrackerParams
from ros_3d_bb.tracking.types import TrackedObject, detections_from_boxes

TRACKING_PARAMS = TrackerParams, NoiseParams, PredictionParams
TrackingParams = Tuple[TrackerParams, NoiseParams, PredictionParams]
AHEAD, BEHIND = 'images ahead of other cameras', 'images behind other cameras'  # counters
CONTRADICTION = 'cameras that contradict each other'  # event, reported once
TOO_SLOW = 'rate of images too low'  # event, reported once
RECENT = 5  # images whose median period counts, so that a single gap does not; chosen
NAMESPACE = re.compile(r'/?[A-Za-z]\w*(/\w+)*$')
PLACES = 'where no track starts'  # section of the parameters
SHOWN_RANGE_M = 6.0  # of the field of view, as shown; that of the depth detector


@parameters()
class TrackerNodeParams(NamedTuple):
    """Parameters of tracker_node, except those of the tracker and markers."""

    target_frame: str = Param('map')
    tracking_frame: str = Param(
        AUTO, 'Frame in which people are tracked. In target_frame, people seem to jump with each correction of the '
        'localisation; in an odometry frame, they do not (REP 105). auto: the frame whose name begins with odom, such '
        'as odom or robot1/odom, if it is between the camera and target_frame in tf; otherwise target_frame.')
    error_model: str = Param('')
    cameras: list = Param(())
    camera_frame: str = Param('')
    use_depth: bool = Param(True, 'Whether depth images are used to find out that a person is occluded.')
    depth: str = DEPTH
    depth_scale: float = DEPTH_SCALE
    depth_cache_length: float = Param(1.0, 'How long depth images are kept for the boxes of the same stamp.', 's')
    stamp_tolerance: float = STAMP_TOLERANCE
    classes_file: str = CLASSES_FILE
    tf_timeout: float = Param(0.2, 'How long to wait for the transform at the stamp of the boxes.', 's')
    camera_timeout: float = Param(
        1.0, 'With several cameras, no tracks are published while there are no boxes of one of them for this time, so '
        'that planners stop. Detectors must publish empty arrays, too (publish_empty). 0: the tracks of the other '
        'cameras are published, and planners drive on as if the silent one saw no people.', 's')
    ignored_areas: NestedList = Param(
        '', 'Polygons of target_frame in which no track starts, as around mirrors and posters: a list of lists of '
        'corners, such as [[[1, 2], [3, 2], [3, 4]]]; empty: none. People who walk into an area stay tracked. Tracks '
        'in an area end when it is set.', 'm', live=True, section=PLACES)
    map_depth: float = Param(
        0.3, 'With a map, no track starts in occupied cells and up to this distance behind them, as seen by the '
        'camera.', 'm', limits=(0, 2), live=(0, 1), section=PLACES)
    use_map: bool = Param(False, 'Whether no track starts in occupied cells of the static map.', section=SET_BY_LAUNCH)


class TrackingStage(object):
    """Track 3D boxes in the frame of a `tracking_frame.TrackingFrame`, and convert the tracks to ~target_frame.

    If there is no transform at the stamp of the boxes, there is no result and tracks do not age. The name of a camera
    is its namespace, '' for a single one. Boxes and depth images are passed with their arrival time `now_ns` (integer
    nanoseconds) on a clock chosen by the caller. The methods are thread-safe. The constructor and `reconfigure` raise
    ValueError if a parameter is invalid.

    `on_tracks` is called with the tracks after each image and their header, which has the newest stamp and the target
    frame; `lock` is held meanwhile. The IDs of tracks are greater than `last_id`. Attributes:
    `views` of each camera, by its name, the `ignored` places, and `lock`.
    """

    def __init__(self, params: TrackerNodeParams, tracking: TrackingParams, events: EventCounter,
                 transforms: TransformBuffer, on_tracks: Callable[[List[TrackedObject], Header], Any],
                 last_id: int = 0) -> None:
        _check(params)
        params = params._replace(target_frame=params.target_frame.lstrip('/'))  # tf2 rejects frames with a slash
        self._params, self._events, self._on_tracks = params, events, on_tracks
        self.views = {name: CameraViews(params, events, transforms, name) for name in params.cameras or ('',)}
        self._classes = read_object_classes(params.classes_file)
        model = error_model_of_param(params.error_model)
        self._tracker = Tracker(*tracking, last_id=last_id, classes=self._classes,
                                detector=model.detector if model else DetectorModel())
        self.lock = threading.RLock()
        self._clocks = CameraClocks()
        self._jumps = 0  # number of backward jumps in time
        self._boxes_ns: Dict[str, int] = {}  # newest stamp of tracked boxes, by camera
        self._recent_ns: Dict[str, Deque[int]] = {  # stamps of boxes
            name: collections.deque(maxlen=RECENT) for name in self.views}
        self._frames: Dict[str, str] = {}  # by camera
        self._frame = TrackingFrame(transforms, params.tracking_frame, params.target_frame)
        self.ignored = IgnoredPlaces(params, events)
        self._poses: Dict[str, ImagePose] = {}  # latest one, by camera
        self._newest_pose: Optional[ImagePose] = None

    def reconfigure(self, params: TrackerNodeParams, tracking: TrackingParams) -> None:
        """Use other tracking parameters and ignored areas for the next boxes; tracks are kept, except those in other
        areas than before. Raises ValueError as the constructor, without any change."""
        areas = areas_of(params)
        with self.lock:
            self._tracker.reconfigure(*tracking)
            if self.ignored.use(areas):
                self._end_ignored()

    @property
    def views_m(self) -> List[np.ndarray]:
        """Outlines, arrays (3, 2) in the target frame, of the fields of view of the cameras."""
        outlines_m = (self.views[name].outline_m(pose.target_from_camera, SHOWN_RANGE_M)
                      for name, pose in sorted(self._poses.items()))
        return [outline_m for outline_m in outlines_m if outline_m is not None]

    def set_map(self, message: OccupancyGrid) -> None:
        """Start no tracks in the occupied cells of a nav_msgs/OccupancyGrid. With the first one, those there end.

        Raises ValueError if it is in another frame than the published tracks.
        """
        cells = self.ignored.cells_of(message)
        with self.lock:
            if self.ignored.use_map(cells):
                self._end_ignored()

    def _end_ignored(self) -> None:
        if self._newest_pose is not None:
            self._tracker.delete_at(self.ignored.seen_from(self._poses.values(), self._newest_pose))

    def add_boxes(self, message: Any, now_ns: int, camera_name: str = '') -> None:
        """Process a BoundingBox3DArray: `on_tracks` is called unless the transform is missing, or the stamp is
        inconsistent with those of the other cameras. Raises ValueError if the message or each of its boxes is invalid,
        or the boxes are in the fixed frame.
        """
        stamp_ns, target_frame = stamp_of(message), self._params.target_frame
        frame_id = self._params.camera_frame or message.header.frame_id
        if not frame_id:
            raise ValueError('their images have no frame_id; set ~frame_id to the optical frame of the camera')
        if frame_id.lstrip('/') == target_frame:
            raise ValueError('%s (~target_frame); %s' % (target_frame_fault(target_frame, frame_id), POSE))
        with self.lock:
            if not self._accept(stamp_ns, now_ns, camera_name):
                return
            jumps = self._jumps
        try:  # not under the lock: waiting for the transform of one camera must not delay the others
            pose = self._frame.pose(frame_id, message.header.stamp)
        except tf2_ros.TransformException as error:
            self._events.warn('no transform', 'no transform from %s to %s at %.3f: %s; tracks are kept as they are'
                              % (frame_id, target_frame, stamp_ns / NS, error))
            with self.lock:
                if jumps == self._jumps:
                    self._tracker.skip(stamp_ns, camera_name)
            return
        with self.lock:
            if jumps == self._jumps:
                self._track(message, stamp_ns, pose, camera_name)
            else:
                self._events.warn(BEHIND, 'boxes at %.3f are dropped: time jumped back while their transform was '
                                  'awaited' % (stamp_ns / NS))

    def _track(self, message: Any, stamp_ns: int, pose: ImagePose, camera_name: str) -> None:
        fault = viewing_fault(self._params.camera_frame or message.header.frame_id, pose.target_from_camera)
        if fault:
            self._tracker.skip(stamp_ns, camera_name)
            raise ValueError('%s; set ~frame_id to the optical frame, or correct its transform' % fault)
        boxes, faults = usable_boxes3d(message)
        if faults:
            self._events.count_dropped('3D boxes', faults)
        if faults and not boxes:  # differs from an image without people
            self._tracker.skip(stamp_ns, camera_name)
            raise ValueError('none of their %d boxes is valid; tracks are kept as they are' % len(faults))
        if camera_name:
            self._check_frame(message.header.frame_id, camera_name)
        untracked_boxes = self._tracker.untracked_boxes
        detections = detections_from_boxes(boxes, pose.tracking_from_camera, self._classes)
        view = self.views[camera_name].view(message.header, pose.tracking_from_camera)
        tracks = self._tracker.update(stamp_ns, self.ignored.marked(detections, pose), view)
        self._events.count('images tracked')
        untracked_boxes = self._tracker.untracked_boxes - untracked_boxes
        if untracked_boxes > 0:
            self._events.count('3D boxes that became no track', untracked_boxes)
        if len(self.views) > 1 and CONTRADICTION not in self._events.counts:
            contradicting = self._tracker.contradicting_cameras
            if contradicting:
                self._events.warn(CONTRADICTION, '%s and %s each detect another one of two tracks nearby, as if they '
                                  'showed one person in two places: check the poses of these cameras in tf'
                                  % contradicting)
        newest_ns = self._clocks.track(stamp_ns, camera_name)
        self._boxes_ns[camera_name], self._poses[camera_name] = stamp_ns, pose
        if stamp_ns == newest_ns or self._newest_pose is None:
            self._newest_pose = pose
        self._check_rate(stamp_ns, camera_name)
        silent = self._silent_cameras(newest_ns)
        if silent:
            self._events.warn('tracks withheld', 'no boxes of %s were tracked within the last %g s (~camera_timeout): '
                              'no tracks are published, so that planners stop'
                              % (', '.join(silent), self._params.camera_timeout))
            return
        self._on_tracks(transformed(tracks, self._newest_pose.target_from_tracking),
                        Header(stamp=time_from(newest_ns), frame_id=self._params.target_frame))

    def _check_rate(self, stamp_ns: int, camera_name: str) -> None:
        """Report images so far apart that the tracker assigns no boxes of people who move."""
        recent_ns = self._recent_ns[camera_name]
        recent_ns.append(stamp_ns)
        period_ns = median_period_ns(list(recent_ns))
        if len(recent_ns) == RECENT and (1 + JITTER) * period_ns > LONGEST_NS and TOO_SLOW not in self._events.counts:
            self._events.warn(TOO_SLOW, '3D boxes arrive every %.2f s; less than %g s expected, or walking people are '
                              'not tracked; choose a faster detector' % (period_ns / NS, LONGEST_NS / NS))

    def _silent_cameras(self, newest_ns: int) -> List[str]:
        timeout_s = self._params.camera_timeout or float('inf')
        return [name for name in self.views if newest_ns - self._boxes_ns.get(name, float('-inf')) > timeout_s * NS]

    def _accept(self, stamp_ns: int, now_ns: int, camera_name: str) -> bool:
        """Whether the stamp of boxes is consistent with those of the other cameras. Handles backward jumps in time, as
        when a bag is looped or rewound: tracks are discarded."""
        trusted = self._clocks.accept(stamp_ns, now_ns, camera_name)
        newest_ns = self._clocks.newest_ns or stamp_ns
        if trusted is not None:
            self._events.warn(AHEAD if stamp_ns > newest_ns else BEHIND, 'boxes of %s at %.3f are dropped: their stamp '
                              'is %.3f s from the newest one, and %s has the correct time; they are tracked once that '
                              'camera agrees or ends'
                              % (camera_name, stamp_ns / NS, (stamp_ns - newest_ns) / NS, trusted))
        elif self._clocks.is_jump_back(stamp_ns, now_ns, camera_name):
            self._events.note('jumps back in time', 'time jumped back from %.3f to %.3f: earlier tracks are discarded'
                              % (newest_ns / NS, stamp_ns / NS))
            self._tracker.reset()
            self._clocks.restart()
            self._boxes_ns.clear()
            self._jumps += 1
        return trusted is None

    def _check_frame(self, frame_id: str, camera_name: str) -> None:
        """Report cameras that share a frame, because tf then gives them the same position."""
        if self._frames.get(camera_name) == frame_id:
            return
        self._frames[camera_name] = frame_id
        sharing = [name for name in self.views if self._frames.get(name) == frame_id]
        if len(sharing) > 1:
            self._events.note('cameras sharing a frame', 'the boxes of %s are all in the frame %s and are tracked as '
                              'if the cameras had the same pose; each camera needs its own frame'
                              % (' and '.join(sharing), frame_id))


def _check(params: TrackerNodeParams) -> None:
    if not params.target_frame:
        raise ValueError('parameter ~target_frame is empty; map or odom expected')
    fault = target_frame_fault(params.target_frame, params.camera_frame)
    if fault:
        raise ValueError('parameter ~target_frame: %s; %s' % (fault, POSE))
    for name in params.cameras:
        if not (isinstance(name, str) and NAMESPACE.match(name)) or list(params.cameras).count(name) > 1:
            raise ValueError('parameter ~cameras is %s; different namespaces expected, such as front, rear'
                             % list(params.cameras))
    if params.cameras and params.camera_frame:
        raise ValueError('parameter ~camera_frame is %r, and ~cameras are %s; expected with a single camera only'
                         % (params.camera_frame, ', '.join(params.cameras)))
