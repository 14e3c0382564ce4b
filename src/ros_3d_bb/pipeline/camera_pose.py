"""Pose of a camera that tf does not contain, from the floor in its depth images."""
from typing import Any, List, Optional

import numpy as np
from sensor_msgs.msg import CameraInfo, Image


from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.camera.images import mounted_camera, turned_camera, turned_depth, turns_for
from ros_3d_bb.conversions.camera_msgs import RAW
from ros_3d_bb.conversions.image_msgs import imgmsg_to_depth
from ros_3d_bb.conversions.perception_msgs import camera_from_msg, stamp_of
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.detection.depth.ground_plane import CameraPose, Floor, camera_pose_above, fit_floor

FLOOR = 'floor'  # value of the option and the launch argument camera_pose
POSE_FITTED = 'poses fitted to the floor'  # event
POSE_TEXT = 'the camera is %.2f m above the floor, tilted by %.2f rad and rolled by %.2f rad'  # of a CameraPose
# Both are chosen: within two seconds, people who hide the floor move.
IMAGES, PERIOD_NS = 8, NS // 4


class CameraPoseStage(object):
    """Fits the pose of a camera to the floor in its depth images, of which at most one each `PERIOD_NS` is used.

    With raw depth, it is the pose of the depth camera, which tf connects with the colour camera. `params` has ~depth,
    ~depth_scale, ~frame_id and ~image_rotation.
    """

    def __init__(self, params: Any) -> None:
        self._params, self._turns = params, turns_for(params.image_rotation, None)
        self._camera: Optional[Camera] = None
        self._used_ns: Optional[int] = None
        self._floors: List[Floor] = []
        self.frame_id = ''  # optical frame of the depth images

    def add_camera_info(self, message: CameraInfo) -> None:
        """Add a sensor_msgs/CameraInfo of the depth images. Raises ValueError if it is invalid."""
        self._camera = camera_from_msg(message)

    def add_depth(self, message: Image) -> Optional[bool]:
        """Add a sensor_msgs/Image of depth. Images before the first camera_info, and most others, are skipped.

        Returns whether the floor is visible; None if the image is skipped. Raises ValueError if it is invalid.
        """
        stamp_ns, camera = stamp_of(message), self._camera
        if camera is None or self._used_ns is not None and abs(stamp_ns - self._used_ns) < PERIOD_NS:
            return None
        depth = imgmsg_to_depth(message, self._params.depth_scale, check_unit=True)
        if depth.shape != (camera.height, camera.width):
            raise ValueError('the depth image has %d x %d pixels and its camera %d x %d; equal sizes expected'
                             % (depth.shape[::-1] + camera[:2]))
        self._used_ns = stamp_ns
        self.frame_id = (self._params.frame_id if self._params.depth != RAW else '') or message.header.frame_id
        floor = fit_floor(turned_depth(depth, self._turns), turned_camera(camera, self._turns))
        if floor is not None:
            self._floors.append(floor)
        return floor is not None

    @property
    def is_complete(self) -> bool:
        return len(self._floors) >= IMAGES

    @property
    def pose(self) -> Optional[CameraPose]:
        """The `ground_plane.CameraPose`; None if no image shows the floor."""
        return camera_pose_above(self._floors) if self._floors else None

    @property
    def floor_from_camera(self) -> Optional[np.ndarray]:
        """Pose (4, 4) of `frame_id` in a frame on the floor below the camera, z up and x ahead; None if no image shows
        the floor."""
        pose = self.pose
        return None if pose is None else mounted_camera(pose.height_m, pose.tilt_rad, self._turns, pose.roll_rad)
