"""Scenarios as worlds of Gazebo: room, furniture and walking people in SDF (http://sdformat.org/spec).

The robot is not part of a world: Gazebo spawns it from its description.
"""
import xml.etree.ElementTree as ElementTree

import numpy as np

from ros_3d_bb_lab.simulation.motion import person_motion

WAYPOINT_S = 0.25  # Gazebo joins waypoints by a spline, which follows the motion within 2 cm at this distance
HEIGHT_M = 1.75  # of the people of Gazebo
PERSON_NAME = 'person_'  # with a number from 1: name of a person's model
WALL_M = 0.1
WALL_COLOR, FLOOR_COLOR = (190, 186, 173), (128, 122, 115)
LIGHT = {'pose': '0 0 10 0 0 0', 'diffuse': '0.8 0.8 0.8 1', 'specular': '0.2 0.2 0.2 1',
         'direction': '0.5 0.2 -0.85', 'cast_shadows': 'false'}


def world_of(scenario, start_s=0.0):
    """Convert a scenario.Scenario to SDF, a str. People stand at their first position until `start_s` (simulated time).
    """
    sdf = ElementTree.Element('sdf', version='1.6')
    world = _add(sdf, 'world', name='scenario')
    sun = _add(world, 'light', name='sun', type='directional')
    for name, text in sorted(LIGHT.items()):
        _add(sun, name, text)
    room = _add(world, 'model', name='room')
    _add(room, 'static', 'true')
    link = _add(room, 'link', name='link')
    for number, (size_m, center_m, yaw, color) in enumerate(_boxes(scenario.room)):
        _add_box(link, 'box_%d' % number, size_m, center_m, yaw, color)
    for number, person in enumerate(scenario.people, 1):
        motion = person_motion(person, HEIGHT_M, scenario.duration)
        _add_actor(world, PERSON_NAME + str(number), motion, scenario.duration, start_s)
    return ElementTree.tostring(sdf, encoding='unicode')


def _add(parent, tag, text=None, **attributes):
    element = ElementTree.SubElement(parent, tag, attributes)
    element.text = text
    return element


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


def _add_box(link, name, size_m, center_m, yaw, color):
    for kind in ('collision', 'visual'):
        shape = _add(link, kind, name=name)
        _add(shape, 'pose', '%.4g %.4g %.4g 0 0 %.4g' % (tuple(center_m) + (yaw,)))
        _add(_add(_add(shape, 'geometry'), 'box'), 'size', '%.4g %.4g %.4g' % tuple(size_m))
    material = _add(shape, 'material')
    for light in ('ambient', 'diffuse'):
        _add(material, light, '%.3f %.3f %.3f 1' % tuple(np.array(color) / 255))


def _add_actor(world, name, motion, duration_s, start_s):
    actor = _add(world, 'actor', name=name)
    _add(_add(actor, 'skin'), 'filename', 'walk.dae')
    animation = _add(actor, 'animation', name='walk')
    _add(animation, 'filename', 'walk.dae')
    _add(animation, 'interpolate_x', 'true')
    script = _add(actor, 'script')
    _add(script, 'loop', 'false')
    _add(script, 'delay_start', '%g' % start_s)
    trajectory = _add(script, 'trajectory', id='0', type='walk')
    for time_s in np.arange(0, duration_s + WAYPOINT_S, WAYPOINT_S):
        state = motion.at(time_s)
        waypoint = _add(trajectory, 'waypoint')
        _add(waypoint, 'time', '%g' % time_s)
        _add(waypoint, 'pose', '%.4f %.4f 0 0 0 %.4f' % (tuple(state.position_m) + (state.heading_rad,)))
