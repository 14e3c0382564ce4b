"""Convert received messages to observations, for running graphs and bags alike."""
import collections

from ros_3d_bb.conversions.image_msgs import imgmsg_to_depth, imgmsg_to_rgb, units_fault
from ros_3d_bb.conversions.perception_msgs import boxes2d_from_msg, camera_from_msg
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.diagnosis.observations import CameraSeen, ImageSeen, Stream
from ros_3d_bb.diagnosis.topic_roles import ROLES

KEPT = 1000  # stamps per topic


class Observation(object):
    """Statistics of the messages of one topic: their count, stamps and arrival times, and the newest message.

    Parameters
    ----------
    key : str
        Key of the role, see `topic_roles.ROLES`.
    topic : str
    """

    def __init__(self, key, topic):
        self.role, self.topic, self.newest = ROLES[key], topic, None
        self._count, self._first_ns, self._last_ns = 0, None, None
        self._stamps_ns, self._lags_s = collections.deque(maxlen=KEPT), (None, None)

    def take(self, message, ros_ns, machine_s=None):
        """Record a message.

        Parameters
        ----------
        message : genpy.Message
        ros_ns : int
            Arrival in ROS time, nanoseconds; 0 before the first /clock message.
        machine_s : float, optional
            Arrival by the clock of the machine, seconds.
        """
        self._count += 1
        self._first_ns, self._last_ns = ros_ns if self._first_ns is None else self._first_ns, ros_ns
        self.newest = message
        stamp_ns = _stamp_in(message)
        if stamp_ns:
            self._stamps_ns.append(stamp_ns)
        if stamp_ns and ros_ns:
            self._lags_s = (ros_ns - stamp_ns) / NS, None if machine_s is None else machine_s - stamp_ns / NS

    @property
    def middle_ns(self):
        """The middle one of the stamps, for which transforms must have arrived; None without stamps."""
        return self._stamps_ns[len(self._stamps_ns) // 2] if self._stamps_ns else None

    def stream(self, published_kind, publishers=()):
        """Return the observations as a Stream."""
        passed_s = (self._last_ns - self._first_ns) / NS if self._count > 1 else 0.0  # negative after a jump in time
        return Stream(self.role, self.topic, published_kind, publishers, self._count,
                      (self._count - 1) / passed_s if passed_s > 0 else 0.0, tuple(self._stamps_ns), *self._lags_s)


def _stamp_in(message):
    """Return the stamp of a message, or of the image of 2D boxes, in nanoseconds; None if it has no valid stamp."""
    if hasattr(message, 'header'):
        return message.header.stamp.to_nsec()
    try:
        return boxes2d_from_msg(message).stamp_ns
    except ValueError:
        return None


def camera_seen(message):
    """Convert a CameraInfo, or None, to CameraSeen, or None."""
    if message is None:
        return None
    try:
        return CameraSeen(camera_from_msg(message), message.header.frame_id)
    except ValueError as error:
        return CameraSeen(None, message.header.frame_id, str(error))


def color_seen(message):
    """Convert a colour image, or None, to ImageSeen, or None."""
    return _image_seen(message, imgmsg_to_rgb, lambda _pixels: '')


def depth_seen(message):
    """Convert a depth image, or None, to ImageSeen, or None."""
    return _image_seen(message, imgmsg_to_depth, units_fault)


def _image_seen(message, read, fault_of):
    if message is None:
        return None
    try:
        fault = fault_of(read(message))
    except ValueError as error:
        fault = str(error)
    return ImageSeen(message.width, message.height, message.encoding, message.header.frame_id, fault)
