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
        self._from_before = False

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
                found = self._buffer.lookup_transform(target_frame.lstrip('/'), source_frame.lstrip('/'), stamp)
                self._from_before = False
                return transform_from_message(found)
            except tf2_ros.TransformException:
                if time.monotonic() >= deadline_s or rospy.is_shutdown():
                    self._forget_time_before()
                    raise
            time.sleep(POLL_S)

    def go_back(self):
        """Time went back: transforms of the time before may keep new ones out of the buffer.

        Where /clock tells the time, tf2 forgets them by itself, and clearing now would lose the new ones.
        """
        self._from_before = True

    def _forget_time_before(self):
        if self._from_before:
            self._buffer.clear()
            self._from_before = False
