"""Messages of an RGB-D camera on a robot: images, camera_info and transforms, on the topics of realsense2_camera."""
import copy
import re
from typing import Any, Iterable, Iterator, List, NamedTuple, Sequence, Tuple

import genpy
import numpy as np
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from ros_3d_bb.camera.camera_model import Camera, quaternion_from
from ros_3d_bb.camera.distortion import PLUMB_BOB
from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.conversions.image_msgs import fill_image, is_compressed, pixels_from
from ros_3d_bb.core.time_sync import NS

TF_TOPIC, STATIC_TOPIC = 'tf', 'tf_static'
COLOR_TOPIC, DEPTH_TOPIC = 'camera/color/image_raw', 'camera/aligned_depth_to_color/image_raw'
INFO_TOPICS = ('camera/color/camera_info', 'camera/aligned_depth_to_color/camera_info')
RAW = 'raw'  # value of ~depth
# Topics of the depth image and of its camera_info, by the parameter ~depth.
DEPTH_TOPICS = {'aligned': (DEPTH_TOPIC, INFO_TOPICS[1]),
                RAW: ('camera/depth/image_rect_raw', 'camera/depth/camera_info')}
# Topic of the images with the intrinsics of the colour camera_info, by ~depth; see `info_of_images`.
COLOR_INFO_IMAGES = {'aligned': DEPTH_TOPIC, RAW: COLOR_TOPIC}
CAMERA = 'camera'  # namespace of the topics of a single camera
Link = Tuple[str, str, np.ndarray]  # parent, child, parent_from_child (4, 4)
TYPES = {TF_TOPIC: TFMessage, COLOR_TOPIC: Image, DEPTH_TOPIC: Image, INFO_TOPICS[0]: CameraInfo,
         INFO_TOPICS[1]: CameraInfo}
IMAGE_KINDS = Image, CompressedImage  # that the nodes accept as an image
TRANSPORTS = 'compressed', 'compressedDepth'  # of image_transport; last part of the name of a topic
RECTIFIED = re.compile('(^|_)rect(_|$)')  # part of the name of a rectified image, as in image_rect_color
START_NS = 1600000000 * NS  # start of scenes and bags: arbitrary but fixed


class CameraFrame(NamedTuple):
    """One colour and depth image of a camera.

    `color` has shape (h, w, 3), uint8 RGB; `transforms` is a sequence of (parent, child, parent_from_child (4, 4)) from
    the map to the optical frame of the camera.
    """

    header: Header
    camera: Camera
    color: np.ndarray
    depth: DepthImage
    transforms: Sequence[Any]


def absolute(name: str) -> str:
    return '/' + name.lstrip('/')


def topic_of(camera_name: str, topic: str) -> str:
    """Return the name of a topic for a camera, given by its namespace; '' for a single camera.

    Images are on the topics of a driver with that camera name (front/color/image_raw), results are in the same
    namespace (front/ros_3d_bb/bb_3d).
    """
    if not camera_name:
        return topic
    return '%s/%s' % (camera_name, topic[len(CAMERA) + 1:] if topic.startswith(CAMERA + '/') else topic)


def info_topic_beside(image_topic: str) -> str:
    """Return the topic of the camera_info of an image topic, which may be that of a compressed transport."""
    return '/'.join(_names_of(image_topic)[:-1] + ['camera_info'])


def info_of_images(message: CameraInfo, image_topic: str) -> CameraInfo:
    """Return the sensor_msgs/CameraInfo of the images on a topic.

    Rectified images, which the name of their topic tells (image_rect, image_color_rect), have the intrinsics P and no
    distortion, although they share the camera_info of the raw images (sensor_msgs/CameraInfo).
    """
    if not (RECTIFIED.search(_names_of(image_topic)[-1]) and message.P[0] > 0):
        return message
    rectified = copy.copy(message)
    rectified.D, rectified.K = (), message.P[:3] + message.P[4:7] + message.P[8:11]
    return rectified


def _names_of(image_topic: str) -> List[str]:
    parts = image_topic.split('/')
    return parts[:-1] if parts[-1] in TRANSPORTS else parts


def uncompressed(message: Any) -> Image:
    """Return an image message as sensor_msgs/Image. Raises ValueError as `image_msgs.pixels_from`."""
    if not is_compressed(message):
        return message
    return fill_image(Image(header=message.header), *pixels_from(message))


def messages_of(frame: CameraFrame) -> Iterator[Tuple[str, Any]]:
    """Yield (topic, message) of one CameraFrame, in the order in which a robot publishes them."""
    yield TF_TOPIC, TFMessage(transform_messages(frame.header.stamp, frame.transforms))
    yield from image_messages_of(frame)


def image_messages_of(frame: CameraFrame) -> Iterator[Tuple[str, Any]]:
    """Yield (topic, message) of one CameraFrame without its transforms."""
    header, depth = frame.header, frame.depth
    for topic in INFO_TOPICS:
        yield topic, _camera_info(frame.camera, header)
    if depth.scale_m == 0.001:  # REP 118: 16UC1 is in millimetres, 32FC1 in metres
        yield DEPTH_TOPIC, fill_image(Image(header=header), depth.values, '16UC1')
    else:
        yield DEPTH_TOPIC, fill_image(Image(header=header), (depth.values * depth.scale_m).astype(np.float32), '32FC1')
    yield COLOR_TOPIC, fill_image(Image(header=header), frame.color, 'rgb8')


def transform_messages(stamp: genpy.Time, links: Iterable[Link]) -> List[TransformStamped]:
    """Convert (parent, child, parent_from_child (4, 4)) links to a list of TransformStamped."""
    messages = []
    for parent, child, parent_from_child in links:
        message = TransformStamped(header=Header(stamp=stamp, frame_id=parent), child_frame_id=child)
        message.transform.translation = Vector3(*parent_from_child[:3, 3].tolist())
        message.transform.rotation = Quaternion(*quaternion_from(parent_from_child).tolist())
        messages.append(message)
    return messages


def _camera_info(camera: Camera, header: Header) -> CameraInfo:
    info = CameraInfo(header=header, width=camera.width, height=camera.height)
    info.distortion_model, info.D = camera.distortion_model or PLUMB_BOB, list(camera.distortion) or [0.0] * 5
    info.K = [camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1]
    info.R = [1, 0, 0, 0, 1, 0, 0, 0, 1]
    info.P = [camera.fx, 0, camera.cx, 0, 0, camera.fy, camera.cy, 0, 0, 0, 1, 0]
    return info


def frame_id_of(camera_name: str) -> str:
    """Return the frame of the images of a camera, given by its name; '' for a single camera."""
    return '%s_color_optical_frame' % (camera_name or CAMERA)
