"""Tracks as the messages that planners read.

The classes of a package that is not on every robot come as an argument, the `msg` module of that package. Tracks are
lists of `types.TrackedObject` along the axes of the header's frame.
"""
import numpy as np
from geometry_msgs.msg import Point, Point32, Quaternion
from sensor_msgs.msg import PointCloud2, PointField

from ros_3d_bb.conversions.perception_msgs import tracks_to_msg
from ros_3d_bb.msg import TrackedObject

STATUS_NAMES = {TrackedObject.VISIBLE: 'visible', TrackedObject.OCCLUDED: 'occluded',
                TrackedObject.OUT_OF_VIEW: 'out of view'}
UNSEEN_RELIABILITY = 0.5  # of a track that the latest image did not show; some planners scale their costs by it


def people_to_msg(tracks, header, people_msgs):
    """people_msgs/People; status and size (metres) of a person are in the tags."""
    return people_msgs.People(header=header, people=[people_msgs.Person(
        name=str(track.id), position=Point(*track.position_m), velocity=Point(*track.velocity_mps),
        reliability=_reliability(track), tagnames=['status', 'width', 'height'],
        tags=[STATUS_NAMES.get(track.status, 'unknown'), '%.2f' % track.size_m[0], '%.2f' % track.size_m[2]])
        for track in tracks])


def obstacles_to_msg(tracks, header, costmap_converter):
    """costmap_converter/ObstacleArrayMsg: one point, float32, and a radius are a circle."""
    obstacles = []
    for track in tracks_to_msg(tracks, header).objects:
        obstacle = costmap_converter.ObstacleMsg(header=header, id=track.id, radius=track.size.x / 2,
                                                 orientation=Quaternion(w=1.0), velocities=track.twist)
        place = track.pose.pose.position
        obstacle.polygon.points = [Point32(place.x, place.y, place.z)]
        obstacles.append(obstacle)
    return costmap_converter.ObstacleArrayMsg(header=header, obstacles=obstacles)


def objects_to_msg(tracks, header, derived_object_msgs):
    """derived_object_msgs/ObjectArray: upright cylinders of pedestrians."""
    objects = []
    for track in tracks_to_msg(tracks, header).objects:
        item = derived_object_msgs.Object(header=header, id=track.id, pose=track.pose.pose, twist=track.twist.twist,
                                          object_classified=True, classification_certainty=255)
        item.detection_level, item.classification = item.OBJECT_TRACKED, item.CLASSIFICATION_PEDESTRIAN
        item.shape.type, item.shape.dimensions = item.shape.CYLINDER, [0.0, 0.0]
        item.shape.dimensions[item.shape.CYLINDER_HEIGHT] = track.size.z
        item.shape.dimensions[item.shape.CYLINDER_RADIUS] = track.size.x / 2
        objects.append(item)
    return derived_object_msgs.ObjectArray(header=header, objects=objects)


def detections3d_to_msg(tracks, header, vision_msgs):
    """vision_msgs/Detection3DArray of ROS 1: the id of the one hypothesis is the number of the track."""
    detections = []
    for track, message in zip(tracks, tracks_to_msg(tracks, header).objects):
        detection = vision_msgs.Detection3D(header=header, results=[vision_msgs.ObjectHypothesisWithPose(
            id=track.id, score=_reliability(track), pose=message.pose)])
        detection.bbox.center, detection.bbox.size = message.pose.pose, message.size
        detections.append(detection)
    return vision_msgs.Detection3DArray(header=header, detections=detections)


def _reliability(track):
    return 1.0 if track.status == TrackedObject.VISIBLE else UNSEEN_RELIABILITY


def points_to_msg(points_m, header):
    """sensor_msgs/PointCloud2 of points (n, 3): x, y, z as float32."""
    fields = [PointField(name=name, offset=4 * number, datatype=PointField.FLOAT32, count=1)
              for number, name in enumerate('xyz')]
    return PointCloud2(header=header, height=1, width=len(points_m), fields=fields, point_step=12,
                       row_step=12 * len(points_m), is_dense=True, is_bigendian=False,
                       data=np.asarray(points_m, '<f4').tobytes())
