"""Outputs of planner_bridge_node: topics, message types, and the packages that define them."""
import importlib
from typing import Any, Callable, NamedTuple

from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import PointCloud2

from ros_3d_bb.camera.camera_model import transform_points
from ros_3d_bb.conversions.planner_msgs import (detections3d_to_msg, grid_to_msg, objects_to_msg,
                                                obstacles_to_msg, people_to_msg, points_to_msg)
from ros_3d_bb.planning.cost_grid import CELL_M, HALF_SIZE_M, presence_costs
from ros_3d_bb.planning.planner_view import footprint_points, in_frame, ring_points

CLEARING_SPACING_M = 0.025  # half a cell of a typical costmap, so that the clearing rays pass through every cell
CLEARING_HEIGHT_M = 0.5  # above the robot's frame, within the height range of costmaps


class Output(NamedTuple):
    """One published topic.

    `write(tracks, frame_from_tracks, header)` builds the message from tracks in their original frame; None: nothing is
    published. `frame` is the frame of the message's coordinates; if empty, the frame of the tracks is used, for
    planners that transform messages themselves. `to_now` states that the planner takes positions as current: they are
    predicted to the current time, and published again while no new tracks arrive; otherwise positions are those at the
    stamp of the image. `latest_tf` states that the planner applies the latest transform, or drops positions for which
    tf is older than their stamp: the stamp is 0, for which tf2 takes the latest transform. `float32` states that the
    message stores coordinates as float32. `is_emptied` states that an empty array is published when the tracks are
    outdated; otherwise nothing is.
    """

    topic: str
    kind: Any
    write: Callable
    frame: str = ''
    to_now: bool = False
    latest_tf: bool = False
    float32: bool = False
    is_emptied: bool = True


# Outputs whose message type, given by name, is defined in a package that may not be installed. `write` takes tracks in
# the output frame, the header and the `msg` module of the package. `frame` is the name of a parameter.
OPTIONAL = {
    'people': Output('/people', 'people_msgs/People', people_to_msg, to_now=True, latest_tf=True),
    'teb': Output('~obstacles', 'costmap_converter/ObstacleArrayMsg', obstacles_to_msg, 'planner_frame', to_now=True,
                  float32=True),
    'mpc': Output('~objects', 'derived_object_msgs/ObjectArray', objects_to_msg, 'planner_frame', to_now=True),
    'vision': Output('~detections', 'vision_msgs/Detection3DArray', detections3d_to_msg)}
NAMES = ('costmap',) + tuple(sorted(OPTIONAL))


def outputs_from(params):
    """Create the list of Output that the PlannerBridgeParams select. Raises ValueError if there is none, or the package
    that it needs is not installed."""
    if not params.outputs:
        raise ValueError('parameter ~outputs is empty; some of %s expected' % ', '.join(NAMES))
    found = [_optional_output(name, params) for name in OPTIONAL if name in params.outputs]
    return found + (_costmap_outputs(params) if 'costmap' in params.outputs else [])


def _optional_output(name, params):
    output = OPTIONAL[name]
    package, kind = output.kind.split('/')
    try:
        messages = importlib.import_module(package + '.msg')
    except ImportError as error:
        raise ValueError('output %s needs the package %s (%s): install it (rosdep key %s, on Noetic: apt install '
                         'ros-noetic-%s) or remove %s from ~outputs'
                         % (name, package, error, package, package.replace('_', '-'), name))

    def write(tracks, frame_from_tracks, header):
        return output.write(in_frame(tracks, frame_from_tracks), header, messages)
    return output._replace(kind=getattr(messages, kind), write=write,
                           frame=getattr(params, output.frame) if output.frame else '')


def _costmap_outputs(params):
    """Outputs for costmaps: the points to mark, a ring around the robot up to which the costmap is cleared first, and a
    grid of the costs of predicted positions for a StaticLayer.

    Points and ring are in the robot's frame, because coordinates are float32 and stay small there in any map. They are
    level in the frame of the tracks even if the robot is tilted, because costmaps filter points by height in the fixed
    frame. The ring is published only with valid tracks: with `expected_update_rate` the robot stops when it stays away.
    The grid is in the robot's frame because a StaticLayer reallocates its cells when their origin changes, while
    another thread reads them.
    """
    def footprints(tracks, robot_from_tracks, header):
        points_m = footprint_points(tracks, params.points_prediction, params.point_spacing)
        return points_to_msg(transform_points(robot_from_tracks, points_m), header)

    def ring(_tracks, robot_from_tracks, header):
        return points_to_msg(ring_m.dot(robot_from_tracks[:3, :3].T), header)

    def costs(tracks, robot_from_tracks, header):
        return grid_to_msg(presence_costs(tracks, robot_from_tracks, params.robot_radius), CELL_M,
                           (-HALF_SIZE_M, -HALF_SIZE_M), header)

    outputs = [Output('~points', PointCloud2, footprints, params.robot_frame, float32=True),
               Output('~costs', OccupancyGrid, costs, params.robot_frame, latest_tf=True)]
    if params.clearing_range:
        ring_m = ring_points(params.clearing_range, CLEARING_SPACING_M) + [0, 0, CLEARING_HEIGHT_M]
        outputs.append(Output('~clearing_points', PointCloud2, ring, params.robot_frame, is_emptied=False))
    return outputs
