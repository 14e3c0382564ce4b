"""tf2 buffer that is filled from the messages of a bag while they are processed."""
import collections

import genpy
import tf2_ros
from tf2_msgs.msg import TFMessage

from ros_3d_bb.conversions.camera_msgs import transform_messages
from ros_3d_bb.conversions.perception_msgs import NEWEST, check_transforms, transform_from_msg
from ros_3d_bb.core.time_sync import JUMP_NS


class BagTransforms(object):
    """tf2 buffer without ROS, which contains transforms of the near future as for a node that waits for a transform.

    Call `ahead` with each tf message when it is read, and `passed` when it is processed; a node would wait in between.
    After a backward jump in time, transforms become available only when they are processed.
    """

    def __init__(self):
        self._buffer = tf2_ros.BufferCore()
        self._newest_ns = 0
        self._held = collections.deque()
        self._static_parents = {}

    def set_static(self, message):
        """Add a message of tf_static, which is valid for the whole bag. Raises ValueError as `ahead`."""
        check_transforms(message)
        for transform in message.transforms:
            self._buffer.set_transform_static(transform, 'bag')
            self._static_parents[transform.child_frame_id.lstrip('/')] = transform.header.frame_id.lstrip('/')

    def set_pose(self, target_frame, frame, target_from_frame):
        """Set the pose (4, 4) of a frame in a frame that tf does not contain, by a transform to the root of its tree.

        Raises ValueError if the static transforms already contain the frame in `target_frame`.
        """
        root, seen = frame.lstrip('/'), set()
        while root in self._static_parents and root not in seen:
            seen.add(root)
            root = self._static_parents[root]
        if root == target_frame.lstrip('/'):
            raise ValueError('the bag contains the pose of %s in %s; a bag without it expected (--camera-height)'
                             % (frame, target_frame))
        target_from_root = target_from_frame.dot(self.lookup(frame, root, NEWEST))
        self.set_static(TFMessage(transform_messages(genpy.Time(0), [(target_frame, root, target_from_root)])))

    def ahead(self, message):
        """Add a tf message before it is processed. Raises ValueError if a stamp exceeds the range of tf2."""
        check_transforms(message)
        if self._held or self._goes_back(message):
            self._held.append(message)
        else:
            self._set(message)

    def passed(self, message):
        """Process a message that was added by `ahead`."""
        if not self._held or self._held[0] is not message:
            return
        self._buffer.clear()  # keeps static transforms
        self._newest_ns = 0
        self._set(self._held.popleft())
        while self._held and not self._goes_back(self._held[0]):
            self._set(self._held.popleft())

    def frames_as_yaml(self):
        """Return the current frames as YAML text in the format of tf2."""
        return self._buffer.all_frames_as_yaml()

    def lookup(self, target_frame, source_frame, stamp):
        """Look up `target_from_source` at a stamp, a 4x4 matrix. Raises tf2_ros.TransformException."""
        return transform_from_msg(self._buffer.lookup_transform_core(target_frame.lstrip('/'),
                                                                     source_frame.lstrip('/'), stamp))

    def go_back(self):
        """Do nothing: backward jumps are detected from the stamps of the transforms."""

    def _goes_back(self, message):
        return any(transform.header.stamp.to_nsec() < self._newest_ns - JUMP_NS for transform in message.transforms)

    def _set(self, message):
        for transform in message.transforms:
            self._buffer.set_transform(transform, 'bag')
            self._newest_ns = max(self._newest_ns, transform.header.stamp.to_nsec())
