"""Benchmark of people in the laser layer of a real costmap_2d, with and without people_removal_node.

The laser is that of `simulation.laser`. Scenes are tracked and played as in `benchmark`.
"""
import numpy as np
import rospy
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import LaserScan

from ros_3d_bb.conversions.perception_msgs import time_from
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb_lab.evaluation.costmap.benchmark import SCENES, Player, play_scenes
from ros_3d_bb_lab.evaluation.defaults import add_scenarios
from ros_3d_bb_lab.simulation.laser import FIELD_OF_VIEW, planar_pose, rectangles_of, scan_ranges
from ros_3d_bb_lab.simulation.ros.driven_robot import scan_to_msg

SCAN_S = 0.05
CLEARING_BEAMS = 1500  # through each cell
NEAR_M = 0.2  # cells at most this far from walls and furniture are those of the room
LAUNCH = """<launch>
  <param name="/use_sim_time" value="true"/>
  <include file="$(find ros_3d_bb)/launch/people_removal.launch">
    <arg name="scan_topic" value="scan"/>
  </include>
  %s
</launch>"""
COSTMAP = """<node pkg="costmap_2d" type="costmap_2d_node" name="%s" output="screen">
    <rosparam command="load" file="$(find ros_3d_bb)/config/move_base/local_costmap.yaml" ns="costmap"/>
    <rosparam command="load" file="$(find ros_3d_bb)/config/move_base/costmap_common.yaml" ns="costmap"/>
    <rosparam ns="costmap">
      {global_frame: odom, robot_base_frame: base_link, width: 8.0, height: 8.0, publish_frequency: 10.0,
       always_send_full_costmap: true, plugins: [{name: obstacle_layer, type: "costmap_2d::ObstacleLayer"}]}
    </rosparam>
    <param name="costmap/obstacle_layer/scan/topic" value="%s"/>
  </node>"""
NODES = {'costmap_node': '/people_removal_node/scan_static', 'costmap_with_people': '/scan'}


def counts_of(costmap, room):
    """Numbers of lethal cells that are not of the room, and of those that are: at most `NEAR_M` from it."""
    cells_m = costmap.lethal_m()
    if not len(cells_m):
        return 0, 0
    walls, *furniture = rectangles_of(room)
    inside = [rectangle.signed_distances_m(cells_m) < NEAR_M for rectangle in furniture]
    of_room = np.any(inside + [walls.signed_distances_m(cells_m) > -NEAR_M], axis=0)
    return int((~of_room).sum()), int(of_room.sum())


class LaserPlayer(Player):
    """As Player, with a laser. Before each scene, scans all around without a return clear the costmaps, whose corners
    are within their raytrace_range.
    """

    def __init__(self):
        super(LaserPlayer, self).__init__()
        self._scan_pub, self._with_people = rospy.Publisher('scan', LaserScan, queue_size=10), []
        self._due_ns, self._is_clearing = 0, False
        rospy.Subscriber('/costmap_with_people/costmap/costmap', OccupancyGrid, self._with_people.append,
                         queue_size=100, buff_size=2 ** 24)

    def _lead(self, scene):
        del self._with_people[:]
        self._is_clearing = True
        super(LaserPlayer, self)._lead(scene)
        self._is_clearing = False

    def _tick(self, scene, seconds, with_map, with_odom=True):
        if self._now_ns >= self._due_ns:
            self._due_ns = self._now_ns + int(SCAN_S * NS)
            stamp = time_from(self._now_ns)
            self._scan_pub.publish(scan_to_msg(np.full(CLEARING_BEAMS, np.inf), 2 * np.pi, stamp) if self._is_clearing
                                   else scan_message(scene.simulator, seconds, stamp))
        super(LaserPlayer, self)._tick(scene, seconds, with_map, with_odom)

    def score(self, scene, costmaps):
        """Mean numbers of lethal cells of people and of the room in the costmaps, of both scans."""
        room, with_people = scene.simulator.scenario.room, self.costmaps_of(scene, self._with_people)
        means = [np.mean([counts_of(costmap, room) for costmap in each], axis=0) for each in (with_people, costmaps)]
        return {'costmaps': len(costmaps), 'of_people': means[0][0], 'of_people_static': means[1][0],
                'of_room': means[0][1], 'of_room_static': means[1][1]}


def scan_message(simulator, seconds, stamp):
    """The scan at a time of a scene."""
    poses = simulator.poses_at(seconds)
    pose = planar_pose(poses.map_from_odom.dot(poses.odom_from_base))
    radii_m = [body.width_m / 2 for body in simulator.bodies]
    ranges_m = scan_ranges(pose, simulator.scenario.room, simulator.positions_at(seconds), radii_m)
    return scan_to_msg(ranges_m, FIELD_OF_VIEW, stamp)


def run(arguments):
    """Count the cells in the costmaps of each scene."""
    return play_scenes(arguments.scenarios, LAUNCH % ''.join(COSTMAP % item for item in NODES.items()), LaserPlayer)


def add_options(parser):
    add_scenarios(parser, *SCENES)
