"""Nodes that stand in for move_base and costmap_2d_node where these cannot be built.

They read the parameters of the real nodes, keep layers of people as `support.planners` describes them, and publish
their costmaps. move_base plans nothing: with a goal it drives ahead while its local costmap is current.
"""
import threading

import numpy as np
import rospy
import tf2_ros
from geometry_msgs.msg import PoseStamped, Twist
from nav_msgs.msg import OccupancyGrid
from people_msgs.msg import People
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from ros_3d_bb.conversions.perception_msgs import transform_from_msg
from support.planners import FREE, LETHAL, ObstacleLayerReplica, SocialLayerReplica

SPEED_MPS, AMPLITUDE, SIGMA_M = 0.8, 77, 0.5


class Window(ObstacleLayerReplica):
    """Does not follow the robot, and is therefore larger. The rays to the ring are so dense that they clear a disc."""

    cells = 320

    def _clear(self, origin, points, range_m):
        axis_m = (np.arange(self.cells) - self.cells // 2 + 0.5) * self.resolution
        reach_m = min(range_m, np.linalg.norm(points - origin, axis=1).max())
        self.grid[np.hypot(axis_m - origin[0], axis_m[:, None] - origin[1]) < reach_m] = FREE


class Costmap(object):
    """A costmap of a node: `layer` is an ObstacleLayerReplica or a SocialLayerReplica."""

    def __init__(self, name):
        self._params = rospy.get_param('~' + name)
        self._lock, self._buffer = threading.Lock(), tf2_ros.Buffer()
        self._listener = tf2_ros.TransformListener(self._buffer)
        self._frame = self._params['global_frame']
        self._arrived, self._updates = {}, 0
        self._publisher = rospy.Publisher('~%s/costmap' % name, OccupancyGrid, queue_size=1)
        self._layer = self._people_layer() if 'people_layer' in self._params else self._social_layer()

    def _people_layer(self):
        params = self._params['people_layer']
        is_used = 'people_layer' in [plugin['name'] for plugin in self._params['plugins']]
        sources = {name: params[name] for name in params['observation_sources'].split() if is_used}
        for name, source in sources.items():
            self._arrived[name] = rospy.get_time()
            rospy.Subscriber(source['topic'], PointCloud2, lambda cloud, name=name: self._on_cloud(name, cloud))
        self._limits_s = {name: source.get('expected_update_rate', np.inf) for name, source in sources.items()}
        return Window(self._from, sources)

    def _social_layer(self):
        layer = SocialLayerReplica(self._from)
        rospy.Subscriber('/people', People, layer.receive)
        return layer

    def _from(self, frame_id, stamp):
        """As the real layers: without waiting. Raises TransformException."""
        return transform_from_msg(self._buffer.lookup_transform(self._frame, frame_id, stamp))

    def _on_cloud(self, name, cloud):
        """As its message filter, wait for the transform."""
        try:
            self._buffer.lookup_transform(self._frame, cloud.header.frame_id, cloud.header.stamp, rospy.Duration(0.3))
            with self._lock:
                self._layer.receive(name, cloud)
                self._arrived[name] = rospy.get_time()
        except tf2_ros.TransformException as error:
            rospy.logwarn('replica: %s', error)

    def is_current(self):
        return all(rospy.get_time() - self._arrived[name] <= limit_s for name, limit_s in self._limits_s.items())

    def update(self):
        """Update the layer, and publish every second costmap."""
        stamp = rospy.get_rostime()
        with self._lock:
            costs = self._obstacles() if isinstance(self._layer, Window) else self._proxemic()
        self._updates += 1
        if self._updates % 2:
            return
        grid = OccupancyGrid(header=Header(stamp=stamp, frame_id=self._frame))
        grid.info.height, grid.info.width = costs.shape
        grid.info.resolution = Window.resolution
        grid.info.origin.position.x = grid.info.origin.position.y = -Window.cells // 2 * Window.resolution
        grid.data = (costs.astype(int) * 100 // LETHAL).ravel().tolist()
        self._publisher.publish(grid)

    def _obstacles(self):
        self._layer.update()
        return self._layer.grid

    def _proxemic(self):
        """A normal distribution around each person."""
        axis_m = (np.arange(Window.cells) - Window.cells // 2 + 0.5) * Window.resolution
        costs = np.zeros((Window.cells, Window.cells))
        for position_m, _velocity in self._layer.people():
            square = (axis_m - position_m[0]) ** 2 + (axis_m[:, None] - position_m[1]) ** 2
            costs = np.maximum(costs, AMPLITUDE * np.exp(-square / (2 * SIGMA_M ** 2)))
        return costs


def costmap_2d_node():
    """Run the replica of costmap_2d_node."""
    rospy.init_node('costmap_2d_node')
    costmap = Costmap('costmap')
    _repeat(costmap.update)


def move_base():
    """Run the replica of move_base."""
    rospy.init_node('move_base')
    costmap, goals = Costmap('local_costmap'), []
    rospy.Subscriber('move_base_simple/goal', PoseStamped, goals.append)
    publisher = rospy.Publisher('cmd_vel', Twist, queue_size=1)

    def step():
        costmap.update()
        if goals:
            command = Twist()
            command.linear.x = SPEED_MPS if costmap.is_current() else 0.0
            publisher.publish(command)
    _repeat(step)


def _repeat(step):
    rate = rospy.Rate(10)
    while not rospy.is_shutdown():
        step()
        rate.sleep()
