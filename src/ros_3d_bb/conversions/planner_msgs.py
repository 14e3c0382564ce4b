"""Conversion of tracks to the input messages of planners.

Message classes of optional packages are passed as an argument, the `msg` module of the package. Tracks are lists of
`types.TrackedObject` in the frame of the header.
"""
from typing import Any, Sequence, Tuple

import numpy as np
from geometry_msgs.msg import Point, Point32, Pose, PoseStamped, Quaternion, Twist
from nav_msgs.msg import MapMetaData, OccupancyGrid
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Header

from ros_3d_bb.conversions.perception_msgs import tracks_to_msg
from ros_3d_bb.core.object_classes import COCO
from ros_3d_bb.msg import TrackedObject
from ros_3d_bb.tracking.types import TrackedObject as Track

STATUS_NAMES = {TrackedObject.VISIBLE: 'visible', TrackedObject.OCCLUDED: 'occluded',
                TrackedObject.OUT_OF_VIEW: 'out of view'}
UNSEEN_RELIABILITY = 0.5  # of tracks that are not visible in the latest image
CLASSIFICATIONS = {'person': 'PEDESTRIAN', 'bicycle': 'BIKE', 'car': 'CAR', 'truck': 'TRUCK',
                   'motorcycle': 'MOTORCYCLE', 'bus': 'OTHER_VEHICLE'}  # of derived_object_msgs/Object


def people_to_msg(tracks: Sequence[Track], header: Header, people_msgs: Any) -> Any:
    """Convert tracks of all classes to people_msgs/People; class, score, status and size (metres) are in the tags."""
    return people_msgs.People(header=header, people=[people_msgs.Person(
        name=str(track.id), position=Point(*track.position_m), velocity=Point(*track.velocity_mps),
        reliability=_reliability(track), tagnames=['label', 'score', 'status', 'width', 'height'],
        tags=[track.label, '%.2f' % track.score, STATUS_NAMES.get(track.status, 'unknown'), '%.2f' % track.size_m[0],
              '%.2f' % track.size_m[2]])
        for track in tracks])


def obstacles_to_msg(tracks: Sequence[Track], header: Header, costmap_converter: Any) -> Any:
    """Convert tracks to costmap_converter/ObstacleArrayMsg: circles given by one point (float32) and a radius."""
    obstacles = []
    for track in tracks_to_msg(tracks, header).objects:
        obstacle = costmap_converter.ObstacleMsg(header=header, id=track.id, radius=track.size.x / 2,
                                                 orientation=Quaternion(w=1.0), velocities=track.twist)
        position = track.pose.pose.position
        obstacle.polygon.points = [Point32(position.x, position.y, position.z)]
        obstacles.append(obstacle)
    return costmap_converter.ObstacleArrayMsg(header=header, obstacles=obstacles)


def objects_to_msg(tracks: Sequence[Track], header: Header, derived_object_msgs: Any) -> Any:
    """Convert tracks to derived_object_msgs/ObjectArray: upright cylinders, classified by `CLASSIFICATIONS`."""
    objects = []
    for track in tracks_to_msg(tracks, header).objects:
        name = CLASSIFICATIONS.get(track.label, 'UNKNOWN')
        item = derived_object_msgs.Object(header=header, id=track.id, pose=track.pose.pose, twist=track.twist.twist,
                                          object_classified=name != 'UNKNOWN',
                                          classification_certainty=int(round(255 * (track.score or 1.0))))
        item.detection_level, item.classification = item.OBJECT_TRACKED, getattr(item, 'CLASSIFICATION_' + name)
        item.shape.type, item.shape.dimensions = item.shape.CYLINDER, [0.0, 0.0]
        item.shape.dimensions[item.shape.CYLINDER_HEIGHT] = track.size.z
        item.shape.dimensions[item.shape.CYLINDER_RADIUS] = track.size.x / 2
        objects.append(item)
    return derived_object_msgs.ObjectArray(header=header, objects=objects)


def detections3d_to_msg(tracks: Sequence[Track], header: Header, vision_msgs: Any) -> Any:
    """Convert tracks to vision_msgs/Detection3DArray (ROS 1).

    The id of the first hypothesis is the track ID. That of a second one is the number of the class in COCO (0: person),
    if it has one, as ids are numbers. Their score is that of the track (1 if unknown) times the reliability.
    """
    detections = []
    for track, message in zip(tracks, tracks_to_msg(tracks, header).objects):
        ids = [track.id] + ([COCO.index(track.label)] if track.label in COCO else [])
        detection = vision_msgs.Detection3D(header=header, results=[vision_msgs.ObjectHypothesisWithPose(
            id=number, score=(track.score or 1.0) * _reliability(track), pose=message.pose) for number in ids])
        detection.bbox.center, detection.bbox.size = message.pose.pose, message.size
        detections.append(detection)
    return vision_msgs.Detection3DArray(header=header, detections=detections)


def _reliability(track: Track) -> float:
    return 1.0 if track.status == TrackedObject.VISIBLE else UNSEEN_RELIABILITY


def points_to_msg(points_m: np.ndarray, header: Header) -> PointCloud2:
    """Convert points (n, 3), in metres, to sensor_msgs/PointCloud2 with x, y, z as float32."""
    fields = [PointField(name=name, offset=4 * number, datatype=PointField.FLOAT32, count=1)
              for number, name in enumerate('xyz')]
    return PointCloud2(header=header, height=1, width=len(points_m), fields=fields, point_step=12,
                       row_step=12 * len(points_m), is_dense=True, is_bigendian=False,
                       data=np.asarray(points_m, '<f4').tobytes())


def grid_to_msg(costs: np.ndarray, cell_m: float, origin_m: Sequence[float], header: Header) -> OccupancyGrid:
    """Convert costs (rows, columns), int8, of which cell (0, 0) has its corner at `origin_m`, to an OccupancyGrid."""
    info = MapMetaData(header.stamp, cell_m, costs.shape[1], costs.shape[0],
                       Pose(Point(origin_m[0], origin_m[1], 0), Quaternion(w=1.0)))
    return OccupancyGrid(header, info, costs.ravel().tolist())


def velocity_to_msg(x: float, y: float, angular: float) -> Twist:
    message = Twist()
    message.linear.x, message.linear.y, message.angular.z = x, y, angular
    return message


def velocity_from_msg(message: Twist) -> Tuple[float, float, float]:
    """Velocity along x, along y and about z of a geometry_msgs/Twist. Raises ValueError if it is not finite."""
    velocity = message.linear.x, message.linear.y, message.angular.z
    if not np.isfinite(velocity).all():
        raise ValueError('the velocity is (%g, %g, %g); finite numbers expected' % velocity)
    return velocity


def pose_to_msg(x: float, y: float, yaw: float, header: Header) -> PoseStamped:
    return PoseStamped(header, Pose(Point(x, y, 0.0), Quaternion(0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2))))
