"""Subscribers of the nodes, and the faults that show in their inputs: silent topics, wrong stamps, a stopped clock."""
import threading
import time

import rospy
from rospy.topics import get_topic_manager
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Int32MultiArray

from ros_3d_bb.conversions.camera_msgs import IMAGE_KINDS, info_of_images
from ros_3d_bb.core.senders import Senders, sender_of
from ros_3d_bb.core.time_jumps import TimeJumps
from ros_3d_bb.diagnosis.roles import role_named
from ros_3d_bb.diagnosis.observations import Stream
from ros_3d_bb.diagnosis.topic_faults import NO_CLOCK, clock_fault, publishers_fault, silence_fault
from ros_3d_bb.msg import BoundingBox3DArray, TrackedObjectArray
from ros_3d_bb.nodes.common.master import NO_ANSWER, published_topics, publishers_of

# Queue size for messages that are cached until others arrive and must not be lost: this many may arrive at once after
# the machine was busy. If more arrive, only the newest are kept.
KEPT_AT_ONCE = 10
AT_ONCE = 5  # queue size for messages that are processed directly; limits their age
IMAGE_BUFFER = 2 ** 24  # bytes; if smaller than the images that arrive at once, rospy delivers outdated images
SMALL_BUFFER = 2 ** 16  # rospy's default
SILENT_S = 5.0
ONE_PUBLISHER = Image, CameraInfo, Int32MultiArray, BoundingBox3DArray, TrackedObjectArray  # of one topic
QUERY_PERIOD_S = 10.0  # between two requests to the master about one topic

_inputs, _lock = [], threading.Lock()  # of the process, which is one node


class Input(object):
    """Statistics of the messages received on a topic of the node."""

    def __init__(self, name, kind, is_irregular=False):
        self.name, self.kind, self.callbacks, self.subscriber = name, kind, [], None
        self.is_irregular = is_irregular
        self.count, self.received_s, self._newest = 0, None, None  # `received_s` on time.monotonic()
        self.senders, self._jumps = Senders(), TimeJumps()
        self.reported_count = 0  # at the last report of the rate
        self.silence, self.queried_s = '', -QUERY_PERIOD_S  # cause of a silence, and when the master was asked for it

    def take(self, message):
        """Record a message and pass it to the callbacks. Its lag is unknown after a jump in time."""
        self.senders.add(sender_of(message))
        if isinstance(message, rospy.AnyMsg):
            message = _image_in(message)
            if message is None:  # the diagnostics report the type of a topic without messages
                return
        self.count += 1
        self.received_s = time.monotonic()
        header = getattr(message, 'header', None)
        if header is not None:
            ros_time = rospy.get_rostime()
            self._jumps.see('ROS time', ros_time.to_nsec(), self.received_s)
            self._jumps.see('stamps', header.stamp.to_nsec(), self.received_s)
            is_settled = not self._jumps.are_recent(self.received_s)
            self._newest = (header.stamp, ros_time, time.time()) if is_settled else None
        for callback in list(self.callbacks):
            callback(message)

    def remove(self, callback):
        """Remove a callback; the last one unsubscribes from the topic."""
        with _lock:
            self.callbacks.remove(callback)
            is_last = not self.callbacks
        if is_last:
            self.subscriber.unregister()

    @property
    def is_connected(self):
        """Whether a publisher is connected. The count of rospy 1.15 includes those that it tries to reach again."""
        return any(connection.socket is not None for connection in self.subscriber.impl.connections)

    def stream(self):
        """Return the statistics as a Stream. Lags are unknown without a stamp, and before the first /clock message."""
        stamp, ros_time, machine_s = self._newest or (None, None, None)
        has_lag = bool(stamp and ros_time)
        return Stream(role_named(self.name, self.kind._type), self.subscriber.resolved_name, count=self.count,
                      lag_s=ros_time.to_sec() - stamp.to_sec() if has_lag else None,
                      machine_lag_s=machine_s - stamp.to_sec() if has_lag else None)


def subscribe(topic, kind, callback, at_once=AT_ONCE, is_irregular=False):
    """Subscribe with TCP_NODELAY to a topic whose messages are recorded, see `inputs`. Returns a function that ends it.
    Of a topic that is irregular, such as a static map, only a missing publisher is a fault.

    Without TCP_NODELAY, the kernel delays small messages by up to 40 ms, until previous ones are acknowledged. With
    the kind Image, each publisher may send any of `camera_msgs.IMAGE_KINDS`, and the callback receives that type. A
    topic that is subscribed already, by another node in this process, is received once.
    """
    name, is_image = rospy.resolve_name(topic), kind is Image
    with _lock:
        shared = next((each for each in _inputs if each.callbacks and each.subscriber.resolved_name == name), None)
        if shared is not None:
            shared.callbacks.append(callback)
            return lambda: shared.remove(callback)
        created = Input(topic, kind, is_irregular)
        created.callbacks.append(callback)
    created.subscriber = rospy.Subscriber(topic, rospy.AnyMsg if is_image else kind, created.take, queue_size=at_once,
                                          tcp_nodelay=True, buff_size=IMAGE_BUFFER if is_image else SMALL_BUFFER)
    with _lock:
        _inputs.append(created)
    return lambda: created.remove(callback)


def subscribe_camera_info(topic, image_topic, callback, at_once=KEPT_AT_ONCE):
    image_topic = rospy.resolve_name(image_topic)
    return subscribe(topic, CameraInfo, lambda message: callback(info_of_images(message, image_topic)), at_once)


def _image_in(message):
    """Deserialize an AnyMsg as the image type of its publisher, or return None if that is another type."""
    given = message._connection_header['type'], message._connection_header['md5sum']
    kind = next((kind for kind in IMAGE_KINDS if (kind._type, kind._md5sum) == given), None)
    return None if kind is None else kind().deserialize(message._buff)


def inputs():
    with _lock:
        _inputs[:] = [each for each in _inputs if each.subscriber.impl is not None]
        return list(_inputs)


class InputMonitor(object):
    """Check the inputs once per second. The only cost for their callbacks is to record each message."""

    def __init__(self):
        self._began_s = self._reported_s = time.monotonic()
        self._failed_s, self._failure = -QUERY_PERIOD_S, None  # time and error of the last failed request to the master

    def values(self):
        """Yield (name, text) of each input: its topic and its rate since the last call."""
        now_s = time.monotonic()
        passed_s, self._reported_s = max(now_s - self._reported_s, 1e-3), now_s
        for each in inputs():
            new, each.reported_count = each.count - each.reported_count, each.count
            yield 'input ' + each.name, '%s %.1f Hz' % (each.subscriber.resolved_name, new / passed_s)

    def faults(self):
        """Yield (event, sentence) for each current fault."""
        now_s = time.monotonic()
        if now_s - self._began_s > SILENT_S and not rospy.get_rostime():
            yield 'no clock', '%s; %s' % NO_CLOCK
            return
        for each in inputs():
            if each.is_irregular and (each.count or each.is_connected):
                continue
            if each.kind is CameraInfo and each.count and each.is_connected:
                continue  # one is valid for all images
            silent_s = now_s - (each.received_s or self._began_s)
            if silent_s > SILENT_S:
                yield 'silence on ' + each.name, self._silence(each, now_s, silent_s)
            elif each.count:
                fault = clock_fault(each.stream(), not rospy.rostime.is_wallclock())
                if fault[0]:
                    yield 'clocks', '%s; %s' % fault
                senders = each.senders.take() if each.kind in ONE_PUBLISHER else ()
                if senders:
                    yield ('publishers of ' + each.name,
                           '%s; %s' % publishers_fault([each.subscriber.resolved_name], senders))

    def _silence(self, silent, now_s, silent_s):
        """Return why an input is silent. The master is queried at most every QUERY_PERIOD_S per topic.

        After a failed query, which takes seconds, the other topics wait for the same time.
        """
        if now_s - silent.queried_s < QUERY_PERIOD_S:
            return silent.silence
        if now_s - self._failed_s >= QUERY_PERIOD_S:
            try:
                silent.silence, silent.queried_s = _cause_of_silence(silent, silent_s), now_s
                return silent.silence
            except NO_ANSWER as error:
                self._failed_s, self._failure = time.monotonic(), error
        return 'no messages on %s, and the master does not respond (%s)' % (silent.subscriber.resolved_name,
                                                                            self._failure)


def _cause_of_silence(silent, silent_s):
    """Return a sentence with the cause of the silence of an input. Raises one of `NO_ANSWER`."""
    used = set(other.subscriber.resolved_name for other in inputs() if other.count) | set(get_topic_manager().pubs)
    topics, topic = published_topics(), silent.subscriber.resolved_name
    stream = silent.stream()._replace(published_kind=topics.get(topic, ''), publishers=publishers_of(topic))
    return '%s; %s' % silence_fault(stream, topics, used, silent_s)
