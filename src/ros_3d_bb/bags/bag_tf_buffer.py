"""The transforms of a bag, as they are known while its messages are gone through."""
import collections

import tf2_ros

from ros_3d_bb.conversions.perception_msgs import check_transforms, transform_from_msg
from ros_3d_bb.core.time_sync import JUMP_NS


class BagTransforms(object):
    """tf2 without ROS. Like a node that waits for a transform, it knows those that come a little later.

    Call `ahead` with each tf message when it is read, and `passed` when its turn comes; between the two lies how long
    a node would wait. Where time goes back, what comes after that is known only from its turn on.
    """

    def __init__(self):
        self._buffer = tf2_ros.BufferCore()
        self._newest_ns = 0
        self._held = collections.deque()

    def set_static(self, message):
        """Take a message of tf_static; it holds from the beginning to the end. Raises ValueError as `ahead`."""
        check_transforms(message)
        for transform in message.transforms:
            self._buffer.set_transform_static(transform, 'bag')

    def ahead(self, message):
        """Take a tf message before its turn. Raises ValueError where a stamp is beyond what tf2 can reckon with."""
        check_transforms(message)
        if self._held or self._goes_back(message):
            self._held.append(message)
        else:
            self._set(message)

    def passed(self, message):
        """It is the turn of a message that was taken ahead."""
        if not self._held or self._held[0] is not message:
            return
        self._buffer.clear()  # keeps static ones
        self._newest_ns = 0
        self._set(self._held.popleft())
        while self._held and not self._goes_back(self._held[0]):
            self._set(self._held.popleft())

    def frames_as_yaml(self):
        """What is known now, as tf2 says it."""
        return self._buffer.all_frames_as_yaml()

    def lookup(self, target_frame, source_frame, stamp):
        """`target_from_source` at a stamp, a 4x4 matrix. Raises tf2_ros.TransformException."""
        return transform_from_msg(self._buffer.lookup_transform_core(target_frame.lstrip('/'),
                                                                     source_frame.lstrip('/'), stamp))

    def go_back(self):
        """Nothing to do: the transforms themselves tell."""

    def _goes_back(self, message):
        return any(transform.header.stamp.to_nsec() < self._newest_ns - JUMP_NS for transform in message.transforms)

    def _set(self, message):
        for transform in message.transforms:
            self._buffer.set_transform(transform, 'bag')
            self._newest_ns = max(self._newest_ns, transform.header.stamp.to_nsec())
