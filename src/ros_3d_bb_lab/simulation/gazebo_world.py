"""Scenarios as worlds of Gazebo: room, furniture and walking people.

The robot is not part of a world: Gazebo spawns it from its description.
"""
import xml.etree.ElementTree as ElementTree

import numpy as np

from ros_3d_bb_lab.simulation.motion import person_motion
from ros_3d_bb_lab.simulation.sdf import FLOOR_COLOR, WALL_COLOR, add_actor, add_box, add_static, new_world

WAYPOINT_S = 0.25  # Gazebo joins waypoints by a spline, which follows the motion within 2 cm at this distance
HEIGHT_M = 1.75  # of the people of Gazebo
PERSON_NAME = 'person_'  # with a number from 1: name of a person's model
WALL_M = 0.1


def world_of(scenario, start_s=0.0):
    """Convert a scenario.Scenario to SDF, a str. People stand at their first position until `start_s` (simulated time).
    """
    sdf, world = new_world('scenario')
    room = add_static(world, 'room')
    for number, (size_m, center_m, yaw, color) in enumerate(_boxes(scenario.room)):
        add_box(room, 'box_%d' % number, size_m, center_m, yaw, color)
    for number, person in enumerate(scenario.people, 1):
        motion = person_motion(person, HEIGHT_M, scenario.duration)
        times_s = np.arange(0, scenario.duration + WAYPOINT_S, WAYPOINT_S)
        waypoints = [(time_s, *motion.at(time_s).position_m, motion.at(time_s).heading_rad) for time_s in times_s]
        add_actor(world, PERSON_NAME + str(number), 'walk', 'walk', waypoints, 'false', start_s)
    return ElementTree.tostring(sdf, encoding='unicode')


def _boxes(room):
    """Size (3,), centre (3,), yaw and colour of floor, walls and furniture."""
    x0, x1, y0, y1 = room.bounds
    center_m, extent_m = np.array([x0 + x1, y0 + y1]) / 2, np.array([x1 - x0, y1 - y0]) + 2 * WALL_M
    yield (extent_m[0], extent_m[1], WALL_M), (center_m[0], center_m[1], -WALL_M / 2), 0, FLOOR_COLOR
    for x in (x0 - WALL_M / 2, x1 + WALL_M / 2):
        yield (WALL_M, extent_m[1], room.height), (x, center_m[1], room.height / 2), 0, WALL_COLOR
    for y in (y0 - WALL_M / 2, y1 + WALL_M / 2):
        yield (extent_m[0], WALL_M, room.height), (center_m[0], y, room.height / 2), 0, WALL_COLOR
    for item in room.furniture:
        yield item.size, item.at + (item.size[2] / 2,), item.yaw, item.color
