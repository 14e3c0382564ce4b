"""The frame in which people are tracked, and the conversion of their tracks to that in which they are published."""
import re
from typing import List, NamedTuple, Optional

import genpy
import numpy as np

from ros_3d_bb.camera.camera_model import transform_points
from ros_3d_bb.pipeline.transform_buffer import TransformBuffer
from ros_3d_bb.tracking.types import TrackedObject

AUTO = 'auto'
ODOM = re.compile('(^|[/_])odom')  # as in odom, robot1/odom and odom_combined


class ImagePose(NamedTuple):
    """Poses at the stamp of an image, (4, 4): of its camera in the target frame and in the tracking frame, and of the
    tracking frame in the target frame, None if both are the same.
    """

    target_from_camera: np.ndarray
    tracking_from_camera: np.ndarray
    target_from_tracking: Optional[np.ndarray] = None

    def in_target(self, points_m: np.ndarray) -> np.ndarray:
        """Points (n, 3) of the tracking frame in the target frame."""
        return points_m if self.target_from_tracking is None else transform_points(self.target_from_tracking, points_m)


class TrackingFrame(object):
    """The frame of ~tracking_frame.

    A localisation corrects the pose of `odom` in `map` from time to time (REP 105), and tf2 interpolates between two
    corrections: in `map`, people who stand would move for some images. In `odom`, the pose of the robot is continuous.
    """

    def __init__(self, transforms: TransformBuffer, tracking_frame: str, target_frame: str) -> None:
        self._transforms, self._target = transforms, target_frame
        self._name = None if tracking_frame == AUTO else tracking_frame.lstrip('/')

    def pose(self, camera_frame: str, stamp: genpy.Time) -> ImagePose:
        """The ImagePose at a stamp. Raises tf2_ros.TransformException."""
        target_from_camera = self._transforms.lookup(self._target, camera_frame, stamp)
        if self._name is None:
            self._name = self._continuous_frame(camera_frame)
        if self._name == self._target:
            return ImagePose(target_from_camera, target_from_camera)
        tracking_from_camera = self._transforms.lookup(self._name, camera_frame, stamp)
        return ImagePose(target_from_camera, tracking_from_camera,
                         target_from_camera.dot(np.linalg.inv(tracking_from_camera)))

    def _continuous_frame(self, camera_frame: str) -> str:
        """The odometry frame next to the target frame, between it and a camera; the target frame if there is none."""
        path = self._transforms.ancestors(camera_frame)
        between = path[:path.index(self._target)] if self._target in path else []
        return ([self._target] + [frame for frame in between if ODOM.search(frame)])[-1]


def transformed(tracks: List[TrackedObject], target_from_tracking: Optional[np.ndarray]) -> List[TrackedObject]:
    """Convert a list of `types.TrackedObject` to another frame, given its pose (4, 4); None: the same frame."""
    if not tracks or target_from_tracking is None:
        return tracks
    rotation, shift_m = target_from_tracking[:3, :3], target_from_tracking[:3, 3]
    both = np.kron(np.eye(2), rotation)
    positions_m = np.array([track.position_m for track in tracks]).dot(rotation.T) + shift_m
    velocities_mps = np.array([track.velocity_mps for track in tracks]).dot(rotation.T)
    covariances = both @ np.array([track.covariance for track in tracks]) @ both.T
    predictions_m = np.array([track.prediction_m for track in tracks]) @ rotation.T + shift_m
    predictions_m2 = rotation @ np.array([track.prediction_covariance_m2 for track in tracks]) @ rotation.T
    return [track._replace(position_m=position_m, velocity_mps=velocity_mps, covariance=covariance,
                           prediction_m=prediction_m, prediction_covariance_m2=prediction_m2)
            for track, position_m, velocity_mps, covariance, prediction_m, prediction_m2
            in zip(tracks, positions_m, velocities_mps, covariances, predictions_m, predictions_m2)]
