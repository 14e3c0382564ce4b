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


def moved(points, transform):
    """Points (n, 3) by a 4x4 matrix."""
    return np.reshape(points, (-1, 3)).dot(transform[:3, :3].T) + transform[:3, 3]


class TebReplica(object):
    """teb_local_planner (Noetic): teb_local_planner_ros.cpp and obstacles.h.

    It keeps the last array and ignores its stamp. Positions are transformed by the latest transform from the array's
    frame (the identity where there is none); velocities are not. An obstacle of less than 1 mm/s is static; another one
    moves on from its position at the moment of planning.
    """

    def __init__(self, planner_from):
        self._planner_from = planner_from

    def receive(self, array):
        self._array = array

    def obstacles(self):
        """(centre (2,), radius, velocity (2,) or None) of each circle."""
        transform = self._planner_from.get(self._array.header.frame_id, np.eye(4))
        found = []
        for obstacle in self._array.obstacles:
            assert len(obstacle.polygon.points) == 1 and obstacle.radius > 0  # otherwise it is not a circle to TEB
            point = obstacle.polygon.points[0]
            velocity = np.array([obstacle.velocities.twist.linear.x, obstacle.velocities.twist.linear.y])
            found.append((moved([point.x, point.y, point.z], transform)[0, :2], obstacle.radius,
                          velocity if np.linalg.norm(velocity) >= 0.001 else None))
        return found

    def predicted(self, ahead_s):
        """Expected centres of the circles, seconds after planning, (n, 2)."""
        return np.array([centre + ahead_s * (0 if velocity is None else velocity)
                         for centre, _radius, velocity in self.obstacles()]).reshape(-1, 2)


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
