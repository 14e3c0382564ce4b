"""How nodes subscribe: without delay, and with queues that keep the newest."""
import threading
import time

import rospy
from sensor_msgs.msg import Image

# What is kept for others that come later must not be lost on the way: so many messages may come at once, after the
# machine was busy; of more, only the newest are taken.
KEPT_AT_ONCE = 10
AT_ONCE = 5  # the same for what is worked on: it bounds how old that can get
IMAGE_BUFFER = 2 ** 24  # bytes; less than the images that come at once, and rospy takes old ones for new
SMALL_BUFFER = 2 ** 16  # rospy's default


_inputs, _lock = [], threading.Lock()  # of this process, which is one node


class Input(object):
    """What came on a topic that a node subscribes.

    Attributes
    ----------
    name, kind : str, class
        As the node calls the topic, before any remapping, and its messages.
    count, came_s : int, float
        How many messages came, and when the newest did on time.monotonic(); None before the first.
    subscriber : rospy.Subscriber
    """

    def __init__(self, name, kind, callback):
        self.name, self.kind, self._callback = name, kind, callback
        self.count, self.came_s, self._newest = 0, None, None
        self.subscriber = None

    def take(self, message):
        """Note that a message came, and hand it on."""
        self.count += 1
        self.came_s = time.monotonic()
        header = getattr(message, 'header', None)
        if header is not None:
            self._newest = header.stamp, rospy.get_rostime(), time.time()
        self._callback(message)

    @property
    def lags_s(self):
        """How long before it came the stamp of the newest message was, by ROS time and by the machine's clock, seconds;
        None and None where it carries none, or came before the first /clock.
        """
        if self._newest is None or not self._newest[0] or not self._newest[1]:
            return None, None
        stamp, ros_time, machine_s = self._newest
        return ros_time.to_sec() - stamp.to_sec(), machine_s - stamp.to_sec()


def subscribe(topic, kind, callback, at_once=AT_ONCE):
    """A rospy.Subscriber to whom the publisher sends at once (TCP_NODELAY).

    Without that the kernel keeps small messages back until the ones before are acknowledged, up to 40 ms. What comes is
    noted: see `inputs`.
    """
    noted = Input(topic, kind, callback)
    noted.subscriber = rospy.Subscriber(topic, kind, noted.take, queue_size=at_once, tcp_nodelay=True,
                                        buff_size=IMAGE_BUFFER if kind is Image else SMALL_BUFFER)
    with _lock:
        _inputs.append(noted)
    return noted.subscriber


def inputs():
    """The Input of each topic that is subscribed now."""
    with _lock:
        _inputs[:] = [noted for noted in _inputs if noted.subscriber.impl is not None]
        return list(_inputs)
