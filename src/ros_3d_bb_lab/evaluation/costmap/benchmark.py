"""Benchmark of people in a real costmap_2d on simulated scenes: recall, false cells and trails.

Scenes are rendered and tracked first. Then their tracks and transforms are played on simulated time to
planner_bridge_node and a costmap_2d_node with the people layer of config/move_base/local_costmap.yaml.
"""
import os
import subprocess
import sys
import time
from typing import NamedTuple, Tuple

import numpy as np
import rospy
from nav_msgs.msg import OccupancyGrid
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from ros_3d_bb.camera.camera_model import transform_points
from ros_3d_bb.conversions.camera_msgs import START_NS, transform_messages
from ros_3d_bb.conversions.perception_msgs import TRACKS_TOPIC, time_from, tracks_to_msg
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.estimation.error_model import read_error_model
from ros_3d_bb.msg import TrackedObjectArray
from ros_3d_bb.tracking.types import VISIBLE
from ros_3d_bb_lab.evaluation.costmap.costmap_score import Costmap, Sighting, score_costmaps
from ros_3d_bb_lab.evaluation.defaults import SIMULATED_ERROR_MODEL, add_scenarios, describe_machine, scene_name
from ros_3d_bb_lab.evaluation.launching import free_port, running_roslaunch
from ros_3d_bb_lab.evaluation.scene_benchmark import RANGE_M, depth_detector, run_scene, yolov5_detector
from ros_3d_bb_lab.evaluation.text_table import line_of
from ros_3d_bb_lab.simulation.ros.scenario_to_bag import BASE_FRAME, MAP_FRAME, ODOM_FRAME
from ros_3d_bb_lab.simulation.scenario import read_scenario
from ros_3d_bb_lab.simulation.simulator import Simulator

SCENES = 'turning_robot', 'corridor', 'demo', 'behind_a_pillar', 'thesis_e_passing', 'following_robot'
LATENCY_S = 0.1  # from an image to its tracks
TICK_S, ODOM_S, LOCALISATION_S = 0.01, 0.02, 0.1  # periods of /clock, of odom in tf, and of the map in tf
GAP_NS, LEAD_S = 100 * NS, 0.5  # between scenes, and of tf before the first image
STARTING_S = 30.0
COSTMAP_S, PATIENCE_S = 0.4, 1.0  # longest time between costmaps, and how long to wait for one in real time
LAUNCH = """<launch>
  <param name="/use_sim_time" value="true"/>
  <include file="$(find ros_3d_bb)/launch/planner_bridge.launch"/>
  <node pkg="costmap_2d" type="costmap_2d_node" name="costmap_node" output="screen">
    <rosparam command="load" file="$(find ros_3d_bb)/config/move_base/local_costmap.yaml" ns="costmap"/>
    <rosparam ns="costmap">
      {global_frame: odom, robot_base_frame: base_link, robot_radius: 0.1, width: 18.0, height: 18.0,
       publish_frequency: 10.0, always_send_full_costmap: true,
       plugins: [{name: people_layer, type: "costmap_2d::ObstacleLayer"}]}
    </rosparam>
  </node>
</launch>"""


class Scene(NamedTuple):
    """A tracked scene: its name, the Simulator, a `scene_benchmark.Step` per image, and the range of the detector."""

    name: str
    simulator: Simulator
    steps: list
    range_m: Tuple[float, float]


def tracked_scene(path, yolov5=None):
    """Render and track the scenario in a file with the depth detector or the one given."""
    simulator = Simulator(read_scenario(path))
    steps = run_scene(simulator, yolov5 or depth_detector(simulator), 1, read_error_model(SIMULATED_ERROR_MODEL))
    return Scene(scene_name(path), simulator, steps, RANGE_M['yolov5' if yolov5 else 'depth'])


def sightings_of(scene):
    """What each image of a scene shows within the range of the detector, as a list of Sighting."""
    return [Sighting(step.frame.time_s,
                     np.array([_is_visible(person, step.frame, scene.range_m) for person in step.moment.truth]),
                     np.reshape([track.position_m[:2] for track in step.moment.tracks], (-1, 2)))
            for step in scene.steps]


def _is_visible(person, frame, range_m):
    depth_m = transform_points(np.linalg.inv(frame.poses.map_from_camera), person.position_m)[2]
    return person.status == VISIBLE and range_m[0] <= depth_m <= range_m[1]


class Player(object):
    """Plays scenes to the nodes and collects their costmaps. `rospy.init_node` must have been called."""

    def __init__(self):
        self._now_ns, self._grids = START_NS, []
        self._clock_pub = rospy.Publisher('/clock', Clock, queue_size=100)
        self._tf_pub = rospy.Publisher('/tf', TFMessage, queue_size=100)
        self._tracks_pub = rospy.Publisher(TRACKS_TOPIC, TrackedObjectArray, queue_size=100)
        rospy.Subscriber('/costmap_node/costmap/costmap', OccupancyGrid, self._grids.append, queue_size=100,
                         buff_size=2 ** 24)

    def start(self, scene):
        """Play the first moment of a scene until the first costmap arrives. Raises RuntimeError if none does."""
        deadline_s = time.monotonic() + STARTING_S
        while not self._grids:
            if time.monotonic() > deadline_s:
                raise RuntimeError('no costmap within %g s; see the log of costmap_2d_node above' % STARTING_S)
            self._tick(scene, 0.0, True)

    def play(self, scene):
        """Play a scene. Returns its costmaps, a list of Costmap."""
        self._now_ns += GAP_NS
        for _tick in range(int(LEAD_S / TICK_S)):  # so that tf begins before the first image
            self._tick(scene, 0.0, True)
        start_ns = self._now_ns
        del self._grids[:]
        waiting = list(scene.steps)
        for number in range(int(scene.simulator.scenario.duration / TICK_S)):
            seconds = number * TICK_S
            self._tick(scene, seconds, number % round(LOCALISATION_S / TICK_S) == 0,
                       number % round(ODOM_S / TICK_S) == 0)
            while waiting and waiting[0].frame.time_s + LATENCY_S <= seconds:
                step = waiting.pop(0)
                header = Header(stamp=time_from(start_ns + int(step.frame.time_s * NS)), frame_id=MAP_FRAME)
                self._tracks_pub.publish(tracks_to_msg(step.moment.tracks, header))
        return [_costmap(scene, grid, start_ns) for grid in self._grids if grid.header.stamp.to_nsec() >= start_ns]

    def _tick(self, scene, seconds, with_map, with_odom=True):
        stamp = time_from(self._now_ns)
        self._clock_pub.publish(Clock(stamp))
        poses = scene.simulator.poses_at(seconds)
        links = [(MAP_FRAME, ODOM_FRAME, poses.map_from_odom)] * with_map
        links += [(ODOM_FRAME, BASE_FRAME, poses.odom_from_base)] * with_odom
        if links:
            self._tf_pub.publish(TFMessage(transform_messages(stamp, links)))
        self._now_ns += int(TICK_S * NS)
        time.sleep(TICK_S)
        deadline_s = time.monotonic() + PATIENCE_S
        while self._is_late() and time.monotonic() < deadline_s:  # the machine is busy
            time.sleep(0.002)

    def _is_late(self):
        return self._grids and self._now_ns - self._grids[-1].header.stamp.to_nsec() > COSTMAP_S * NS


def _costmap(scene, grid, start_ns):
    """Convert an OccupancyGrid in odom."""
    seconds, origin = (grid.header.stamp.to_nsec() - start_ns) / NS, grid.info.origin.position
    lethal = np.array(grid.data, np.int8).reshape(grid.info.height, grid.info.width) == 100
    return Costmap(seconds, lethal, np.array([origin.x, origin.y]), grid.info.resolution,
                   scene.simulator.poses_at(seconds).map_from_odom)


def run(arguments):
    """Score the costmaps of each scene."""
    print(describe_machine(), flush=True)
    yolov5 = yolov5_detector(arguments.weights) if arguments.weights else None
    scenes = [tracked_scene(path, yolov5) for path in arguments.scenarios]
    results, port = {}, free_port()
    os.environ['ROS_MASTER_URI'] = 'http://localhost:%d' % port
    with running_roslaunch(['-'], port, sys.stderr, stdin=subprocess.PIPE) as process:
        with process.stdin as stream:
            stream.write(LAUNCH.encode())
        rospy.init_node('costmap_benchmark', disable_signals=True)
        player = Player()
        player.start(scenes[0])
        for scene in scenes:
            costmaps = player.play(scene)
            results[scene.name] = score_costmaps(costmaps, sightings_of(scene), scene.simulator.positions_at)
            print(line_of(scene.name, **results[scene.name]), flush=True)
    return {'machine': describe_machine(), 'scenes': results}


def add_options(parser):
    parser.add_argument('--weights', help='checkpoint or export of YOLOv5; without it, people are detected in depth')
    add_scenarios(parser, *SCENES)
