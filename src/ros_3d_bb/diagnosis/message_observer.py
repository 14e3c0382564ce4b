"""Convert received messages to observations, for running graphs and bags alike."""
import collections

import genpy
import tf2_ros

from ros_3d_bb.conversions.image_msgs import imgmsg_to_depth, imgmsg_to_rgb, units_fault
from ros_3d_bb.conversions.perception_msgs import boxes2d_from_msg, camera_from_msg
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.diagnosis.checks import COLOR, DEPTH, INFO
from ros_3d_bb.diagnosis.observations import CameraSeen, ImageSeen, Observations, Stream, TfSeen
from ros_3d_bb.diagnosis.tf_tree import links_in

KEPT = 1000  # stamps per topic


class Observation(object):
    """Statistics of the messages of one topic: their count, stamps and arrival times, and the newest message.

    `role` is that of the topic (see `topic_roles.ROLES`), or None.
    """

    def __init__(self, role, topic):
        self.role, self.topic, self.newest = role, topic, None
        self._count, self._first_ns, self._last_ns = 0, None, None
        self._stamps_ns, self._lags_s = collections.deque(maxlen=KEPT), (None, None)

    def take(self, message, ros_ns, machine_s=None):
        """Record a message with its arrival in ROS time (0 before the first /clock message) and in machine time."""
        self._count += 1
        self._first_ns, self._last_ns = ros_ns if self._first_ns is None else self._first_ns, ros_ns
        self.newest = message
        stamp_ns = _stamp_in(message)
        if stamp_ns:
            self._stamps_ns.append(stamp_ns)
        if stamp_ns and ros_ns:
            self._lags_s = (ros_ns - stamp_ns) / NS, None if machine_s is None else machine_s - stamp_ns / NS

    def stream(self, published_kind, publishers=()):
        """Return the observations as a Stream."""
        passed_s = (self._last_ns - self._first_ns) / NS if self._count > 1 else 0.0  # negative after a jump in time
        return Stream(self.role, self.topic, published_kind, publishers, self._count,
                      (self._count - 1) / passed_s if passed_s > 0 else 0.0, tuple(self._stamps_ns), *self._lags_s)

    def tf_seen(self, transforms, target_frame, source_frame=''):
        """Look up the pose of the camera in the fixed frame at the stamp of an image. None without images.

        `transforms` has the methods `lookup` and `frames_as_yaml` of `BagTransforms`; `source_frame` replaces the
        frame_id of the image.
        """
        if not self._stamps_ns:
            return None
        stamp_ns = self._stamps_ns[len(self._stamps_ns) // 2]  # the middle one: its transforms must have arrived
        source, stamp = source_frame or self.newest.header.frame_id, genpy.Time(*divmod(stamp_ns, NS))
        try:
            transforms.lookup(target_frame, source, stamp)
            fault = ''
        except tf2_ros.TransformException as error:
            fault = str(error)
        return TfSeen(target_frame, source, stamp.to_sec(), links_in(transforms.frames_as_yaml()), fault)


def observations_of(observed, depth_info, topics, seconds, publishers_of=lambda _observation: (), **others):
    """Return the Observations of recorded messages; `topics`, `seconds` and `others` are fields of it.

    `observed` has an Observation for each role, `depth_info` is that of the camera_info of depth, and `publishers_of`
    returns the publishers of an Observation.
    """
    streams = {key: one.stream(topics.get(one.topic, ''), publishers_of(one)) for key, one in observed.items()}
    return Observations(streams, topics, seconds,
                        color_camera=_camera_seen(observed[INFO].newest), depth_camera=_camera_seen(depth_info.newest),
                        color=_image_seen(observed[COLOR].newest, imgmsg_to_rgb, lambda _pixels: ''),
                        depth=_image_seen(observed[DEPTH].newest, imgmsg_to_depth, units_fault), **others)


def _stamp_in(message):
    """Return the stamp of a message, or of the image of 2D boxes, in nanoseconds; None if it has no valid stamp."""
    if hasattr(message, 'header'):
        return message.header.stamp.to_nsec()
    try:
        return boxes2d_from_msg(message).stamp_ns
    except ValueError:
        return None


def _camera_seen(message):
    if message is None:
        return None
    try:
        return CameraSeen(camera_from_msg(message), message.header.frame_id)
    except ValueError as error:
        return CameraSeen(None, message.header.frame_id, str(error))


def _image_seen(message, convert, fault_of):
    if message is None:
        return None
    try:
        fault = fault_of(convert(message))
    except ValueError as error:
        fault = str(error)
    return ImageSeen(message.width, message.height, message.encoding, message.header.frame_id, fault)
