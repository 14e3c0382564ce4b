"""Whether depth is aligned to colour, by what the cameras of both say."""
import rospy
from sensor_msgs.msg import CameraInfo

from ros_3d_bb.camera.alignment import ALIGN, frames_fault, intrinsics_fault
from ros_3d_bb.conversions.camera_msgs import DEPTH_TOPIC
from ros_3d_bb.conversions.perception_msgs import camera_from_msg


class DepthCameraCheck(object):
    """Compares the camera_info beside the depth image with that of colour.

    The node sets what came last: `color`, a CameraInfo, and `depth_frame`. `with_frames`: whether the names of their
    frames can be relied on. The topic stays subscribed: at a new subscription rospy would wait for a master that is
    away, and hold up all that asks it.

    Subscribes
    ----------
    camera/aligned_depth_to_color/camera_info : sensor_msgs/CameraInfo
        Of the depth image: what is beside that, whatever it is called. It is compared with that of the colour camera.
    """

    def __init__(self, with_frames):
        self._with_frames = with_frames
        self.color, self.depth_frame = None, ''
        self._depth = None
        topic = rospy.resolve_name(DEPTH_TOPIC).rpartition('/')[0] + '/camera_info'
        rospy.Subscriber(topic, CameraInfo, self._on_depth_camera, queue_size=1)

    def faults(self):
        """(event, sentence) of what is wrong now. Asked once a second."""
        color = self.color
        if color is None:
            return
        fault = self._with_frames and frames_fault(color.header.frame_id, self.depth_frame)
        fault = fault or self._intrinsics_fault(color)
        if fault:
            yield 'alignment', 'depth is not aligned to colour: %s; positions are wrong; %s' % (fault, ALIGN)

    def _intrinsics_fault(self, color):
        depth = self._depth
        if depth is None:
            return ''
        try:
            return intrinsics_fault(camera_from_msg(color), camera_from_msg(depth))
        except ValueError:  # of colour the node says so; many drivers leave that of depth empty
            return ''

    def _on_depth_camera(self, message):
        self._depth = message
