"""The views of a camera: what the tracker knows about its images beside the boxes."""
import functools
from typing import Any, Optional

import numpy as np
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header

from ros_3d_bb.camera.camera_model import Camera, transform_points
from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.camera.registration import Registration
from ros_3d_bb.conversions.camera_msgs import DEPTH_TOPICS, RAW, topic_of
from ros_3d_bb.conversions.image_msgs import imgmsg_to_depth
from ros_3d_bb.conversions.perception_msgs import camera_from_msg, stamp_of
from ros_3d_bb.core.event_counter import EventCounter
from ros_3d_bb.core.time_sync import NS, MessageCache
from ros_3d_bb.pipeline.depth_registration import DepthRegistration
from ros_3d_bb.pipeline.transform_buffer import TransformBuffer
from ros_3d_bb.tracking.occlusion import depths_towards
from ros_3d_bb.tracking.types import CameraView


class CameraViews(object):
    """Makes the `types.CameraView` of each image of a camera from camera_info and depth images, if there are any.

    `params` are TrackerNodeParams. Depth images have an arrival time `now_ns`, see `tracking_stage.TrackingStage`.
    """

    def __init__(self, params: Any, events: EventCounter, transforms: TransformBuffer, camera_name: str) -> None:
        self._params, self._events, self._camera_name = params, events, camera_name
        self._camera: Optional[Camera] = None
        self._depths = MessageCache(int(params.depth_cache_length * NS))
        self._registration = DepthRegistration(transforms, topic_of(camera_name, DEPTH_TOPICS[RAW][1]))

    def add_camera_info(self, message: CameraInfo) -> None:
        """Add a sensor_msgs/CameraInfo. Raises ValueError if it is invalid."""
        self._camera = camera_from_msg(message)

    def add_depth_camera_info(self, message: CameraInfo) -> None:
        """Add a sensor_msgs/CameraInfo of the depth camera, for raw depth. Raises ValueError if it is invalid."""
        self._registration.add_camera_info(message)

    def add_depth(self, message: Image, now_ns: int) -> None:
        """Add a depth image. Raises ValueError if it has no stamp; if it is invalid otherwise, it is counted."""
        stamp_ns = stamp_of(message)
        with self._events.rejecting('depth images'):
            depth = imgmsg_to_depth(message, self._params.depth_scale)
            self._depths.add(stamp_ns, now_ns, (depth, message.header.frame_id))

    def view(self, header: Header, fixed_from_camera: np.ndarray) -> CameraView:
        """The CameraView of boxes with this header, given the pose (4, 4) of the camera."""
        view = CameraView(fixed_from_camera, self._camera, self._camera_name)
        entry = self._depths.matching(header.stamp.to_nsec(), int(self._params.stamp_tolerance * NS))
        if self._camera is None or entry is None:
            return view
        depth, depth_frame = entry.value
        return self._with_depth(view, self._camera, depth, depth_frame, self._params.camera_frame or header.frame_id)

    def _with_depth(self, view: CameraView, camera: Camera, depth: DepthImage, depth_frame: str,
                    camera_frame: str) -> CameraView:
        """Return a CameraView with a depth image; without one that cannot be used, which bbox3d_node reports."""
        if self._params.depth != RAW:
            if depth.shape != (camera.height, camera.width):
                return view
            return view._replace(depth_at=functools.partial(depths_towards, camera, depth),
                                 measured_area=depth.measured_area)
        try:
            geometry = self._registration.geometry(depth, depth_frame, camera, camera_frame)
        except ValueError:
            return view
        return view._replace(depth_at=functools.partial(_depths_from_beside, geometry, depth),
                             measured_area=lambda: geometry.area_px)

    def outline_m(self, fixed_from_camera: np.ndarray, range_m: float) -> Optional[np.ndarray]:
        """Outline (3, 2) of the field of view up to a range; None while the camera is unknown."""
        return None if self._camera is None else CameraView(fixed_from_camera, self._camera).outline(range_m)


def _depths_from_beside(geometry: Registration, depth: DepthImage, points: np.ndarray) -> np.ndarray:
    """As `depths_towards`, for raw depth: measured towards the points from the depth camera beside the view."""
    points_there = transform_points(np.linalg.inv(geometry.color_from_depth), points)
    share = depths_towards(geometry.depth_camera, depth, points_there) / points_there[:, 2]
    beside_m = geometry.color_from_depth[2, 3]
    return beside_m + share * (points[:, 2] - beside_m)
