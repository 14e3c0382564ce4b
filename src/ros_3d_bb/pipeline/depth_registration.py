"""Register raw depth messages, with the camera_info of the depth camera and the transform between both cameras."""
from typing import Optional

import numpy as np
import tf2_ros
from sensor_msgs.msg import CameraInfo

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.camera.registration import Registration
from ros_3d_bb.conversions.perception_msgs import NEWEST, camera_from_msg
from ros_3d_bb.pipeline.transform_buffer import TransformBuffer


class DepthRegistration(object):
    """Register raw depth images to the colour camera.

    The latest transform is used, as the cameras are fixed to each other. `info_topic`, that of the depth camera's
    camera_info, is named in the error message if it is missing.
    """

    def __init__(self, transforms: TransformBuffer, info_topic: str) -> None:
        self._transforms, self._info_topic = transforms, info_topic
        self._depth_camera: Optional[Camera] = None
        self._geometry: Optional[Registration] = None

    def add_camera_info(self, message: CameraInfo) -> None:
        """Add a sensor_msgs/CameraInfo of the depth camera; it is used for all images until the next."""
        self._depth_camera = camera_from_msg(message)

    def geometry(self, depth: DepthImage, depth_frame: str, color_camera: Camera, color_frame: str) -> Registration:
        """Return the Registration for a DepthImage, given the optical frames of both cameras.

        Raises ValueError if there is no camera_info of depth, it has another size, or the transform is missing.
        """
        camera = self._depth_camera
        if camera is None:
            raise ValueError('raw depth cannot be registered: no camera_info of the depth camera received on %s'
                             % self._info_topic)
        if depth.shape != (camera.height, camera.width):
            raise ValueError('the depth image has %d x %d pixels, its camera_info on %s %d x %d'
                             % (depth.shape[1], depth.shape[0], self._info_topic, camera.width, camera.height))
        try:
            color_from_depth = self._transforms.lookup(color_frame, depth_frame, NEWEST)
        except tf2_ros.TransformException as error:
            raise ValueError('raw depth cannot be registered: there is no transform from %s to %s: %s; the driver of '
                             'the camera publishes it (realsense2_camera with publish_tf:=true)'
                             % (depth_frame, color_frame, error))
        known = self._geometry
        if known is None or (known.color_camera, known.depth_camera) != (color_camera, camera) or not np.array_equal(
                known.color_from_depth, color_from_depth):
            known = self._geometry = Registration(color_camera, camera, color_from_depth)
        return known
