"""Transforms at the stamp of an image, waited for, but not for long."""
import threading
import time

import rospy
import tf2_ros

from ros_3d_bb.diagnosis.tf_tree import links_in, why_missing
from ros_3d_bb.messages import check_transforms, transform_from_message

LONGEST_WAIT_S = 0.05  # without news; shutting down takes no longer
EXPLAINED_S = 2.0  # between two looks at the whole tree, which takes as long as some images


class _Listener(tf2_ros.TransformListener):
    """Takes transforms, and tells who waits for them."""

    def __init__(self, buffer):
        self.news = threading.Condition()
        tf2_ros.TransformListener.__init__(self, buffer, tcp_nodelay=True)

    def callback(self, data):
        """Of /tf."""
        if not _are_usable(data):
            return
        tf2_ros.TransformListener.callback(self, data)
        self._tell()

    def static_callback(self, data):
        """Of /tf_static."""
        if not _are_usable(data):
            return
        tf2_ros.TransformListener.static_callback(self, data)
        self._tell()

    def _tell(self):
        with self.news:
            self.news.notify_all()


def _are_usable(message):
    try:
        check_transforms(message)
        return True
    except ValueError as error:
        rospy.logwarn_throttle(5.0, 'transforms refused: %s; waiting for the next' % error)
        return False


class Transforms(object):
    """tf2 with a wait that is bounded by the machine's clock, so that a stopped /clock cannot hang the node."""

    def __init__(self, wait_s):
        self._wait_s = wait_s
        self._buffer = tf2_ros.Buffer(debug=False)
        self._listener = _Listener(self._buffer)
        self._from_before = False
        self._asked, self._explanation, self._explained_s = None, '', -EXPLAINED_S

    def lookup(self, target_frame, source_frame, stamp):
        """`target_from_source` at a stamp, a 4x4 matrix.

        Raises
        ------
        tf2_ros.TransformException
            If tf does not know it within the wait; says which frames and what tf knows.
        """
        deadline_s = time.monotonic() + self._wait_s
        self._asked = target_frame.lstrip('/'), source_frame.lstrip('/')
        with self._listener.news:
            while True:
                try:
                    found = self._buffer.lookup_transform(target_frame.lstrip('/'), source_frame.lstrip('/'), stamp)
                    self._from_before = False
                    return transform_from_message(found)
                except tf2_ros.TransformException as error:
                    left_s = deadline_s - time.monotonic()
                    if left_s <= 0 or rospy.is_shutdown():
                        explained = type(error)(self._explained(stamp) or str(error))
                        self._forget_time_before()
                        raise explained
                self._listener.news.wait(min(left_s, LONGEST_WAIT_S))

    def go_back(self):
        """Time went back: transforms of the time before may keep new ones out of the buffer.

        Where /clock tells the time, tf2 forgets them by itself, and clearing now would lose the new ones.
        """
        self._from_before = True

    def age(self):
        """How old the newest transform is that was asked for, in words."""
        if self._asked is None:
            return 'not asked for yet'
        try:
            newest = self._buffer.get_latest_common_time(*self._asked)
        except tf2_ros.TransformException:
            return 'none from %s to %s' % self._asked[::-1]
        return '%.3f s' % (rospy.get_rostime() - newest).to_sec() if newest else 'static'

    def _explained(self, stamp):
        """Why there is no transform, from all that tf knows; empty where that says nothing."""
        now_s = time.monotonic()
        if now_s - self._explained_s >= EXPLAINED_S:
            links = links_in(self._buffer.all_frames_as_yaml())
            self._explanation, self._explained_s = why_missing(links, *self._asked, stamp_s=stamp.to_sec())[0], now_s
        return self._explanation

    def _forget_time_before(self):
        if self._from_before:
            self._buffer.clear()
            self._from_before = False
