"""Elements of worlds of Gazebo in SDF (http://sdformat.org/spec), and worlds/people.world, which the build writes.

The build may run this file with Python 2 and without any package.
"""
import math
import sys
import xml.etree.ElementTree as ElementTree

SUN = {'pose': '0 0 10 0 0 0', 'diffuse': '0.8 0.8 0.8 1', 'specular': '0.2 0.2 0.2 1',
       'direction': '0.5 0.2 -0.85', 'cast_shadows': 'false'}
WALL_COLOR, FLOOR_COLOR = (190, 186, 173), (128, 122, 115)
WOOD_COLOR = (140, 97, 56)
# Name, size, centre (metres) and colour of the boxes in worlds/people.world.
ROOM = [('wall_front', (0.1, 9.2, 2.5), (9.55, 0, 1.25), WALL_COLOR),
        ('wall_back', (0.1, 9.2, 2.5), (-2.55, 0, 1.25), WALL_COLOR),
        ('wall_left', (12, 0.1, 2.5), (3.5, 4.55, 1.25), WALL_COLOR),
        ('wall_right', (12, 0.1, 2.5), (3.5, -4.55, 1.25), WALL_COLOR),
        ('table', (0.8, 1.6, 0.75), (3.6, 3.7, 0.375), WOOD_COLOR),
        ('sofa', (2.0, 0.9, 0.8), (6.0, -4.0, 0.4), (64, 82, 115)),
        ('shelf', (0.4, 1.8, 2.0), (9.3, -1.8, 1.0), WOOD_COLOR),
        ('cabinet', (0.5, 1.2, 1.1), (9.25, 2.6, 0.55), (217, 217, 217))]
TURN_M, STEPS = 0.5, 20  # radius of the turns, and waypoints of a round, in worlds/people.world


def add(parent, tag, text=None, **attributes):
    """Add an element. Returns it."""
    element = ElementTree.SubElement(parent, tag, attributes)
    element.text = text
    return element


def new_world(name):
    """A document, and its world with a light."""
    sdf = ElementTree.Element('sdf', version='1.6')
    world = add(sdf, 'world', name=name)
    sun = add(world, 'light', name='sun', type='directional')
    for tag, text in sorted(SUN.items()):
        add(sun, tag, text)
    return sdf, world


def add_static(world, name):
    """Add a static model. Returns its link."""
    model = add(world, 'model', name=name)
    add(model, 'static', 'true')
    return add(model, 'link', name='link')


def add_shape(link, name, shape, values, pose, color):
    """Add a shape with its values {tag: text}, a pose (x, y, z, roll, pitch, yaw) and a colour (RGB, 0 to 255)."""
    for kind in ('collision', 'visual'):
        part = add(link, kind, name=name)
        add(part, 'pose', ' '.join('%.4g' % value for value in pose))
        geometry = add(add(part, 'geometry'), shape)
        for tag, text in sorted(values.items()):
            add(geometry, tag, text)
    material = add(part, 'material')
    for light in ('ambient', 'diffuse'):
        add(material, light, '%.3f %.3f %.3f 1' % tuple(value / 255.0 for value in color))


def add_box(link, name, size_m, center_m, yaw, color):
    """Add a box with a size (3,) and a centre (3,)."""
    add_shape(link, name, 'box', {'size': '%.4g %.4g %.4g' % tuple(size_m)}, tuple(center_m) + (0, 0, yaw), color)


def add_actor(world, name, skin, motion, waypoints, loop, delay_s=0):
    """Add a person who passes waypoints (time, x, y, yaw) with the motion `walk` or `stand`. Returns the actor.

    Skins and motions are part of Gazebo (media/models).
    """
    actor = add(world, 'actor', name=name)
    add(add(actor, 'skin'), 'filename', skin + '.dae')
    animation = add(actor, 'animation', name=motion)
    add(animation, 'filename', motion + '.dae')
    if motion == 'walk':
        add(animation, 'interpolate_x', 'true')
    script = add(actor, 'script')
    add(script, 'loop', loop)
    add(script, 'delay_start', '%g' % delay_s)
    trajectory = add(script, 'trajectory', id='0', type=motion)
    for time_s, x, y, yaw in waypoints:
        waypoint = add(trajectory, 'waypoint')
        add(waypoint, 'time', '%g' % time_s)
        add(waypoint, 'pose', '%.4f %.4f 0 0 0 %.4f' % (x, y, yaw))
    return actor


def add_body(actor):
    """Add an upright cylinder for what touches an actor, and laser scanners of type ray, if src/person_body.cc was
    built. Cameras see actors as they are rendered.

    Its pose is relative to the hips, whose y axis points up. Gazebo takes the first link for the skin, and moves people
    about 20 times a second.
    """
    add(actor, 'link', name='skin')
    body = add(actor, 'link', name='body')
    add(body, 'pose', '0 -0.15 0 -1.571 0 0')
    cylinder = add(add(add(body, 'collision', name='body'), 'geometry'), 'cylinder')
    add(cylinder, 'radius', '0.2')
    add(cylinder, 'length', '1.7')
    add(actor, 'plugin', name='body', filename='libros_3d_bb_person_body.so')


def around(center_x, half_m, period_s, start_m, side=1):
    """Waypoints of a round: straight along y up to `half_m`, and turned with `TURN_M`; clockwise, or not if `side` is
    -1. It begins `start_m` after the beginning of the first straight.

    They are evenly spaced, because Gazebo joins them by a spline that otherwise overshoots; yaw continues past a full
    turn, so that actors do not spin in place.
    """
    half_round_m = 2 * half_m + math.pi * TURN_M
    for step in range(STEPS + 1):
        half_rounds, along_m = divmod(start_m + 2.0 * half_round_m * step / STEPS, half_round_m)
        turned = max(0, along_m - 2 * half_m) / TURN_M
        sign = -1 if half_rounds % 2 else 1
        x = -TURN_M * math.cos(turned)
        y = min(along_m, 2 * half_m) - half_m + TURN_M * math.sin(turned)
        yaw = -math.pi * (1.5 + half_rounds) - turned
        yield period_s * float(step) / STEPS, center_x + sign * x, side * sign * y, side * yaw


def people_world():
    """Four people in a room, based on the scenes of the thesis (Fig. 4.1), for a robot at the origin facing along x.

    `near` and `far` pass each other, `front` crosses the whole field of view in front of them, `standing` stands still.
    Each person has a separate lane, so they never come close to each other.
    """
    sdf, world = new_world('people')
    camera = add(add(world, 'gui'), 'camera', name='user_camera')
    add(camera, 'pose', '-3.5 -3.5 6.5 0 0.66 0.44')  # the view in the Gazebo window: from above, behind the robot
    plane = {'normal': '0 0 1', 'size': '50 50'}
    add_shape(add_static(world, 'floor'), 'floor', 'plane', plane, (0,) * 6, FLOOR_COLOR)
    room = add_static(world, 'room')
    for name, size_m, center_m, color in ROOM:
        add_box(room, name, size_m, center_m, 0, color)
    for actor in (add_actor(world, 'front', 'moonwalk', 'walk', around(3.4, 2.0, 16.0, -2.011), 'true'),
                  add_actor(world, 'near', 'walk', 'walk', around(5.1, 1.5, 14.0, 0.357), 'true'),
                  add_actor(world, 'far', 'walk', 'walk', around(6.7, 2.2, 14.0, 0.707, -1), 'true'),
                  add_actor(world, 'standing', 'stand', 'stand', ((0, 8.2, 0.9, math.pi), (60, 8.2, 0.9, math.pi)),
                            'true')):
        add_body(actor)
    return sdf


if __name__ == '__main__':
    ElementTree.ElementTree(people_world()).write(sys.argv[1])
