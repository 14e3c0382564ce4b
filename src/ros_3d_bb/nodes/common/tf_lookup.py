"""tf2 lookup at the stamp of an image, with a bounded wait."""
import functools
import threading
import time

import rospy
import tf2_ros
from tf2_msgs.msg import TFMessage

from ros_3d_bb.conversions.perception_msgs import check_transforms
from ros_3d_bb.core.time_jumps import TimeJumps
from ros_3d_bb.core.time_sync import JUMP_NS
from ros_3d_bb.diagnosis.tf_tree import links_in, why_missing
from ros_3d_bb.pipeline.transform_buffer import TransformBuffer

LONGEST_WAIT_S = 0.05  # without new transforms; bounds the delay of a shutdown
EXPLAINED_S = 2.0  # between two searches of the whole tree for a pair of frames, as each costs as much as some images
REQUESTED_S = 10.0  # time for which the age of a pair of frames is shown after its last lookup


class TransformListener(object):
    """Add the transforms of tf to a TransformBuffer, and notify the threads that wait for them.

    As tf2's listener, it clears the buffer when ROS time jumps back, but not if by less than `JUMP_NS`, as with each
    message of a second publisher of /clock. Transforms from before the jump, which arrive after it, are left out.
    """

    def __init__(self, buffer):
        self.news, self._buffer, self._latest = threading.Condition(), buffer, rospy.get_rostime()
        self._jumps = TimeJumps()
        self._subscribers = [
            rospy.Subscriber(topic, TFMessage, functools.partial(self._add, add), tcp_nodelay=True)
            for topic, add in (('/tf', buffer.set_transform), ('/tf_static', buffer.set_transform_static))]

    def unregister(self):
        for subscriber in self._subscribers:
            subscriber.unregister()

    def _add(self, add, message):
        try:
            check_transforms(message)
        except ValueError as error:
            rospy.logwarn_throttle(5.0, 'transforms rejected: %s; waiting for the next' % error)
            return
        now, jumped = rospy.get_rostime(), self.has_jumped()
        for transform in message.transforms:
            if not (jumped and (transform.header.stamp - now).to_nsec() > JUMP_NS):
                add(transform, message._connection_header.get('callerid', ''))
        with self.news:
            self.news.notify_all()

    def has_jumped(self):
        """Clear the buffer after a backward jump in time. Returns whether time has jumped a moment ago."""
        now = rospy.get_rostime()
        with self.news:
            self._jumps.see('ROS time', now.to_nsec())
            if (self._latest - now).to_nsec() > JUMP_NS:
                self._buffer.clear()
                self._latest = now
            self._latest = max(self._latest, now)
            return self._jumps.are_recent()


class Transforms(TransformBuffer):
    """tf2 buffer that receives tf. `lookup` waits in wall-clock time, so that a stopped /clock cannot block a node."""

    def __init__(self, wait_s):
        super(Transforms, self).__init__()
        self._wait_s = wait_s
        self._listener = TransformListener(self)
        # By (target, source): time; (sentence, time); stamp of the latest transform, and ROS time since it is known.
        self._requested, self._explanations, self._newest = {}, {}, {}

    def lookup(self, target_frame, source_frame, stamp):
        """Look up `target_from_source` (4, 4) at a stamp.

        Raises tf2_ros.TransformException if the transform is not available within the timeout, which is not waited for
        at the stamp 0, the latest transform. The message names the frames and the state of tf.
        """
        frames = target_frame.lstrip('/'), source_frame.lstrip('/')
        self._requested[frames] = time.monotonic()
        deadline_s = time.monotonic() + (self._wait_s if stamp else 0)
        with self._listener.news:
            while True:
                try:
                    return super(Transforms, self).lookup(*frames, stamp)
                except tf2_ros.TransformException as error:
                    left_s, fault = deadline_s - time.monotonic(), error
                if left_s <= 0 or rospy.is_shutdown():
                    break
                self._listener.news.wait(min(left_s, LONGEST_WAIT_S))
        raise type(fault)(self._explanation(frames, stamp) or str(fault))

    def latest(self, target_frame, source_frame, timeout_s):
        """Look up the latest transform, which is that received last after a jump in time, too. Returns it, as `lookup`,
        and its age in seconds, 0 if only static transforms are between the frames. A transform of the future is as old
        as it is known here.

        Raises tf2_ros.TransformException as `lookup`, and if it is older than ~timeout, or further in the future: then
        its age is unknown.
        """
        target, source = target_frame.lstrip('/'), source_frame.lstrip('/')
        self._listener.has_jumped()
        self.forget_later(target, source)
        target_from_source = self.lookup(target, source, rospy.Time())
        newest = self.get_latest_common_time(target, source)
        if not newest or target == source:
            return target_from_source, 0.0
        now = rospy.get_rostime()
        if self._newest.get((target, source), (None, None))[0] != newest:
            self._newest[target, source] = newest, now
        late_s = (now - newest).to_sec()
        age_s = max(late_s, (now - self._newest[target, source][1]).to_sec())
        if age_s > timeout_s or late_s < -timeout_s:
            raise tf2_ros.ExtrapolationException('the latest one is %s, more than ~timeout (%g s)' % (
                '%.1f s old' % age_s if age_s > timeout_s else '%.1f s after ROS time' % -late_s, timeout_s))
        return target_from_source, age_s

    def have_jumped(self):
        return self._listener.has_jumped()

    def close(self):
        self._listener.unregister()

    def age(self):
        """Return the age of the newest transform of each recently requested pair of frames, as text."""
        latest_s = max(list(self._requested.values()), default=0.0)
        for frames, when_s in list(self._requested.items()):
            if when_s < latest_s - REQUESTED_S:
                self._requested.pop(frames)
        ages = ['%s from %s to %s' % (self._age_of(target, source), source, target)
                for target, source in sorted(self._requested)]
        return ', '.join(ages) or 'not requested yet'

    def _age_of(self, target_frame, source_frame):
        try:
            newest = self.get_latest_common_time(target_frame, source_frame)
        except tf2_ros.TransformException:
            return 'none'
        return '%.3f s' % (rospy.get_rostime() - newest).to_sec() if newest else 'static'

    def _explanation(self, frames, stamp):
        """Return why a transform is missing, from the whole tf tree; empty if no cause is found.

        The search is slow, so it must not run under the lock, where other cameras would wait for it.
        """
        now_s = time.monotonic()
        recent = {key: entry for key, entry in list(self._explanations.items()) if now_s - entry[1] < EXPLAINED_S}
        if frames not in recent:
            links = links_in(self.all_frames_as_yaml())
            recent[frames] = why_missing(links, *frames, stamp_s=stamp.to_sec())[0], now_s
        self._explanations = recent
        return recent[frames][0]
