"""Whether depth is aligned to colour, by what the cameras of both say."""
import time

import rospy
from sensor_msgs.msg import CameraInfo

from ros_3d_bb.camera_messages import DEPTH_TOPIC
from ros_3d_bb.diagnosis.camera_faults import ALIGN, frames_fault, intrinsics_fault
from ros_3d_bb.messages import camera_from_message

AGAIN_S = 10.0  # until they are compared again: the driver may have been started anew


class DepthCameraCheck(object):
    """Compares the camera_info beside the depth image with that of colour, now and then: it listens until they agree.

    The node sets what came last: `color`, a CameraInfo, and `depth_frame`. `with_frames`: whether the names of their
    frames can be relied on. The topic, camera/aligned_depth_to_color/camera_info or what is beside the depth image, is
    subscribed only meanwhile.
    """

    def __init__(self, with_frames):
        self._with_frames = with_frames
        self.color, self.depth_frame = None, ''
        self._agreed, self._agreed_s, self._depth, self._subscriber = None, None, None, None

    def faults(self):
        """(event, sentence) of what is wrong now. Asked once a second."""
        color = self.color
        if color is None:
            return
        fault = self._with_frames and frames_fault(color.header.frame_id, self.depth_frame)
        fault = fault or self._intrinsics_fault(color)
        if fault:
            yield 'alignment', 'depth is not aligned to colour: %s; positions are wrong; %s' % (fault, ALIGN)

    def _intrinsics_fault(self, message):
        try:
            color = camera_from_message(message)
        except ValueError:  # the node says so
            return ''
        if color == self._agreed and time.monotonic() - self._agreed_s < AGAIN_S:
            return ''
        if self._subscriber is None:
            topic = rospy.resolve_name(DEPTH_TOPIC).rpartition('/')[0] + '/camera_info'
            self._subscriber = rospy.Subscriber(topic, CameraInfo, self._on_depth_camera, queue_size=1)
        fault = intrinsics_fault(color, self._depth) if self._depth is not None else ''
        if self._depth is not None and not fault:
            self._subscriber.unregister()
            self._agreed, self._agreed_s, self._depth, self._subscriber = color, time.monotonic(), None, None
        return fault

    def _on_depth_camera(self, message):
        try:
            self._depth = camera_from_message(message)
        except ValueError:  # many drivers leave that of depth empty
            self._depth = None
