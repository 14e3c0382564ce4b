"""What planner_bridge_node can publish: topics, messages, and the packages that define them."""
import functools
import importlib
from typing import Any, Callable, NamedTuple

from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from ros_3d_bb.params import nearest_name
from ros_3d_bb.planner_messages import (detections3d_to_message, objects_to_message, obstacles_to_message,
                                        people_to_message, points_to_message)
from ros_3d_bb.tracking.for_planners import footprint_points, ring_points

CLEARING_SPACING_M = 0.025  # half a cell of a usual costmap: the rays from the robot leave out none
CLEARING_HEIGHT_M = 0.5  # above the robot's frame: where costmaps look


class Output(NamedTuple):
    """One topic. `write(tracks, header)` makes its message.

    `to_now`: the planner takes an array for what is now, so positions are predicted to now, and sent again while no
    new ones come; else they are as of the image. `in_planner_frame`: the planner does not transform all there is.
    """

    topic: str
    kind: Any
    write: Callable
    to_now: bool = False
    in_planner_frame: bool = False


class OptionalOutput(NamedTuple):
    """An output whose message is defined in a package that is not on every robot."""

    topic: str
    package: str
    kind: str
    write: Callable
    to_now: bool
    in_planner_frame: bool


OPTIONAL = {
    'people': OptionalOutput('/people', 'people_msgs', 'People', people_to_message, True, False),
    'teb': OptionalOutput('~obstacles', 'costmap_converter', 'ObstacleArrayMsg', obstacles_to_message, True, True),
    'mpc': OptionalOutput('~objects', 'derived_object_msgs', 'ObjectArray', objects_to_message, True, True),
    'vision': OptionalOutput('~detections', 'vision_msgs', 'Detection3DArray', detections3d_to_message, False, False)}
NAMES = ['costmap'] + sorted(OPTIONAL)


def outputs_from(params):
    """The outputs that the parameters ask for, a list of Output.

    Raises
    ------
    ValueError
        If one is not known, or the package that it needs is not there; says which.
    """
    if not params.outputs:
        raise ValueError('parameter ~outputs is empty; some of %s expected' % ', '.join(NAMES))
    for name in params.outputs:
        if name not in NAMES:
            raise ValueError('parameter ~outputs has %r; did you mean %s? Known: %s'
                             % (name, nearest_name(str(name), NAMES), ', '.join(NAMES)))
    found = [_optional_output(name) for name in OPTIONAL if name in params.outputs]
    return found + (_costmap_outputs(params) if 'costmap' in params.outputs else [])


def _optional_output(name):
    wanted = OPTIONAL[name]
    try:
        messages = importlib.import_module(wanted.package + '.msg')
    except ImportError as error:
        raise ValueError('output %s needs the package %s (%s): install it (rosdep key %s, on Noetic: apt install '
                         'ros-noetic-%s) or take %s out of ~outputs'
                         % (name, wanted.package, error, wanted.package, wanted.package.replace('_', '-'), name))
    return Output(wanted.topic, getattr(messages, wanted.kind), functools.partial(_written, wanted.write, messages),
                  wanted.to_now, wanted.in_planner_frame)


def _written(write, messages, tracks, header):
    return write(tracks, header, messages)


def _costmap_outputs(params):
    """What to mark in a costmap, and a ring around the robot to which it is cleared first."""
    outputs = [Output('~points', PointCloud2, functools.partial(_footprints, params))]
    if params.clearing_range:
        ring_m = ring_points(params.clearing_range, CLEARING_SPACING_M) + [0, 0, CLEARING_HEIGHT_M]
        outputs.append(Output('~clearing_points', PointCloud2, functools.partial(_ring, ring_m, params.robot_frame)))
    return outputs


def _footprints(params, tracks, header):
    return points_to_message(footprint_points(tracks, params.points_prediction, params.point_spacing), header)


def _ring(ring_m, robot_frame, _tracks, header):
    return points_to_message(ring_m, Header(stamp=header.stamp, frame_id=robot_frame))
