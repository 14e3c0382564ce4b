"""Estimation stage: 3D boxes from 2D boxes, depth images and camera_info, shared by bbox3d_node and process_bag."""
import functools
from typing import NamedTuple

import numpy as np
import tf2_ros
from std_msgs.msg import Header

from ros_3d_bb.camera.alignment import ALIGN, size_fault
from ros_3d_bb.camera.image_rotation import (turned_boxes, turned_camera, turned_depth, turned_rotation, turns_for,
                                             unturned_boxes)
from ros_3d_bb.conversions.camera_msgs import DEPTH_TOPICS, INFO_TOPICS
from ros_3d_bb.conversions.image_msgs import imgmsg_to_depth
from ros_3d_bb.conversions.perception_msgs import (NEWEST, boxes2d_from_msg, camera_from_msg, stamp_if_any,
                                                   stamp_of, time_from)
from ros_3d_bb.core.limits import LARGEST_M
from ros_3d_bb.core.object_classes import read_object_classes
from ros_3d_bb.core.params import (CLASSES_FILE, DEPTH, DEPTH_SCALE, IMAGE_ROTATION, LARGEST, STAMP_TOLERANCE, Param,
                                   parameters)
from ros_3d_bb.core.time_sync import NS, StampSynchronizer
from ros_3d_bb.estimation.box3d import LEVEL
from ros_3d_bb.estimation.box3d_estimator import check_rect, estimate_boxes, estimator_named, level_rotation
from ros_3d_bb.estimation.error_model import corrected_boxes, error_model_of_param
from ros_3d_bb.estimation.scale_check import ScaleCheck
from ros_3d_bb.pipeline.depth_registration import RAW, DepthRegistration

UNSTAMPED = '2D boxes without a stamp'  # event, reported once
TILT_UNKNOWN = 'tilt of the camera unknown'


@parameters()
class Bbox3dParams(NamedTuple):
    """Parameters of bbox3d_node."""

    estimator: str = Param(
        'foreground', 'How a position is estimated from the depth in a box. foreground: from the nearest layer of '
        'depth that is large enough to be the person, whatever is behind them. median: as in the thesis, the median '
        'of the sampled points along each axis, background included.', choices=('foreground', 'median'), live=True)
    stride: int = Param(
        20, 'Distance between the depth samples of the estimator median; 20 in the thesis.', 'pixels',
        limits=(1, LARGEST), live=(1, 100))
    error_model: str = Param('')
    depth: str = DEPTH
    depth_scale: float = DEPTH_SCALE
    frame_id: str = Param('')
    cache_length: float = Param(
        1.0, 'How long depth images wait for their boxes, and boxes for their depth image. More than the detector '
        'ever takes.', 's')
    stamp_tolerance: float = STAMP_TOLERANCE
    floor_frame: str = Param('base_link')
    image_rotation: str = IMAGE_ROTATION
    classes_file: str = CLASSES_FILE
    assumed_delay: float = Param(
        0.05, 'Processing time of the detector, used where its boxes have no stamp.', 's', live=(0, 1))
    depth_image_range: float = Param(
        6.0, 'Depth that is black in the grey image on ros_3d_bb/depth.', 'm', live=(1, 20))


class EstimationStage(object):
    """Pair arrays of 2D boxes with the depth image and camera model of the same stamp, and estimate 3D boxes.

    Each `add_` method validates a message, raising ValueError, and passes it to the synchronizer together with its
    arrival time (integer nanoseconds, see `time_sync.StampSynchronizer`). The synchronizer calls `on_frame` with each
    complete frame, which the caller passes to `estimate`. `events` counts rejected inputs.

    Parameters
    ----------
    params : Bbox3dParams
    events : event_counter.EventCounter
    on_frame : callable
        Called with `perception_msgs.Boxes2D`, sensor_msgs/Image and `camera_model.Camera` of one stamp.
    transforms
        As for `tracking_stage.TrackingStage`, for the tilt of the camera and raw depth; None if neither is used.
    topics : sequence of str, optional
        Topics of the depth images, their camera_info and that of colour, for error messages about missing ones.
    """

    def __init__(self, params, events, on_frame, transforms=None, topics=DEPTH_TOPICS['aligned'] + INFO_TOPICS[:1]):
        self._events = events
        self._depth_topic, depth_info_topic, self._info_topic = topics
        self._transforms = transforms if params.floor_frame else None
        self._registration = DepthRegistration(transforms, depth_info_topic) if params.depth == RAW else None
        self._color_frame, self._scale_check = '', ScaleCheck()
        self._classes = read_object_classes(params.classes_file)
        self._error_model = error_model_of_param(params.error_model)
        cache_ns, tolerance_ns = int(params.cache_length * NS), int(params.stamp_tolerance * NS)
        self._sync = StampSynchronizer(cache_ns, tolerance_ns, int(params.assumed_delay * NS), on_frame, self._on_lost)
        self.reconfigure(params)

    def reconfigure(self, params):
        """Use another estimator, stride or assumed delay for the next boxes.

        Raises ValueError, as the constructor, and keeps the old parameters if the new ones are invalid.
        """
        estimator = estimator_named(params.estimator, params.stride, self._classes)
        if self._error_model is not None:
            self._error_model.check_estimator(params.estimator)
        self._params, self._estimator = params, estimator
        self._sync.assumed_delay_ns = int(params.assumed_delay * NS)

    @property
    def sample(self):
        """The sampling function of the estimator, see `box3d_estimator.Estimator`."""
        return self._estimator.sample

    def add_camera_info(self, message, now_ns):
        """Add a sensor_msgs/CameraInfo of the colour camera."""
        camera = camera_from_msg(message)
        self._color_frame = message.header.frame_id
        self._sync.add_camera(stamp_if_any(message), now_ns, camera)

    def add_depth_camera_info(self, message):
        """Add a sensor_msgs/CameraInfo of the depth camera, for raw depth."""
        self._registration.add_camera_info(message)

    def add_depth(self, message, now_ns):
        """Add a depth image."""
        self._sync.add_depth(stamp_of(message), now_ns, message)

    def add_boxes(self, message, now_ns):
        """Add 2D boxes, a std_msgs/Int32MultiArray."""
        boxes = boxes2d_from_msg(message)
        if boxes.stamp_ns is None and UNSTAMPED not in self._events.counts:
            self._events.note(UNSTAMPED, 'the 2D boxes have no stamp: each array is paired with the depth image that '
                              'arrived nearest to %.3f s before it (~assumed_delay)' % self._params.assumed_delay)
        self._events.count('arrays of 2D boxes')
        self._sync.add_boxes(boxes.stamp_ns, now_ns, boxes)

    def end(self):
        """Report the boxes that still wait for their depth image. Call at the end of the input."""
        self._sync.end()

    def estimate(self, boxes2d, depth_msg, camera):
        """Estimate the 3D boxes of one image, whose parts are those that `on_frame` was called with.

        A 2D box yields no 3D box if it is empty or reversed, has no depth of its own, or gives an implausible size.
        Returns the header, the DepthImage (RegisteredDepth of raw depth) and a list of Box3D. Raises ValueError if the
        depth image cannot be read, its size differs from that of the camera, or it cannot be registered.
        """
        raw = imgmsg_to_depth(depth_msg, self._params.depth_scale, check_unit=True)
        depth, frame_id = self._aligned(raw, depth_msg.header.frame_id, camera)
        stamp = depth_msg.header.stamp if boxes2d.stamp_ns is None else time_from(boxes2d.stamp_ns)
        gap_s = abs((stamp - depth_msg.header.stamp).to_sec())
        usable = self._usable_boxes(boxes2d)
        turns, level_from_camera = _orientation(self._params.image_rotation, self._up(frame_id))
        upright_rects_px = turned_boxes(usable.boxes, turns, camera.width, camera.height).tolist()
        estimates = estimate_boxes(turned_depth(depth, turns), list(map(tuple, upright_rects_px)),
                                   turned_camera(camera, turns), self._estimator, level_from_camera,
                                   usable.labels)
        found = [box._replace(score=score) for box, score in zip(estimates, usable.scores.tolist())
                 if box is not None]
        boxes3d = [box for box in found if box.is_plausible]
        implausible = [box for box in found if not box.is_plausible] if len(boxes3d) < len(found) else []
        for box in _as_received(implausible, turns, camera):
            self._events.warn('boxes of impossible size', '2D box (%d, %d, %d, %d) gives a 3D box %.3g m wide and '
                              '%.3g m high at %.3g m; less than %g m expected; the others in this image are used'
                              % (box.rect_px + (box.size_m[0], box.size_m[1], box.center_m[2], LARGEST_M)))
        self._check_scale(found, raw.scale_m)
        counts = {'boxes estimated': len(boxes3d),
                  'boxes without depth': len(estimates) - len(found)}
        boxes3d = corrected_boxes(boxes3d, self._error_model, gap_s)
        if self._error_model is not None and boxes3d:
            outside = [box for box in boxes3d if self._error_model.distance_outside(box.center_m[0], box.center_m[2])]
            counts['boxes outside of the measured range'] = len(outside)
        counts['images estimated'] = 1
        self._events.count_all(counts)

        return Header(stamp=stamp, frame_id=frame_id), depth, _as_received(boxes3d, turns, camera)

    def _aligned(self, depth, depth_frame, camera):
        """Return a depth image with the pixels of colour, and the frame of the colour camera."""
        if self._registration is not None:
            frame_id = self._params.frame_id or self._color_frame
            return self._registration.register(depth, depth_frame, camera, frame_id), frame_id
        height, width = depth.shape
        if (width, height) != (camera.width, camera.height):
            raise ValueError('%s; depth must be aligned to colour: %s' % (size_fault(camera, width, height), ALIGN))
        return depth, self._params.frame_id or depth_frame

    def _check_scale(self, boxes3d, scale_m):
        """Warn if people have impossible heights, with the scale that makes them possible."""
        factor = self._scale_check.factor(boxes3d)
        if factor is not None:
            self._events.warn('depth of a wrong scale', 'people of impossible height: depth must be multiplied by %g; '
                              'set ~depth_scale: %g (now %g); positions and sizes are wrong until then'
                              % (factor, factor * scale_m, scale_m))

    def _up(self, frame_id):
        """Return the unit vector that points up in the optical frame, as a tuple; None if tf does not contain it.

        The latest transform is used: the camera is fixed to the robot, so no wait for the image stamp is necessary.
        """
        if self._transforms is None:
            return None
        try:
            camera_from_floor = self._transforms.lookup(frame_id, self._params.floor_frame, NEWEST)
        except tf2_ros.TransformException as error:
            if TILT_UNKNOWN not in self._events.counts:
                self._events.note(TILT_UNKNOWN, 'the tilt of the camera is unknown, as there is no transform from '
                                  '%s to %s: %s; it is assumed to be level (~floor_frame)'
                                  % (self._params.floor_frame, frame_id, error))
            return None
        return tuple(camera_from_floor[:3, 2].tolist())

    def _usable_boxes(self, boxes2d):
        """Return the Boxes2D whose rectangles are neither empty nor reversed."""
        usable = []
        for number, rect_px in enumerate(boxes2d.boxes.tolist()):
            try:
                check_rect(rect_px)
                usable.append(number)
            except ValueError as error:
                self._events.warn('boxes rejected', '2D %s; the others in this image are used' % error)
        return boxes2d._replace(boxes=boxes2d.boxes[usable], labels=[boxes2d.labels[number] for number in usable],
                                scores=boxes2d.scores[usable])

    def _on_lost(self, boxes2d, before_jump):
        if before_jump:
            self._events.count('2D boxes from before a time jump')
            return
        with self._events.rejecting('2D boxes'):
            self._events.count('arrays without a depth image')
            raise ValueError(self._why_no_frame(boxes2d.stamp_ns))

    def _why_no_frame(self, stamp_ns):
        """Return an error message that names the missing input and its topic."""
        newest_ns, kept_s = self._sync.newest_ns, self._params.cache_length
        if newest_ns is None:
            return 'no depth image received on %s' % self._depth_topic
        if not self._sync.has_camera:
            return 'no camera_info received on %s' % self._info_topic
        if stamp_ns is None:
            return 'no depth image received on %s within %.1f s' % (self._depth_topic, kept_s)
        too_old_s = (newest_ns - stamp_ns) / NS - kept_s
        if too_old_s > 0:
            return ('no depth image with their stamp %.3f received on %s; the newest has %.3f, and %.1f s are kept '
                    '(~cache_length): the detector is %.1f s slower than that'
                    % (stamp_ns / NS, self._depth_topic, newest_ns / NS, kept_s, too_old_s))
        return ('no depth image with their stamp %.3f received on %s: %s'
                % (stamp_ns / NS, self._depth_topic, self._sync.gap_text(stamp_ns)))


@functools.lru_cache(maxsize=16)  # a camera that is fixed to the robot has the same tilt in each image
def _orientation(image_rotation, up):
    """Return the quarter turns that make the image upright, and the rotation from the frame of the upright image to the
    level frame (`box3d_estimator.level_rotation`); `LEVEL` if the tilt is unknown (`up` is None).
    """
    turns = turns_for(image_rotation, up)
    return turns, LEVEL if up is None else level_rotation(turned_rotation(turns).dot(up))


def _as_received(boxes3d, turns, camera):
    """Convert Box3Ds in the frame of the upright image to that of the image as received, `turns` before."""
    if not turns:
        return boxes3d
    camera_from_turned, converted = turned_rotation(turns).T, []
    for box in boxes3d:
        (rect_px,) = unturned_boxes(np.array([box.rect_px]), turns, camera.width, camera.height).tolist()
        width_m, height_m, _width_m = box.size_m
        size_m = box.size_m if turns == 2 else np.array([height_m, width_m, width_m])
        covariance_m2 = None
        if box.covariance_m2 is not None:
            covariance_m2 = camera_from_turned.dot(box.covariance_m2).dot(camera_from_turned.T)
        edges = box.truncated_edges[turns:] + box.truncated_edges[:turns]
        converted.append(box._replace(center_m=camera_from_turned.dot(box.center_m), size_m=size_m,
                                      rect_px=tuple(rect_px), truncated_edges=edges, covariance_m2=covariance_m2))
    return converted
