"""Check from camera_info and frame_id that depth images are aligned to colour images."""
import rospy
from sensor_msgs.msg import CameraInfo

from ros_3d_bb.camera.alignment import ALIGN, frames_fault, intrinsics_fault
from ros_3d_bb.conversions.camera_msgs import DEPTH_TOPIC
from ros_3d_bb.conversions.perception_msgs import camera_from_msg


class DepthCameraCheck(object):
    """Compare the camera_info of the depth camera with that of the colour camera.

    The node sets the attributes `color` (the latest CameraInfo) and `depth_frame`. `with_frames` states whether the
    frame names are reliable. The topic stays subscribed: on a new subscription, rospy would wait for an unreachable
    master and block all other requests to it.

    Subscribes
    ----------
    camera/aligned_depth_to_color/camera_info : sensor_msgs/CameraInfo
        Calibration of the depth image, in the namespace of its topic (remapped or not). It is compared with that of
        the colour camera.
    """

    def __init__(self, with_frames):
        self._with_frames = with_frames
        self.color, self.depth_frame = None, ''
        self._depth = None
        topic = rospy.resolve_name(DEPTH_TOPIC).rpartition('/')[0] + '/camera_info'
        rospy.Subscriber(topic, CameraInfo, self._on_depth_camera, queue_size=1)

    def faults(self):
        """Yield (event, sentence) for each current fault. Called once per second."""
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
        except ValueError:  # the node reports colour; many drivers leave depth's K empty
            return ''

    def _on_depth_camera(self, message):
        self._depth = message
