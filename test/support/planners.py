"""What planners do with the messages of planner_bridge_node: replicas of the behaviour of the sources named at each."""
import genpy
import numpy as np
import tf2_ros
from geometry_msgs.msg import Point, PoseWithCovariance, Vector3

from ros_3d_bb.msg import TrackedObject

LETHAL, FREE = 254, 0
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


def moved_float32(points, transform):
    """The same as tf2_sensor_msgs moves a cloud: matrix, points and result are float32."""
    points = np.asarray(points, np.float32).reshape(-1, 3)
    return points.dot(transform[:3, :3].T.astype(np.float32)) + transform[:3, 3].astype(np.float32)


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


class SocialLayerReplica(object):
    """social_navigation_layers: social_layer.cpp.

    It keeps the last list. At each update, position, and position plus velocity, are transformed at the stamp of the
    list (0: the latest transform) without waiting; their difference is the velocity. People for whom there is no
    transform are dropped.

    Parameters
    ----------
    costmap_from : callable
        The 4x4 matrix from a frame at a stamp to the costmap's frame; raises tf2_ros.TransformException.
    """

    def __init__(self, costmap_from):
        self._costmap_from, self._people = costmap_from, None

    def receive(self, people):
        self._people = people

    def people(self):
        """(position (3,), velocity (3,)) of each."""
        if self._people is None:
            return []
        try:
            transform = self._costmap_from(self._people.header.frame_id, self._people.header.stamp)
        except tf2_ros.TransformException:
            return []
        found = []
        for person in self._people.people:
            position = np.array([person.position.x, person.position.y, person.position.z])
            end = position + [person.velocity.x, person.velocity.y, person.velocity.z]
            start, end = moved([position, end], transform)
            found.append((start, end - start))
        return found


class ObstacleLayerReplica(object):
    """costmap_2d's ObstacleLayer and ObservationBuffer with observation_persistence 0.

    Each source keeps its last cloud without the points outside of the heights in the costmap's frame. Clouds are moved
    there in float32. At an update the rays from the sensor's origin to all points of the clearing clouds are set free,
    and then the points of the marking clouds that are in range are set lethal. Other cells do not change.

    Parameters
    ----------
    costmap_from : callable
        The 4x4 matrix from a frame at a stamp to the costmap's frame.
    sources : dict
        The layer's parameters of each observation source, by its name; what is not given has costmap_2d's default.
    """

    resolution, cells = 0.05, 200
    defaults = {'sensor_frame': '', 'marking': True, 'clearing': False, 'obstacle_range': 2.5, 'raytrace_range': 3.0,
                'min_obstacle_height': 0.0, 'max_obstacle_height': 2.0, 'observation_persistence': 0.0}

    def __init__(self, costmap_from, sources):
        self._costmap_from, self._clouds = costmap_from, {}
        self._sources = {name: dict(self.defaults, **given) for name, given in sources.items()}
        assert all(source['observation_persistence'] == 0 for source in self._sources.values())
        self.grid = np.full((self.cells, self.cells), FREE, np.uint8)  # [y, x], centre at the costmap's origin

    def receive(self, name, cloud):
        offsets = {field.name: field.offset for field in cloud.fields}
        kind = np.dtype({'names': 'xyz', 'formats': ['<f4'] * 3, 'offsets': [offsets[name] for name in 'xyz'],
                         'itemsize': cloud.point_step})
        points = np.frombuffer(cloud.data, kind)
        points = np.column_stack([points[name] for name in 'xyz'])
        points = moved_float32(points, self._costmap_from(cloud.header.frame_id, cloud.header.stamp))
        source = self._sources[name]
        inside = (points[:, 2] >= source['min_obstacle_height']) & (points[:, 2] <= source['max_obstacle_height'])
        sensor = source['sensor_frame'] or cloud.header.frame_id
        self._clouds[name] = self._costmap_from(sensor, cloud.header.stamp)[:3, 3], points[inside]

    def update(self):
        for name, (origin, points) in self._clouds.items():
            if self._sources[name]['clearing'] and len(points):
                self._clear(origin, points, self._sources[name]['raytrace_range'])
        for name, (origin, points) in self._clouds.items():
            if self._sources[name]['marking']:
                reach_m = self._sources[name]['obstacle_range']
                x, y = self._cell(points[np.linalg.norm(points - origin, axis=1) < reach_m])
                inside = (x >= 0) & (x < self.cells) & (y >= 0) & (y < self.cells)
                self.grid[y[inside], x[inside]] = LETHAL

    def _cell(self, points):
        x, y = np.floor(np.asarray(points)[..., :2] / self.resolution).astype(int).T + self.cells // 2
        return x, y

    def _clear(self, origin, points, range_m):
        """One cell a step along the longer axis, from the sensor's cell to those of the points, up to the range."""
        start = np.array(self._cell(origin))
        ways = np.column_stack(self._cell(points)) - start
        steps = np.maximum(np.abs(ways).max(axis=1), 1)
        shares = np.minimum(1.0, range_m / np.maximum(self.resolution * np.linalg.norm(ways, axis=1), 1e-9))
        numbers = np.arange(steps.max() + 1)
        lines = np.rint(start + numbers[:, None, None] * (ways / steps[:, None])).astype(int)
        reached = numbers[:, None] <= (shares * steps).astype(int)
        cells = lines[reached & ((lines >= 0) & (lines < self.cells)).all(axis=2)]
        self.grid[cells[:, 1], cells[:, 0]] = FREE

    def lethal(self):
        """Centres of the lethal cells, (n, 2) metres."""
        y, x = np.nonzero(self.grid == LETHAL)
        return (np.column_stack((x, y)) - self.cells // 2 + 0.5) * self.resolution
