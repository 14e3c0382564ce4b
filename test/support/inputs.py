"""All nodes that receive messages, by name and detector, and valid messages for them: a person at 2 m."""
import copy
from typing import Callable, NamedTuple
from unittest import mock

import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion, Twist, Vector3
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

from ros_3d_bb.camera.camera_model import OPTICAL_ROTATION, Camera, transform_from
from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.conversions.camera_msgs import CameraFrame, messages_of, transform_messages
from ros_3d_bb.conversions.perception_msgs import BOXES3D_TOPIC, BOXES_TOPIC, TRACKS_TOPIC, boxes2d_to_msg, time_from
from ros_3d_bb.conversions.planner_msgs import points_to_msg
from ros_3d_bb.detection.yolov5.predictions import Backend
from ros_3d_bb.msg import BoundingBox3D, BoundingBox3DArray, TrackedObjectArray
from ros_3d_bb.nodes.bbox3d_node import Bbox3dNode
from ros_3d_bb.nodes.camera_pose_node import CameraPoseNode
from ros_3d_bb.nodes.detector_node import DetectorNode
from ros_3d_bb.nodes.follow_node import FollowNode
from ros_3d_bb.nodes.people_removal_node import PeopleRemovalNode
from ros_3d_bb.nodes.planner_bridge_node import PlannerBridgeNode
from ros_3d_bb.nodes.speed_limit_node import SpeedLimitNode
from ros_3d_bb.nodes.tracker_node import TrackerNode
from ros_3d_bb.nodes.viewer_node import ViewerNode
from support.masterless import on_the_wire
from support.ros import header_at, person

CAMERA = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)


class Blind(Backend):
    """A network that detects nothing."""

    names, stride, description = ('person', 'chair'), 32, 'blind'

    def __call__(self, _image, least):
        return np.zeros((0, 7), np.float32)


def _yolov5():
    with mock.patch('ros_3d_bb.detection.yolov5.backends.open_runtime', lambda *_given: Blind()):
        return DetectorNode()


class Target(NamedTuple):
    make: Callable
    params: dict
    output: str  # topic on which it responds to valid messages, if there is one


TARGETS = {
    'bbox3d_node': Target(Bbox3dNode, {}, BOXES3D_TOPIC),
    'tracker_node': Target(TrackerNode, {'tf_timeout': 0.0}, TRACKS_TOPIC),
    'detector_node': Target(DetectorNode, {'detector': 'depth'}, BOXES_TOPIC),
    'detector_node yolov5': Target(
        _yolov5, {'detector': 'yolov5', 'weights': 'blind.pt', 'image_size': 64}, BOXES_TOPIC),
    'camera_pose_node': Target(CameraPoseNode, {}, ''),
    'people_removal_node': Target(PeopleRemovalNode, {'inputs': 'scan, points', 'tf_timeout': 0.0},
                                  '~scan_static'),
    'planner_bridge_node': Target(PlannerBridgeNode, {'tf_timeout': 0.0}, '~points'),
    'follow_node': Target(FollowNode, {'enabled': True}, ''),
    'speed_limit_node': Target(SpeedLimitNode, {}, 'cmd_vel'),
    'viewer_node': Target(ViewerNode, {'window': False}, '')}


def good_messages(stamp_ns):
    """Messages {topic: message} of a valid image of a person at 2 m, its boxes and tracks, in the order of sending."""
    depth_mm = np.full((CAMERA.height, CAMERA.width), 4000, np.uint16)
    depth_mm[8:44, 26:38] = 2000
    header = header_at(stamp_ns, 'camera')
    messages = dict(messages_of(CameraFrame(copy.copy(header), CAMERA, np.full(depth_mm.shape + (3,), 90, np.uint8),
                                            DepthImage(depth_mm, 0.001), [])))
    messages[BOXES_TOPIC] = boxes2d_to_msg(np.array([[26, 8, 38, 44]]), header)
    box = BoundingBox3D(center=Pose(Point(0, 0, 3), Quaternion(w=1)), size=Vector3(0.5, 1.7, 0.5))
    messages[BOXES3D_TOPIC] = BoundingBox3DArray(header=header, boxes=[box])
    messages[TRACKS_TOPIC] = TrackedObjectArray(header=header, objects=[person(1, 2.0, 0.0)])
    messages['~scan'] = LaserScan(header=header, angle_increment=0.1, ranges=[1.0, 2.0, 3.0])
    messages['~points'] = points_to_msg(np.ones((3, 3)), header)
    messages['cmd_vel_in'] = Twist(linear=Vector3(0.5, 0, 0), angular=Vector3(0, 0, 0.1))
    return messages


def transforms(stamp_ns):
    return TFMessage(transform_messages(time_from(stamp_ns), [
        ('map', 'base_link', np.eye(4)), ('base_link', 'camera', transform_from((0, 0, 0), OPTICAL_ROTATION))]))


def send_image(connections, stamp_ns, messages=None):
    """At the time of a stamp, send transforms and the messages of an image (by default valid ones) to subscribers."""
    connections.now = time_from(stamp_ns)
    if '/tf' in connections.subscribers:
        connections.send('/tf', on_the_wire(transforms(stamp_ns)))
    for topic, message in (messages or good_messages(stamp_ns)).items():
        if topic in connections.subscribers:
            connections.send(topic, on_the_wire(message))
