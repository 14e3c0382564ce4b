"""Estimation stage: 3D boxes from 2D boxes, depth images and camera_info, shared by bbox3d_node and process_bag."""
from typing import NamedTuple

from std_msgs.msg import Header

from ros_3d_bb.camera.alignment import ALIGN, size_fault
from ros_3d_bb.camera.depth_image import DepthImage
from ros_3d_bb.conversions.camera_msgs import DEPTH_TOPIC, INFO_TOPICS
from ros_3d_bb.conversions.image_msgs import checked_depth_from
from ros_3d_bb.conversions.perception_msgs import (boxes2d_from_msg, camera_from_msg, stamp_if_any, stamp_of,
                                                   time_from)
from ros_3d_bb.core.limits import LARGEST_M
from ros_3d_bb.core.params import DEPTH_SCALE, LARGEST, STAMP_TOLERANCE, Param, parameters
from ros_3d_bb.core.time_sync import NS, StampSynchronizer
from ros_3d_bb.estimation.box3d_estimator import check_rect, estimate_boxes, estimator_named, is_plausible
from ros_3d_bb.estimation.error_model import corrected_boxes, read_error_model


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
    depth_scale: float = DEPTH_SCALE
    frame_id: str = Param('')
    cache_length: float = Param(
        1.0, 'How long depth images wait for their boxes, and boxes for their depth image. More than the detector '
        'ever takes.', 's')
    stamp_tolerance: float = STAMP_TOLERANCE
    assumed_delay: float = Param(
        0.05, 'Processing time of the detector, used where its boxes carry no stamp.', 's', live=(0, 1))
    depth_image_range: float = Param(
        6.0, 'Depth that is black in the grey image on ros_3d_bb/depth.', 'm', live=(1, 20))


class EstimatedBoxes(NamedTuple):
    """The 3D boxes (`box3d_estimator.Box3D`) of one image, its header and its depth image."""

    header: Header
    depth: DepthImage
    boxes: list


class EstimationStage(object):
    """Pair arrays of 2D boxes with the depth image and camera model of the same stamp, and estimate 3D boxes.

    Each `add_` method validates a message and passes it to the synchronizer together with its arrival time (integer
    nanoseconds, see `time_sync.StampSynchronizer`). The synchronizer calls `on_frame` with each complete frame, which
    the caller passes to `estimate`. `events` counts rejected inputs.

    Parameters
    ----------
    params : Bbox3dParams
    events : event_counter.EventCounter
    on_frame : callable
        Called with `perception_msgs.Boxes2D`, sensor_msgs/Image and `camera_model.Camera` of one stamp.
    depth_topic, info_topic : str
        Topics of the depth images and camera_info, for error messages about missing ones.

    Raises
    ------
    ValueError
        If the error model cannot be used.
    """

    def __init__(self, params, events, on_frame, depth_topic=DEPTH_TOPIC, info_topic=INFO_TOPICS[0]):
        self._events, self._depth_topic, self._info_topic = events, depth_topic, info_topic
        self._error_model = error_model_of(params)
        cache_ns, tolerance_ns = int(params.cache_length * NS), int(params.stamp_tolerance * NS)
        self._sync = StampSynchronizer(cache_ns, tolerance_ns, int(params.assumed_delay * NS), on_frame, self._on_lost)
        self._said_plain = False
        self.reconfigure(params)

    def reconfigure(self, params):
        """Use another estimator, stride or assumed delay for the next boxes.

        Raises ValueError and keeps the old parameters if the new ones are invalid.
        """
        estimator = estimator_named(params.estimator, params.stride)
        if self._error_model is not None:
            self._error_model.check_estimator(params.estimator)
        self._params, self._estimator = params, estimator
        self._sync.assumed_delay_ns = int(params.assumed_delay * NS)

    @property
    def sample(self):
        """The sampling function of the estimator, see `box3d_estimator.Estimator`."""
        return self._estimator.sample

    def add_camera_info(self, message, now_ns):
        """Add a sensor_msgs/CameraInfo. Raises ValueError if it cannot be used."""
        camera = camera_from_msg(message)
        self._sync.add_camera(stamp_if_any(message), now_ns, camera)

    def add_depth(self, message, now_ns):
        """Add a depth image. Raises ValueError if it has no stamp."""
        self._sync.add_depth(stamp_of(message), now_ns, message)

    def add_boxes(self, message, now_ns):
        """Add 2D boxes, a std_msgs/Int32MultiArray. Raises ValueError if the array is malformed."""
        boxes = boxes2d_from_msg(message)
        if boxes.stamp_ns is None and not self._said_plain:
            self._said_plain = True
            self._events.note('2D boxes without a stamp', 'the 2D boxes carry no stamp: each array is paired with the '
                              'depth image that came nearest to %.3f s before it (~assumed_delay)'
                              % self._params.assumed_delay)
        self._events.count('arrays of 2D boxes')
        self._sync.add_boxes(boxes.stamp_ns, now_ns, boxes)

    def end(self):
        """Report the boxes that still wait for their depth image. Call at the end of the input."""
        self._sync.end()

    def estimate(self, boxes2d, depth_msg, camera):
        """Estimate the 3D boxes of one image.

        A 2D box yields no 3D box if it is empty or reversed, has no depth of its own, or gives an implausible size.

        Parameters
        ----------
        boxes2d : perception_msgs.Boxes2D
        depth_msg : sensor_msgs.msg.Image
        camera : camera_model.Camera

        Returns
        -------
        EstimatedBoxes

        Raises
        ------
        ValueError
            If the depth image cannot be read, or its size differs from that of the camera.
        """
        depth = checked_depth_from(depth_msg, self._params.depth_scale)
        height, width = depth.values.shape
        if (width, height) != (camera.width, camera.height):
            raise ValueError('%s; depth must be aligned to colour: %s' % (size_fault(camera, width, height), ALIGN))
        rects_px = self._usable_rects(boxes2d)
        estimates = estimate_boxes(depth, rects_px, camera, self._estimator)
        boxes3d = self._plausible(estimates)
        counts = {'boxes lifted': len(boxes3d), 'boxes without depth': estimates.count(None)}
        if self._error_model is not None and boxes3d:
            boxes3d = corrected_boxes(boxes3d, self._error_model)
            outside_m = self._error_model.distance_outside([box.center_m for box in boxes3d])
            counts['boxes outside of the measured range'] = int((outside_m > 0).sum())
        counts['images lifted'] = 1
        self._events.count_all(counts)
        stamp = depth_msg.header.stamp if boxes2d.stamp_ns is None else time_from(boxes2d.stamp_ns)
        frame_id = self._params.frame_id or depth_msg.header.frame_id
        return EstimatedBoxes(Header(stamp=stamp, frame_id=frame_id), depth, boxes3d)

    def _usable_rects(self, boxes2d):
        """Return the rectangles (x1, y1, x2, y2), in pixels, that are neither empty nor reversed."""
        usable_px = []
        for rect_px in map(tuple, boxes2d.boxes.tolist()):
            try:
                check_rect(rect_px)
                usable_px.append(rect_px)
            except ValueError as error:
                self._events.warn('boxes rejected', '2D %s; the others in this image are used' % error)
        return usable_px

    def _plausible(self, estimates):
        """Return the 3D boxes of plausible size; None entries are removed."""
        plausible = []
        for box in estimates:
            if box is None:
                continue
            if is_plausible(box):
                plausible.append(box)
                continue
            self._events.warn('boxes of impossible size', '2D box (%d, %d, %d, %d) gives a 3D box %.3g m wide and '
                              '%.3g m high at %.3g m; less than %g m expected; the others in this image are used'
                              % (tuple(box.rect_px) + (box.size_m[0], box.size_m[1], box.center_m[2], LARGEST_M)))
        return plausible

    def _on_lost(self, boxes2d, of_time_before):
        if of_time_before:
            self._events.count('2D boxes of a time before')
            return
        with self._events.rejecting('2D boxes'):
            self._events.count('arrays without a depth image')
            raise ValueError(self._why_no_frame(boxes2d))

    def _why_no_frame(self, boxes):
        """Return an error message that names the missing input and its topic."""
        newest_ns, kept_s = self._sync.newest_ns, self._params.cache_length
        if newest_ns is None:
            return 'no depth image has come on %s' % self._depth_topic
        if not self._sync.has_camera:
            return 'no camera_info has come on %s' % self._info_topic
        if boxes.stamp_ns is None:
            return 'no depth image has come on %s within %.1f s' % (self._depth_topic, kept_s)
        late_s = (newest_ns - boxes.stamp_ns) / NS
        return ('no depth image with their stamp %.3f came on %s; the newest has %.3f, and %.1f s are kept '
                '(~cache_length)%s' % (boxes.stamp_ns / NS, self._depth_topic, newest_ns / NS, kept_s,
                                       ': the boxes are %.1f s too old; the detector is slower than that'
                                       % (late_s - kept_s) if late_s > kept_s else ''))


def error_model_of(params):
    """Read the error model named in the parameters.

    Returns None if no error model is configured. Raises ValueError if the model is unusable.
    """
    if not params.error_model:
        return None
    try:
        model = read_error_model(params.error_model)
    except OSError as error:
        raise ValueError('the error model cannot be read: %s; an absolute path expected' % error)
    model.check_estimator(params.estimator)
    return model
