"""From messages to what was seen of them, the same for a running graph and for a bag."""
import collections

from ros_3d_bb.conversions.image_msgs import imgmsg_to_depth, imgmsg_to_rgb, units_fault
from ros_3d_bb.conversions.perception_msgs import boxes2d_from_msg, camera_from_msg
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.diagnosis.observations import CameraSeen, ImageSeen, Stream
from ros_3d_bb.diagnosis.topic_roles import ROLES

KEPT = 1000  # stamps of a topic


class Observation(object):
    """The messages of one topic: how many, their stamps, when they came, and the newest.

    Parameters
    ----------
    key : str
        A role, see `topic_roles.ROLES`.
    topic : str
    """

    def __init__(self, key, topic):
        self.role, self.topic, self.newest = ROLES[key], topic, None
        self._count, self._first_ns, self._last_ns = 0, None, None
        self._stamps_ns, self._lags_s = collections.deque(maxlen=KEPT), (None, None)

    def take(self, message, ros_ns, machine_s=None):
        """Take a message that came at a ROS time, and at a time of the machine's clock."""
        self._count += 1
        self._first_ns, self._last_ns = ros_ns if self._first_ns is None else self._first_ns, ros_ns
        self.newest = message
        stamp_ns = _stamp_in(message)
        if stamp_ns:
            self._stamps_ns.append(stamp_ns)
        if stamp_ns and ros_ns:  # 0 before the first /clock
            self._lags_s = (ros_ns - stamp_ns) / NS, None if machine_s is None else machine_s - stamp_ns / NS

    @property
    def middle_ns(self):
        """A stamp from the middle of the time, for which transforms must have come; None where there is none."""
        return self._stamps_ns[len(self._stamps_ns) // 2] if self._stamps_ns else None

    def stream(self, published_kind, publishers=()):
        """The Stream that was seen."""
        passed_s = (self._last_ns - self._first_ns) / NS if self._count > 1 else 0.0  # less than 0 where time jumps
        return Stream(self.role, self.topic, published_kind, publishers, self._count,
                      (self._count - 1) / passed_s if passed_s > 0 else 0.0, tuple(self._stamps_ns), *self._lags_s)


def _stamp_in(message):
    """The stamp of a message, or of the image that it is about; None where it carries none that can be read."""
    if hasattr(message, 'header'):
        return message.header.stamp.to_nsec()
    try:
        return boxes2d_from_msg(message).stamp_ns
    except ValueError:
        return None


def camera_seen(message):
    """The CameraSeen of a CameraInfo, None of None."""
    if message is None:
        return None
    try:
        return CameraSeen(camera_from_msg(message), message.header.frame_id)
    except ValueError as error:
        return CameraSeen(None, message.header.frame_id, str(error))


def color_seen(message):
    """The ImageSeen of a colour image, None of None."""
    return _image_seen(message, imgmsg_to_rgb, lambda _pixels: '')


def depth_seen(message):
    """The ImageSeen of a depth image, None of None."""
    return _image_seen(message, imgmsg_to_depth, units_fault)


def _image_seen(message, read, fault_of):
    if message is None:
        return None
    try:
        fault = fault_of(read(message))
    except ValueError as error:
        fault = str(error)
    return ImageSeen(message.width, message.height, message.encoding, message.header.frame_id, fault)
