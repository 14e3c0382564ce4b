"""Outputs of planner_bridge_node: topics, message types, and the packages that define them."""
import functools
import importlib
from typing import Any, Callable, NamedTuple

from sensor_msgs.msg import PointCloud2

from ros_3d_bb.camera.camera_model import transform_points
from ros_3d_bb.conversions.planner_msgs import (detections3d_to_msg, objects_to_msg, obstacles_to_msg,
                                                people_to_msg, points_to_msg)
from ros_3d_bb.core.params import nearest_name
from ros_3d_bb.planning.planner_view import footprint_points, in_frame, ring_points

CLEARING_SPACING_M = 0.025  # half a cell of a typical costmap, so that the clearing rays pass through every cell
CLEARING_HEIGHT_M = 0.5  # above the robot's frame, within the height range of costmaps


class Output(NamedTuple):
    """One published topic.

    `write(tracks, frame_from_tracks, header)` builds the message from tracks in their original frame. `frame` is the
    frame of the message's coordinates; if empty, the frame of the tracks is used, for planners that transform messages
    themselves. `to_now` states that the planner ignores the stamp: positions are predicted to the current time, and
    published again while no new tracks arrive; otherwise positions are those at the stamp of the image. `float32`
    states that the message stores coordinates as float32.
    """

    topic: str
    kind: Any
    write: Callable
    frame: str = ''
    to_now: bool = False
    float32: bool = False


class OptionalOutput(NamedTuple):
    """An output whose message type is defined in a package that may not be installed."""

    topic: str
    package: str
    kind: str
    write: Callable
    in_planner_frame: bool = False
    to_now: bool = False
    float32: bool = False


OPTIONAL = {
    'people': OptionalOutput('/people', 'people_msgs', 'People', people_to_msg, to_now=True),
    'teb': OptionalOutput('~obstacles', 'costmap_converter', 'ObstacleArrayMsg', obstacles_to_msg,
                          in_planner_frame=True, to_now=True, float32=True),
    'mpc': OptionalOutput('~objects', 'derived_object_msgs', 'ObjectArray', objects_to_msg,
                          in_planner_frame=True, to_now=True),
    'vision': OptionalOutput('~detections', 'vision_msgs', 'Detection3DArray', detections3d_to_msg)}
NAMES = ['costmap'] + sorted(OPTIONAL)


def outputs_from(params):
    """Create the outputs that the parameters select.

    Returns
    -------
    list of Output

    Raises
    ------
    ValueError
        If an output is unknown, or the package that it needs is not installed; the message names it.
    """
    if not params.outputs:
        raise ValueError('parameter ~outputs is empty; some of %s expected' % ', '.join(NAMES))
    for name in params.outputs:
        if name not in NAMES:
            raise ValueError('parameter ~outputs has %r; did you mean %s? Known: %s'
                             % (name, nearest_name(str(name), NAMES), ', '.join(NAMES)))
    found = [_optional_output(name, params.planner_frame) for name in OPTIONAL if name in params.outputs]
    return found + (_costmap_outputs(params) if 'costmap' in params.outputs else [])


def _optional_output(name, planner_frame):
    wanted = OPTIONAL[name]
    try:
        messages = importlib.import_module(wanted.package + '.msg')
    except ImportError as error:
        raise ValueError('output %s needs the package %s (%s): install it (rosdep key %s, on Noetic: apt install '
                         'ros-noetic-%s) or take %s out of ~outputs'
                         % (name, wanted.package, error, wanted.package, wanted.package.replace('_', '-'), name))
    return Output(wanted.topic, getattr(messages, wanted.kind), functools.partial(_converted, wanted.write, messages),
                  planner_frame if wanted.in_planner_frame else '', wanted.to_now, wanted.float32)


def _converted(write, messages, tracks, frame_from_tracks, header):
    return write(in_frame(tracks, frame_from_tracks), header, messages)


def _costmap_outputs(params):
    """Outputs for costmaps: the points to mark, and a ring around the robot up to which the costmap is cleared first.

    Both are in the robot's frame, because coordinates are float32 and stay small there in any map. They are level in
    the frame of the tracks even if the robot is tilted, because costmaps filter points by height in the fixed frame.
    """
    outputs = [Output('~points', PointCloud2, functools.partial(_footprints, params), params.robot_frame, float32=True)]
    if params.clearing_range:
        ring_m = ring_points(params.clearing_range, CLEARING_SPACING_M) + [0, 0, CLEARING_HEIGHT_M]
        outputs.append(Output('~clearing_points', PointCloud2, functools.partial(_ring, ring_m), params.robot_frame))
    return outputs


def _footprints(params, tracks, robot_from_tracks, header):
    points_m = footprint_points(tracks, params.points_prediction, params.point_spacing)
    return points_to_msg(transform_points(robot_from_tracks, points_m), header)


def _ring(ring_m, _tracks, robot_from_tracks, header):
    """Message with a ring around the robot's origin, level in the frame of the tracks."""
    return points_to_msg(ring_m.dot(robot_from_tracks[:3, :3].T), header)
