"""Subscribers of the nodes, without TCP delay and with queues that keep the newest messages."""
import threading
import time

import rospy
from sensor_msgs.msg import Image

# Queue size for messages that are cached until others arrive and must not be lost: this many may arrive at once after
# the machine was busy. If more arrive, only the newest are kept.
KEPT_AT_ONCE = 10
AT_ONCE = 5  # queue size for messages that are processed directly; limits their age
IMAGE_BUFFER = 2 ** 24  # bytes; if smaller than the images that arrive at once, rospy delivers outdated images
SMALL_BUFFER = 2 ** 16  # rospy's default


_inputs, _lock = [], threading.Lock()  # of the process, which is one node


class Input(object):
    """Statistics of the messages received on a topic of the node.

    Attributes
    ----------
    name, kind : str, class
        Name of the topic before remapping, and its message class.
    count, came_s : int, float
        Number of received messages, and arrival of the newest on time.monotonic(); None before the first.
    subscriber : rospy.Subscriber
    """

    def __init__(self, name, kind, callback):
        self.name, self.kind, self._callback = name, kind, callback
        self.count, self.came_s, self._newest = 0, None, None
        self.subscriber = None

    def take(self, message):
        """Record a message and pass it to the callback."""
        self.count += 1
        self.came_s = time.monotonic()
        header = getattr(message, 'header', None)
        if header is not None:
            self._newest = header.stamp, rospy.get_rostime(), time.time()
        self._callback(message)

    @property
    def lags_s(self):
        """Age of the newest message at its arrival, in seconds, by ROS time and by the clock of the machine.

        (None, None) if it has no stamp, or arrived before the first /clock message.
        """
        if self._newest is None or not self._newest[0] or not self._newest[1]:
            return None, None
        stamp, ros_time, machine_s = self._newest
        return ros_time.to_sec() - stamp.to_sec(), machine_s - stamp.to_sec()


def subscribe(topic, kind, callback, at_once=AT_ONCE):
    """Create a rospy.Subscriber with TCP_NODELAY.

    Without it, the kernel delays small messages by up to 40 ms, until previous ones are acknowledged. Received messages
    are recorded, see `inputs`.
    """
    noted = Input(topic, kind, callback)
    noted.subscriber = rospy.Subscriber(topic, kind, noted.take, queue_size=at_once, tcp_nodelay=True,
                                        buff_size=IMAGE_BUFFER if kind is Image else SMALL_BUFFER)
    with _lock:
        _inputs.append(noted)
    return noted.subscriber


def inputs():
    """Return the Input of each topic that is currently subscribed."""
    with _lock:
        _inputs[:] = [noted for noted in _inputs if noted.subscriber.impl is not None]
        return list(_inputs)
