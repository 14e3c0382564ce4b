"""What planners do with the messages of planner_bridge_node: replicas of the behaviour of the sources named at each."""
import genpy
import numpy as np
from geometry_msgs.msg import Point, PoseWithCovariance, Vector3

from ros_3d_bb.msg import TrackedObject

CYLINDER, CYLINDER_RADIUS = 3, 1


def person(number, x, y, moving=True, speed=1.0):
    """A track that walks along x of the map, predicted for 2 s."""
    track = TrackedObject(id=number, moving=moving, prediction_step=genpy.Duration(2), size=Vector3(0.6, 0.6, 1.7))
    track.pose.pose.position = Point(x, y, 0.85)
    track.twist.twist.linear.x = speed
    track.prediction = [PoseWithCovariance()]
    track.prediction[0].pose.position = Point(x + 2 * speed, y, 0.85)
    return track


def yaw_of(quaternion):
    """The rotation about z of a geometry_msgs/Quaternion, radians."""
    x, y, z, w = quaternion.x, quaternion.y, quaternion.z, quaternion.w
    return np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


class JackalMpcReplica(object):
    """mpc_planner_jackal (tud-amr/mpc_planner): ros1_jackal.cpp, obstacleCallback.

    Frame and stamp are ignored. ID 0 is skipped (by some versions, not the public one). A cylinder's
    radius is the second dimension. The twist is turned by minus the yaw of the pose, and the prediction is straight on
    from the moment of arrival.
    """

    def __init__(self):
        self.obstacles = {}

    def receive(self, array):
        """Obstacles as {id: (centre (2,), radius, velocity (2,))}."""
        self.obstacles = {}
        for item in array.objects:
            if item.id == 0 or item.shape.type != CYLINDER:
                continue
            angle = -yaw_of(item.pose.orientation)
            turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
            self.obstacles[item.id] = (np.array([item.pose.position.x, item.pose.position.y]),
                                       item.shape.dimensions[CYLINDER_RADIUS],
                                       turn.dot([item.twist.linear.x, item.twist.linear.y]))
