"""Benchmark of people in the laser layer of a real costmap_2d, with and without people_removal_node.

The laser is planar, in the frame of the robot, and sees walls, furniture and people as upright cylinders. Scenes are
tracked and played as in `benchmark`.
"""
import argparse
import json
import sys

import numpy as np
import rospy
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Header

from ros_3d_bb.conversions.perception_msgs import time_from
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb_lab.evaluation.costmap.benchmark import SCENES, Player, running_nodes, scenario_paths, tracked_scene
from ros_3d_bb_lab.evaluation.defaults import describe_machine
from ros_3d_bb_lab.simulation.collision import Rectangle
from ros_3d_bb_lab.simulation.ros.scenario_to_bag import BASE_FRAME

SCAN_S, BEAMS, FIELD_OF_VIEW, RANGE_M = 0.05, 541, np.radians(270), 10.0  # as a Hokuyo or SICK of a Jackal
CLEARING_BEAMS = 1500  # through each cell
NEAR_M = 0.2  # cells at most this far from walls and furniture are those of the room
COLUMNS = '%-20s %9s %15s %15s %13s %13s'
HEADINGS = 'scene', 'costmaps', 'of people: scan', 'scan_static', 'of the room', 'scan_static'
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


def scan_ranges(pose, room, people_m, radii_m):
    """Ranges (n,) of the beams from a pose (x, y, yaw) to walls, furniture and people, at most `RANGE_M`; infinite
    without a return. `people_m` (m, 2) and `radii_m` (m,) are cylinders."""
    angles = pose[2] + np.linspace(-FIELD_OF_VIEW / 2, FIELD_OF_VIEW / 2, BEAMS)
    beams = np.column_stack((np.cos(angles), np.sin(angles)))
    ranges_m = np.min([_to_segments(pose[:2], beams, rectangle.corners()) for rectangle in rectangles_of(room)], axis=0)
    for place_m, radius_m in zip(people_m, radii_m):
        along_m = beams.dot(np.subtract(place_m, pose[:2]))
        half_m2 = radius_m ** 2 + along_m ** 2 - np.sum(np.subtract(place_m, pose[:2]) ** 2)
        hit_m = np.where((half_m2 > 0) & (along_m > 0), along_m - np.sqrt(np.maximum(half_m2, 0)), np.inf)
        ranges_m = np.minimum(ranges_m, np.maximum(hit_m, 0))
    return np.where(ranges_m <= RANGE_M, ranges_m, np.inf)


def _to_segments(origin, beams, corners):
    """Distances (n,) along beams (n, 2) to the edges of a polygon (k, 2); infinite where there is none."""
    found = np.full(len(beams), np.inf)
    for start, end in zip(corners, np.roll(corners, -1, axis=0)):
        edge, offset = end - start, start - origin
        with np.errstate(divide='ignore', invalid='ignore'):
            cross = beams[:, 0] * edge[1] - beams[:, 1] * edge[0]
            distance_m = (offset[0] * edge[1] - offset[1] * edge[0]) / cross
            share = (offset[0] * beams[:, 1] - offset[1] * beams[:, 0]) / cross
        is_hit = (distance_m > 0) & (0 <= share) & (share <= 1)
        found = np.where(is_hit, np.minimum(found, np.where(is_hit, distance_m, np.inf)), found)
    return found


def rectangles_of(room):
    """The room and its furniture as a list of Rectangle."""
    x0, x1, y0, y1 = room.bounds
    walls = Rectangle(((x0 + x1) / 2, (y0 + y1) / 2), 0.0, (x1 - x0, y1 - y0))
    return [walls] + [Rectangle(item.at, item.yaw, item.size[:2]) for item in room.furniture]


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

    Attribute `with_people`: the OccupancyGrids of the layer of the scan with people.
    """

    def __init__(self, speed):
        super(LaserPlayer, self).__init__(speed)
        self._scan_pub, self.with_people = rospy.Publisher('scan', LaserScan, queue_size=10), []
        self._due_ns, self._is_clearing = 0, False
        rospy.Subscriber('/costmap_with_people/costmap/costmap', OccupancyGrid, self.with_people.append,
                         queue_size=100, buff_size=2 ** 24)

    def _lead(self, scene):
        self._is_clearing = True
        super(LaserPlayer, self)._lead(scene)
        self._is_clearing = False

    def _tick(self, scene, seconds, with_map, with_odom=True):
        if self._now_ns >= self._due_ns:
            self._due_ns = self._now_ns + int(SCAN_S * NS)
            stamp = time_from(self._now_ns)
            self._scan_pub.publish(message_of(np.full(CLEARING_BEAMS, np.inf), 2 * np.pi, stamp) if self._is_clearing
                                   else scan_message(scene.simulator, seconds, stamp))
        super(LaserPlayer, self)._tick(scene, seconds, with_map, with_odom)


def scan_message(simulator, seconds, stamp):
    """The scan at a time of a scene."""
    poses = simulator.poses_at(seconds)
    map_from_base = poses.map_from_odom.dot(poses.odom_from_base)
    pose = np.append(map_from_base[:2, 3], np.arctan2(map_from_base[1, 0], map_from_base[0, 0]))
    radii_m = [body.width_m / 2 for body in simulator.bodies]
    ranges_m = scan_ranges(pose, simulator.scenario.room, simulator.positions_at(seconds), radii_m)
    return message_of(ranges_m, FIELD_OF_VIEW, stamp)


def message_of(ranges_m, field_of_view, stamp):
    """Convert ranges (n,) to a LaserScan in the frame of the robot."""
    return LaserScan(header=Header(stamp=stamp, frame_id=BASE_FRAME), angle_min=-field_of_view / 2,
                     angle_max=field_of_view / 2, angle_increment=field_of_view / (len(ranges_m) - 1),
                     scan_time=SCAN_S, range_min=0.05, range_max=RANGE_M, ranges=ranges_m.tolist())


def result_of(scene, costmaps, with_people):
    """Mean numbers of lethal cells of people and of the room in the costmaps, of both scans."""
    room = scene.simulator.scenario.room
    means = [np.mean([counts_of(costmap, room) for costmap in each], axis=0) for each in (with_people, costmaps)]
    return {'costmaps': len(costmaps), 'of_people': means[0][0], 'of_people_static': means[1][0],
            'of_room': means[0][1], 'of_room_static': means[1][1]}


def main():
    """Run the command `./run bench laser`."""
    parser = argparse.ArgumentParser(prog='./run bench laser', description=__doc__)
    parser.add_argument('--scenes', type=scenario_paths, default=','.join(SCENES), metavar='A,B',
                        help='names in config/scenarios or files, separated by commas (default: %(default)s)')
    parser.add_argument('--speed', type=float, default=1.0,
                        help='speed of time; less than 1 on a busy machine (default: 1)')
    parser.add_argument('--json', metavar='FILE', help='file to which the results are also written')
    arguments = parser.parse_args()
    print(describe_machine())
    print(COLUMNS % HEADINGS, flush=True)
    try:
        scenes = [tracked_scene(name, path) for name, path in arguments.scenes.items()]
    except (ValueError, OSError) as error:
        sys.exit('./run bench laser: %s' % error)
    results = {}
    with running_nodes(LAUNCH % ''.join(COSTMAP % item for item in NODES.items())):
        rospy.init_node('laser_benchmark', disable_signals=True)
        player = LaserPlayer(arguments.speed)
        player.start(scenes[0])
        for scene in scenes:
            del player.with_people[:]
            costmaps = player.play(scene)
            with_people = player.costmaps_of(scene, player.with_people)
            result = results[scene.name] = result_of(scene, costmaps, with_people)
            print(COLUMNS % (scene.name, result['costmaps'], '%.1f' % result['of_people'],
                             '%.1f' % result['of_people_static'], '%.0f' % result['of_room'],
                             '%.0f' % result['of_room_static']), flush=True)
    if arguments.json:
        with open(arguments.json, 'w') as stream:
            json.dump({'machine': describe_machine(), 'scenes': results}, stream, indent=1)
