"""tf2 lookup at the stamp of an image, with a bounded wait."""
import threading
import time

import rospy
import tf2_ros

from ros_3d_bb.conversions.perception_msgs import check_transforms, transform_from_msg
from ros_3d_bb.diagnosis.tf_tree import links_in, why_missing

LONGEST_WAIT_S = 0.05  # without new transforms; bounds the delay of a shutdown
EXPLAINED_S = 2.0  # between two searches of the whole tree for a pair of frames, as each costs as much as some images
CACHE_S = 10.0  # the tf2 buffer rejects transforms that are older than the newest one of their frame by more
ASKED_S = 10.0  # time for which the age of a pair of frames is shown after its last lookup


class _Listener(tf2_ros.TransformListener):
    """Receive transforms and notify the threads that wait for them.

    `has_refused` becomes true if a transform is rejected by tf2 as too old compared with the newest of its frame.
    """

    def __init__(self, buffer):
        self.news = threading.Condition()
        self.clear()
        tf2_ros.TransformListener.__init__(self, buffer, tcp_nodelay=True)

    def clear(self):
        """Reset the state after the buffer was cleared."""
        self.has_refused, self._newest_s = False, {}  # by child frame

    def callback(self, data):
        """Process a message of /tf."""
        if not _are_usable(data):
            return
        for transform in data.transforms:
            stamp_s, child = transform.header.stamp.to_sec(), transform.child_frame_id
            newest_s = self._newest_s[child] = max(stamp_s, self._newest_s.get(child, stamp_s))
            self.has_refused |= stamp_s < newest_s - CACHE_S
        tf2_ros.TransformListener.callback(self, data)
        self._tell()

    def static_callback(self, data):
        """Process a message of /tf_static."""
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
        rospy.logwarn_throttle(5.0, 'transforms rejected: %s; waiting for the next' % error)
        return False


class Transforms(object):
    """tf2 lookup with a timeout in wall-clock time, so that a stopped /clock cannot block the node."""

    def __init__(self, wait_s):
        self._wait_s = wait_s
        self._buffer = tf2_ros.Buffer(debug=False)
        self._from_before = False
        self._listener = _Listener(self._buffer)
        self._asked, self._explanations = {}, {}  # by (target, source): time; (sentence, time)

    def lookup(self, target_frame, source_frame, stamp):
        """Look up `target_from_source` at a stamp.

        Returns
        -------
        numpy.ndarray, (4, 4)

        Raises
        ------
        tf2_ros.TransformException
            If the transform is not available within the timeout. The message names the frames and the state of tf.
        """
        asked = target_frame.lstrip('/'), source_frame.lstrip('/')
        self._asked[asked] = time.monotonic()
        try:
            return transform_from_msg(self._awaited(asked, stamp))
        except tf2_ros.TransformException as error:
            explained = type(error)(self._explained(asked, stamp) or str(error))
            self._forget_time_before()
            raise explained

    def _awaited(self, asked, stamp):
        deadline_s = time.monotonic() + self._wait_s
        with self._listener.news:
            while True:
                try:
                    found = self._buffer.lookup_transform(asked[0], asked[1], stamp)
                    self._from_before = False
                    return found
                except tf2_ros.TransformException:
                    left_s = deadline_s - time.monotonic()
                    if left_s <= 0 or rospy.is_shutdown():
                        raise
                self._listener.news.wait(min(left_s, LONGEST_WAIT_S))

    def go_back(self):
        """Handle a backward jump in time: the buffer is cleared if the next lookup fails.

        Transforms from before the jump may prevent new ones from entering the buffer. With /clock, tf2 discards them
        itself, and clearing the buffer at once would lose the new ones.
        """
        self._from_before = True

    def age(self):
        """Return the age of the newest transform of each recently requested pair of frames, as text."""
        latest_s = max(list(self._asked.values()), default=0.0)
        for asked, when_s in list(self._asked.items()):
            if when_s < latest_s - ASKED_S:
                self._asked.pop(asked)
        ages = ['%s from %s to %s' % ((self._age_of(asked),) + asked[::-1]) for asked in sorted(self._asked)]
        return ', '.join(ages) or 'not asked for yet'

    def _age_of(self, asked):
        try:
            newest = self._buffer.get_latest_common_time(*asked)
        except tf2_ros.TransformException:
            return 'none'
        return '%.3f s' % (rospy.get_rostime() - newest).to_sec() if newest else 'static'

    def _explained(self, asked, stamp):
        """Return why a transform is missing, from the whole tf tree; empty if no cause is found.

        The search is slow, so it must not run under the lock, where other cameras would wait for it.
        """
        now_s = time.monotonic()
        recent = {frames: said for frames, said in list(self._explanations.items()) if now_s - said[1] < EXPLAINED_S}
        if asked not in recent:
            links = links_in(self._buffer.all_frames_as_yaml())
            recent[asked] = why_missing(links, *asked, stamp_s=stamp.to_sec())[0], now_s
        self._explanations = recent
        return recent[asked][0]

    def _forget_time_before(self):
        if self._from_before or self._listener.has_refused:
            self._buffer.clear()
            self._listener.clear()
            self._from_before = False
