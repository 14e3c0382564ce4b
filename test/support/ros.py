"""Shared by the tests of nodes: recording topics, and messages of a camera and of a track."""
import subprocess
import time

import numpy as np
import rospy
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header

from ros_3d_bb.conversions.image_msgs import fill_image
from ros_3d_bb.conversions.perception_msgs import time_from, tracks_to_msg
from ros_3d_bb_lab.evaluation.launching import running
from support.tracks import track_at

TIMEOUT_S = 60.0  # to start the pipeline on a busy machine


def happens(condition, timeout_s):
    """Whether a condition becomes true within a timeout in wall-clock time, independent of /clock."""
    deadline_s = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() > deadline_s or rospy.is_shutdown():
            return False
        time.sleep(0.002)
    return True


def wait_until(condition, what, timeout_s=TIMEOUT_S):
    assert happens(condition, timeout_s), 'never happened: %s' % what


def launched(*arguments):
    """Run a launch file of the package on this test's master, until the end of the block."""
    return running(['roslaunch', 'ros_3d_bb'] + list(arguments))


def started(node, *params):
    """Run a node with these private parameters ('name:=value') only. Returns the process, with its output as text."""
    if rospy.has_param('/' + node):  # of the previous run
        rospy.delete_param('/' + node)
    return subprocess.Popen(['rosrun', 'ros_3d_bb', node] + ['_' + param for param in params], stdout=subprocess.PIPE,
                            stderr=subprocess.STDOUT, universal_newlines=True)


class Recorder(object):
    """Keeps all messages of a topic; use as a context manager."""

    def __init__(self, topic, kind, publisher_expected=True):
        self.topic, self.messages = topic, []
        self._subscriber = rospy.Subscriber(topic, kind, lambda message: self.messages.append(message),
                                            queue_size=1000, buff_size=2 ** 26)
        if publisher_expected:
            wait_until(lambda: self.is_connected, 'a publisher on ' + topic)
            time.sleep(0.3)  # the publisher counts a connection a moment later than the subscriber

    @property
    def is_connected(self):
        return self._subscriber.get_num_connections() > 0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._subscriber.unregister()

    def emptied(self):
        """Itself, without the messages so far. A connection that lasts for several tests misses no message."""
        self.messages = []
        return self

    def wait_for(self, count, timeout_s=TIMEOUT_S):
        wait_until(lambda: len(self.messages) >= count, '%d messages on %s' % (count, self.topic), timeout_s)
        return self.messages[:count]

    def stays_at(self, count, seconds=0.7):
        """Whether there are `count` messages and no more arrive for a while."""
        time.sleep(seconds)
        return len(self.messages) == count


def publisher(topic, kind):
    result = rospy.Publisher(topic, kind, queue_size=100)
    wait_until(lambda: result.get_num_connections() > 0, 'a subscriber on ' + topic)
    return result


def header_at(stamp_ns, frame_id='camera_color_optical_frame'):
    return Header(stamp=time_from(stamp_ns), frame_id=frame_id)


def depth_message(stamp_ns, depth_mm):
    """A depth image of one depth everywhere, 16UC1."""
    return fill_image(Image(header=header_at(stamp_ns)), np.full((48, 64), depth_mm, np.uint16), '16UC1')


def camera_info(stamp_ns, width=64, height=48, focal=60.0):
    """The camera of `depth_message`: its principal point is the centre of the image."""
    info = CameraInfo(header=header_at(stamp_ns), width=width, height=height, distortion_model='plumb_bob', D=[0.0] * 5)
    info.K = [focal, 0, (width - 1) / 2.0, 0, focal, (height - 1) / 2.0, 0, 0, 1]
    return info


def person(number, x, y, moving=True, speed=1.0):
    """The message of a track that walks along x of the map, predicted for 2 s."""
    track = track_at((x, y, 0.85), (speed, 0, 0), moving=moving, number=number)
    return tracks_to_msg([track._replace(size_m=np.array([0.6, 0.6, 1.7]))], Header()).objects[0]
