"""ROS node that publishes the pose of a camera alone, from the floor in its depth images."""
import threading
from typing import NamedTuple

import rospy
import tf2_ros
from sensor_msgs.msg import Image

from ros_3d_bb.conversions.camera_msgs import DEPTH_TOPICS, INFO_TOPICS, RAW, info_topic_beside, transform_messages
from ros_3d_bb.core.params import DEPTH, DEPTH_SCALE, IMAGE_ROTATION, Param, parameters
from ros_3d_bb.nodes.common.diagnostics import Diagnostics
from ros_3d_bb.nodes.common.startup import read_params
from ros_3d_bb.nodes.common.subscribers import subscribe, subscribe_camera_info
from ros_3d_bb.nodes.common.tf_lookup import Transforms
from ros_3d_bb.pipeline.camera_pose import POSE_FITTED, POSE_TEXT, CameraPoseStage


@parameters()
class CameraPoseParams(NamedTuple):
    frame_world: str = Param('map')
    frame_id: str = Param('')
    image_rotation: str = IMAGE_ROTATION
    depth: str = DEPTH
    depth_scale: float = DEPTH_SCALE


class CameraPoseNode(object):
    """Publish the pose of a camera that is not on a robot, fitted to the floor in its depth images.

    Height, tilt and roll are the median of eight images within two seconds. The node then publishes a static transform
    from ~frame_world, whose z = 0 is the floor below the camera and whose x points ahead, to the root of the frames of
    the camera, and unsubscribes from its inputs. It is not for a camera that moves. Parameters:
    config/camera_pose.yaml.

    Subscribes
    ----------
    camera/aligned_depth_to_color/image_raw : sensor_msgs/Image
        Depth image; with ~depth raw on camera/depth/image_rect_raw.
    camera/color/camera_info : sensor_msgs/CameraInfo
        Calibration of the depth image, which is aligned to colour; with ~depth raw on camera/depth/camera_info.
    /tf,/tf_static : tf2_msgs/TFMessage
        Frames of the camera driver.

    Publishes
    ---------
    /tf_static : tf2_msgs/TFMessage
        Pose of the camera, once it is known.
    """

    def __init__(self):
        params, = read_params(CameraPoseParams)
        self._frame_world, self._diagnostics, self._lock = params.frame_world, Diagnostics(), threading.Lock()
        self._transforms, self._broadcaster = Transforms(wait_s=0), tf2_ros.StaticTransformBroadcaster()
        self._stage, self._is_done = CameraPoseStage(params), False
        self._diagnostics.show('pose', lambda: POSE_TEXT % self._stage.pose if self._is_done else 'unknown')
        depth_topic = DEPTH_TOPICS[params.depth][0]
        info_topic = info_topic_beside(rospy.resolve_name(depth_topic)) if params.depth == RAW else INFO_TOPICS[0]
        self._unsubscribers = (subscribe_camera_info(info_topic, depth_topic, self._on_camera_info, 1),
                               subscribe(depth_topic, Image, self._on_depth, 1))

    def _on_camera_info(self, message):
        with self._diagnostics.receiving('camera_info'), self._lock:
            self._stage.add_camera_info(message)

    def _on_depth(self, message):
        with self._diagnostics.receiving('depth images'), self._lock:
            if self._is_done:
                return
            is_visible = self._stage.add_depth(message)
            if is_visible is not None:
                self._diagnostics.count('images processed')
            if is_visible is False:
                self._diagnostics.warn('images without floor', 'no floor is visible in the depth image, so that the '
                                       'pose of the camera remains unknown; waiting for the next, or measure the pose, '
                                       'and pass camera_height:= and camera_tilt:=')
            if self._stage.is_complete:
                self._publish(message.header.stamp)

    def _publish(self, stamp):
        link = self._transforms.link_to_root(self._frame_world, self._stage.frame_id, self._stage.floor_from_camera)
        self._broadcaster.sendTransform(transform_messages(stamp, [link]))
        self._is_done = True
        for unsubscribe in self._unsubscribers:
            unsubscribe()
        self._diagnostics.note(POSE_FITTED, '%s (from %s to %s)' % ((POSE_TEXT % self._stage.pose,) + link[:2]))
