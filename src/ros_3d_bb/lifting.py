"""From 2D boxes, depth images and camera_info to 3D boxes: what bbox3d_node and process_bag do with messages."""
from typing import NamedTuple

from std_msgs.msg import Header

from ros_3d_bb.camera_messages import DEPTH_TOPIC, INFO_TOPICS
from ros_3d_bb.diagnosis.camera_faults import ALIGN, size_fault, units_fault
from ros_3d_bb.error_model import corrected_boxes, read_error_model
from ros_3d_bb.estimation import DepthImage, check_rect, estimate_boxes, estimator_named, is_plausible
from ros_3d_bb.geometry import Camera
from ros_3d_bb.images import depth_from
from ros_3d_bb.messages import boxes2d_from_message, camera_from_message, stamp_if_any, stamp_of, time_from
from ros_3d_bb.params import DEPTH_SCALE, LARGEST, STAMP_TOLERANCE, Param, parameters
from ros_3d_bb.stamped import NS, Pairing
from ros_3d_bb.tracking.tracked import LARGEST_M


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


class Lifted(NamedTuple):
    """The 3D boxes (`estimation.Box3D`) of one image, its header, its depth image and its camera."""

    header: Header
    depth: DepthImage
    camera: Camera
    boxes: list


class Lifter(object):
    """Lift arrays of 2D boxes into the camera's optical frame, each with the depth image of its own stamp.

    Each `add_` takes a message and when it arrived (integer nanoseconds, see `stamped.Pairing`), and returns what it
    settled, a list of Lifted. What is refused goes to the tally.

    Parameters
    ----------
    params : Bbox3dParams
    tally : tally.Tally
    depth_topic, info_topic : str
        Where depth images and camera_info come from, for sentences about those that do not.

    Raises
    ------
    ValueError
        If the error model cannot be used.
    """

    def __init__(self, params, tally, depth_topic=DEPTH_TOPIC, info_topic=INFO_TOPICS[0]):
        self._tally, self._depth_topic, self._info_topic = tally, depth_topic, info_topic
        self._error_model = error_model_of(params)
        self._pairing = Pairing(*(int(seconds * NS) for seconds in (
            params.cache_length, params.stamp_tolerance, params.assumed_delay)))
        self._said_plain = False
        self.tune(params)

    def tune(self, params):
        """Lift the next boxes with another estimator, stride or assumed delay.

        Raises ValueError, and keeps the old ones, where they make no sense.
        """
        estimator = estimator_named(params.estimator, params.stride)
        if self._error_model is not None:
            self._error_model.check_estimator(params.estimator)
        self._params, self._estimator = params, estimator
        self._pairing.assumed_delay_ns = int(params.assumed_delay * NS)

    @property
    def sample(self):
        """See `estimation.Estimator`."""
        return self._estimator.sample

    def add_camera_info(self, message, now_ns):
        """Take a sensor_msgs/CameraInfo. Raises ValueError where it cannot be used."""
        camera = camera_from_message(message)
        return self._lifted(self._pairing.add_camera(stamp_if_any(message), now_ns, camera))

    def add_depth(self, message, now_ns):
        """Take a depth image. Raises ValueError where it carries no stamp."""
        return self._lifted(self._pairing.add_depth(stamp_of(message), now_ns, message))

    def add_boxes(self, message, now_ns):
        """Take an Int32MultiArray of 2D boxes. Raises ValueError where it is none."""
        boxes = boxes2d_from_message(message)
        if boxes.stamp_ns is None and not self._said_plain:
            self._said_plain = True
            self._tally.note('2D boxes without a stamp', 'the 2D boxes carry no stamp: each array is paired with the '
                             'depth image that came nearest to %.3f s before it (~assumed_delay)'
                             % self._params.assumed_delay)
        self._tally.count('arrays of 2D boxes')
        return self._lifted(self._pairing.add_boxes(boxes.stamp_ns, now_ns, boxes))

    def end(self):
        """Nothing more will come. Says so of the boxes that still wait for their depth image."""
        self._lifted(self._pairing.end())

    def _lifted(self, pairs):
        lifted = []
        self._tally.count_some('2D boxes of a time before', self._pairing.take_forgotten())
        for frame, boxes in pairs:
            with self._tally.refusing('2D boxes'):
                depth = self._depth_of(frame, boxes)
                found = self._boxes3d(depth, [tuple(rect) for rect in boxes.boxes.tolist()], frame.camera)
                header = Header(stamp=time_from(frame.stamp_ns if boxes.stamp_ns is None else boxes.stamp_ns),
                                frame_id=self._params.frame_id or frame.depth.header.frame_id)
                lifted.append(Lifted(header, depth, frame.camera, found))
                self._tally.count('images lifted')
        return lifted

    def _boxes3d(self, depth, rects_px, camera):
        """The 3D boxes of rectangles that are usable, show depth of their own and give a plausible box."""
        usable = [rect_px for rect_px in rects_px if self._is_usable(rect_px)]
        estimated = [box for box in estimate_boxes(depth, usable, camera, self._estimator) if box is not None]
        boxes = [box for box in estimated if self._is_plausible(box)]
        self._tally.count('boxes lifted', len(boxes))
        self._tally.count('boxes without depth', len(usable) - len(estimated))
        if self._error_model is None or not boxes:
            return boxes
        boxes = corrected_boxes(boxes, self._error_model)
        outside_m = self._error_model.distance_outside([box.center_m for box in boxes])
        self._tally.count('boxes outside of the measured range', int((outside_m > 0).sum()))
        return boxes

    def _is_usable(self, rect_px):
        try:
            check_rect(rect_px)
            return True
        except ValueError as error:
            self._tally.warn('boxes refused', '2D %s; the others in this image are used' % error)
            return False

    def _is_plausible(self, box):
        if is_plausible(box):
            return True
        self._tally.warn('boxes of impossible size', '2D box (%d, %d, %d, %d) gives a 3D box %.3g m wide and %.3g m '
                         'high at %.3g m; less than %g m expected; the others in this image are used'
                         % (tuple(box.rect_px) + (box.size_m[0], box.size_m[1], box.center_m[2], LARGEST_M)))
        return False

    def _depth_of(self, frame, boxes):
        """The depth image of a frame. Raises ValueError where there is none, or it cannot belong to the camera."""
        if frame is None:
            self._tally.count('arrays without a depth image')
            raise ValueError(self._why_no_frame(boxes))
        depth = depth_from(frame.depth, self._params.depth_scale)
        fault = units_fault(depth)
        if fault:
            raise ValueError(fault)
        fault = size_fault(frame.camera, *depth.values.shape[::-1])
        if fault:
            raise ValueError('%s; depth must be aligned to colour: %s' % (fault, ALIGN))
        return depth

    def _why_no_frame(self, boxes):
        """What did not come, and on which topic it was expected."""
        newest_ns, kept_s = self._pairing.newest_ns, self._params.cache_length
        if newest_ns is None:
            return 'no depth image has come on %s' % self._depth_topic
        if not self._pairing.has_camera:
            return 'no camera_info has come on %s' % self._info_topic
        if boxes.stamp_ns is None:
            return 'no depth image has come on %s within %.1f s' % (self._depth_topic, kept_s)
        late_s = (newest_ns - boxes.stamp_ns) / NS
        return ('no depth image with their stamp %.3f came on %s; the newest has %.3f, and %.1f s are kept '
                '(~cache_length)%s' % (boxes.stamp_ns / NS, self._depth_topic, newest_ns / NS, kept_s,
                                       ': the boxes are %.1f s too old; the detector is slower than that'
                                       % (late_s - kept_s) if late_s > kept_s else ''))


def error_model_of(params):
    """The error model that the parameters name; None where they name none. Raises ValueError where it is unusable."""
    if not params.error_model:
        return None
    try:
        model = read_error_model(params.error_model)
    except OSError as error:
        raise ValueError('the error model cannot be read: %s; an absolute path expected' % error)
    model.check_estimator(params.estimator)
    return model
