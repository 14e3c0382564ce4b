"""ROS node that reads a RealSense camera or recording through librealsense, without realsense2_camera."""
import contextlib
import sys
import threading
import time
from typing import NamedTuple

import rospy
import tf2_ros
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Header

from ros_3d_bb.conversions.camera_msgs import (COLOR_TOPIC, DEPTH_TOPIC, INFO_TOPICS, TYPES, CameraFrame,
                                               image_messages_of, transform_messages)
from ros_3d_bb.conversions.perception_msgs import time_from
from ros_3d_bb.core.params import SET_BY_LAUNCH, WAIT_FOR_SUBSCRIBERS, Param, parameters
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.drivers.realsense import (CameraLost, RealSense, RealSenseParams, frame_links, librealsense,
                                         optical_frame)
from ros_3d_bb.nodes.common.diagnostics import Diagnostics
from ros_3d_bb.nodes.common.master import is_ending
from ros_3d_bb.nodes.common.startup import SENDING_S, read_params, run_node, wait_for_subscribers

RETRY_S = 2.0
CLOSING_S = 5.0  # upper limit
START_NS = NS  # published on /clock until the first image of a recording sets the time


@parameters()
class RealSenseNodeParams(NamedTuple):
    """Parameters of realsense_node, except those of the camera."""

    frame_prefix: str = Param('camera')
    repeat: bool = Param(False)
    publish_clock: bool = Param(
        False, 'Whether this node publishes the time of a recording on /clock.', section=SET_BY_LAUNCH)
    wait_for_subscribers: int = WAIT_FOR_SUBSCRIBERS


class RealSenseNode(object):
    """Publish colour, depth aligned to it, and camera_info, with the topics and frames of realsense2_camera.

    If the camera is missing or unplugged, the node waits for it. Parameters: config/realsense.yaml.

    Publishes
    ---------
    camera/color/image_raw : sensor_msgs/Image
        Colour image.
    camera/aligned_depth_to_color/image_raw : sensor_msgs/Image
        Depth image, aligned to the colour image.
    camera/color/camera_info : sensor_msgs/CameraInfo
        Calibration of the colour camera.
    camera/aligned_depth_to_color/camera_info : sensor_msgs/CameraInfo
        As camera/color/camera_info, because depth is aligned to colour.
    /tf_static : tf2_msgs/TFMessage
        Frames of the camera, as children of the frame ~frame_prefix + "_link".
    /clock : rosgraph_msgs/Clock
        Time of a recording; only with ~publish_clock.
    """

    def __init__(self):
        self._params, self._camera_params = read_params(RealSenseNodeParams, RealSenseParams)
        librealsense(self._camera_params)  # report its errors before the worker waits for subscribers
        self._diagnostics = Diagnostics()
        self._pubs = {topic: rospy.Publisher(topic, TYPES[topic], queue_size=10)
                      for topic in (COLOR_TOPIC, DEPTH_TOPIC) + INFO_TOPICS}
        self._clock_pub = rospy.Publisher('/clock', Clock, queue_size=10) if self._params.publish_clock else None
        self._static_transforms = tf2_ros.StaticTransformBroadcaster()
        self.failed = False
        self._worker = threading.Thread(target=self._run, daemon=True)
        self._worker.start()
        rospy.on_shutdown(self._wait)

    def _wait(self):
        """Wait until the camera is closed: librealsense must not be torn down during a read."""
        if threading.current_thread() is not self._worker:
            self._worker.join(CLOSING_S)

    def _run(self):
        """Read the camera until shutdown, reconnecting whenever it is lost, and repeat a recording.

        This runs in a worker thread because rospy publishes from any thread except the main one.
        """
        try:
            wait_for_subscribers(self._pubs[COLOR_TOPIC], self._params.wait_for_subscribers,
                                 lambda: self._publish_time(START_NS))
            while not is_ending():
                try:
                    with contextlib.closing(RealSense(self._camera_params)) as camera:
                        rospy.loginfo('reading %s', self._camera_params.file or 'the camera')
                        self._read(camera)
                except CameraLost as error:
                    self._diagnostics.warn('camera lost', '%s; trying again every %.0f s' % (error, RETRY_S))
                    time.sleep(RETRY_S)
        except Exception as error:  # without this thread the node is useless, so it is shut down
            if not is_ending():
                self.failed = True
                rospy.logfatal('the camera cannot be read: %s; the node exits', error)
                rospy.signal_shutdown('the camera cannot be read')

    def _read(self, camera):
        links = frame_links(self._params.frame_prefix, camera.link_from_color)
        while not (is_ending() or camera.is_over):
            with self._diagnostics.rejecting('images'):
                frame = camera.read()
                if frame is not None:
                    self._publish(camera.camera, links, *frame)
                    links = ()  # /tf_static is latched
        if camera.is_over and not self._params.repeat:
            rospy.loginfo('the recording is over')
            time.sleep(SENDING_S)
            rospy.signal_shutdown('the recording is over')

    def _publish(self, camera, links, stamp_ns, color, depth):
        stamp = time_from(stamp_ns)
        self._publish_time(stamp_ns)
        if links:
            self._static_transforms.sendTransform(transform_messages(stamp, links))
        header = Header(stamp=stamp, frame_id=optical_frame(self._params.frame_prefix, 'color'))
        for topic, message in image_messages_of(CameraFrame(header, camera, color, depth, ())):
            self._pubs[topic].publish(message)
        self._diagnostics.count('images')
        self._diagnostics.record_latency(stamp)

    def _publish_time(self, stamp_ns):
        if self._clock_pub is not None:
            self._clock_pub.publish(Clock(time_from(stamp_ns)))


def main():
    """Run the node. The exit status is 1 if the camera or the recording could not be read."""
    sys.exit(run_node('realsense_node', RealSenseNode).failed)
