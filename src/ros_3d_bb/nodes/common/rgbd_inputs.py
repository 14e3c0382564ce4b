"""Subscribers of the depth images and camera_info of an RGB-D camera, of which frames are made."""
import threading

import rospy
from sensor_msgs.msg import Image

from ros_3d_bb.conversions.camera_msgs import COLOR_INFO_IMAGES, DEPTH_TOPICS, INFO_TOPICS, RAW, info_topic_beside
from ros_3d_bb.core.time_sync import arrival_clock_ns
from ros_3d_bb.nodes.common.subscribers import KEPT_AT_ONCE, subscribe, subscribe_camera_info
from ros_3d_bb.nodes.common.tf_lookup import Transforms
from ros_3d_bb.pipeline.camera_pipeline import CameraPipeline
from ros_3d_bb.pipeline.rgbd_source import RgbdSource


class RgbdInputs(object):
    """Pass the messages of a camera to a CameraPipeline: the attribute `pipeline`. `lock` guards its source.

    The arguments are those of the RgbdSource, except for `transforms`: if they are None, the node gets its own.

    Subscribes
    ----------
    camera/aligned_depth_to_color/image_raw : sensor_msgs/Image
        Depth image, aligned to the colour image. With ~depth raw, the images are on camera/depth/image_rect_raw and
        their camera_info on camera/depth/camera_info; the node registers them to the colour image, using the transform
        between both cameras in tf.
    camera/color/camera_info : sensor_msgs/CameraInfo
        Calibration of the colour camera.
    /tf,/tf_static : tf2_msgs/TFMessage
        Transform from ~floor_frame to the camera, for its tilt and the floor, and between the cameras for raw depth.
        Not used if ~floor_frame is empty and depth is aligned.
    """

    def __init__(self, params, diagnostics, transforms, **of_source):
        self._diagnostics, self.lock = diagnostics, threading.Lock()
        depth_topic, is_raw = DEPTH_TOPICS[params.depth][0], params.depth == RAW
        depth_info_topic = info_topic_beside(rospy.resolve_name(depth_topic))
        if transforms is None and (params.floor_frame or is_raw):
            transforms = Transforms(wait_s=0)
            diagnostics.show('tf age', transforms.age)
        topics = rospy.resolve_name(depth_topic), depth_info_topic, rospy.resolve_name(INFO_TOPICS[0])
        self.pipeline = CameraPipeline(
            lambda on_match: RgbdSource(params, diagnostics, on_match, transforms, topics, **of_source))
        source = self.pipeline.source
        # Depth images are cached until their boxes arrive, so the subscriber queues must not drop any.
        subscribe(depth_topic, Image, self.receiver('depth images', source.add_depth), KEPT_AT_ONCE)
        subscribe_camera_info(INFO_TOPICS[0], COLOR_INFO_IMAGES[params.depth],
                              self.receiver('camera_info', source.add_camera_info))
        if is_raw:
            subscribe_camera_info(depth_info_topic, depth_topic,
                                  self.receiver('camera_info of depth', source.add_depth_camera_info), 1)

    def receiver(self, inputs, add):
        """Return a callback that passes a message, with its arrival time, to an `add_` method of the source."""
        def on_message(message, *others):
            with self._diagnostics.receiving(inputs), self.lock:
                add(message, arrival_clock_ns(), *others)
        return on_message
