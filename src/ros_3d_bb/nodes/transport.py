"""How nodes subscribe: without delay, and with queues that keep the newest."""
import rospy
from sensor_msgs.msg import Image

# What is kept for others that come later must not be lost on the way: so many messages may come at once, after the
# machine was busy; of more, only the newest are taken.
KEPT_AT_ONCE = 10
AT_ONCE = 5  # the same for what is worked on: it bounds how old that can get
IMAGE_BUFFER = 2 ** 24  # bytes; less than the images that come at once, and rospy takes old ones for new
SMALL_BUFFER = 2 ** 16  # rospy's default


def subscribe(topic, kind, callback, at_once=AT_ONCE):
    """A rospy.Subscriber to whom the publisher sends at once (TCP_NODELAY).

    Without that the kernel keeps small messages back until the ones before are acknowledged, up to 40 ms.
    """
    return rospy.Subscriber(topic, kind, callback, queue_size=at_once, tcp_nodelay=True,
                            buff_size=IMAGE_BUFFER if kind is Image else SMALL_BUFFER)
