"""Transforms at the stamp of an image, waited for, but not for long."""
import time

import rospy
import tf2_ros

from ros_3d_bb.messages import transform_from_message

POLL_S = 0.005


class Transforms(object):
    """tf2 with a wait that is bounded by the machine's clock, so that a stopped /clock cannot hang the node."""

    def __init__(self, wait_s):
        self._wait_s = wait_s
        self._buffer = tf2_ros.Buffer(debug=False)
        self._listener = tf2_ros.TransformListener(self._buffer)

    def lookup(self, target_frame, source_frame, stamp):
        """`target_from_source` at a stamp, a 4x4 matrix.

        Raises
        ------
        tf2_ros.TransformException
            If tf does not know it within the wait; says which frames and what tf knows.
        """
        deadline_s = time.monotonic() + self._wait_s
        while True:
            try:
                return transform_from_message(self._buffer.lookup_transform(target_frame.lstrip('/'),
                                                                            source_frame.lstrip('/'), stamp))
            except tf2_ros.TransformException:
                if time.monotonic() >= deadline_s or rospy.is_shutdown():
                    raise
            time.sleep(POLL_S)

    def clear(self):
        """Forget all but the static transforms, as after a jump in time."""
        self._buffer.clear()
