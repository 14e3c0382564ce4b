"""Scenario files: a room, a robot, people and other objects in YAML.

`config/scenarios/README.md` describes all keys and units.
"""
import os
import re
from typing import NamedTuple, Optional, Tuple

import yaml

from ros_3d_bb.core.object_classes import label_fault
from ros_3d_bb.core.params import nearest_name
from ros_3d_bb.core.yaml_loader import load_yaml
from ros_3d_bb_lab.simulation.scene_objects import SHAPES

Color = Tuple[int, int, int]
Point = Tuple[float, float]


class Furniture(NamedTuple):
    at: Point
    size: Tuple[float, float, float]
    yaw: float = 0.0
    color: Color = (150, 140, 125)


class Room(NamedTuple):
    """`bounds` are x0, x1, y0, y1."""

    bounds: Tuple[float, float, float, float] = (-3.0, 9.0, -4.0, 4.0)
    height: float = 2.8
    furniture: Tuple[Furniture, ...] = ()


class Move(NamedTuple):
    """One of `to`, `turn` and `wait`; the other keys belong to one of them, see `MOVE_KEYS`."""

    to: Optional[Point] = None
    speed: float = 1.2
    turn: Optional[float] = None
    rate: float = 1.0
    wait: Optional[float] = None
    facing: Optional[float] = None
    crouch: float = 0.0


class Follow(NamedTuple):
    """Follow a person (number from 1) instead of moves."""

    person: int
    distance: float = 2.5
    speed: float = 1.5
    rate: float = 1.0


class Mount(NamedTuple):
    """One of several cameras; its name is the namespace of its topics."""

    name: str
    mount: Tuple[float, float, float] = (0.17, 0.0, 0.20)
    yaw: float = 0.0
    pitch: float = 0.0


class Drive(NamedTuple):
    """Body and drive of a robot that obeys velocity commands. `footprint` is length and width around base_link."""

    footprint: Tuple[float, float] = (0.51, 0.43)  # Jackal
    speed: float = 2.0
    rate: float = 4.0
    acceleration: float = 2.0
    angular_acceleration: float = 5.0
    odometry_error: Tuple[float, float] = (0.02, 0.02)


class Robot(NamedTuple):
    """Robot with one camera (`mount`, `pitch`) or several (`cameras`)."""

    pose: Tuple[float, float, float] = (0.0, 0.0, 0.0)
    moves: Tuple[Move, ...] = ()
    repeat: bool = False
    follow: Optional[Follow] = None
    mount: Tuple[float, float, float] = (0.17, 0.0, 0.20)
    pitch: float = 0.0
    cameras: Tuple[Mount, ...] = ()
    base_height: float = 0.065  # Jackal: the wheels have a radius of 0.098 m, their axis is 0.033 m above base_link
    odometry_drift: Tuple[float, float, float] = (0.0, 0.0, 0.0)
    drive: Drive = Drive()

    @property
    def mounts(self):
        return self.cameras or (Mount('', self.mount, 0.0, self.pitch),)


class Person(NamedTuple):
    """The appearance is random by the seed, and so is the height if it is None."""

    start: Point
    facing: float = 0.0
    crouch: float = 0.0
    moves: Tuple[Move, ...] = ()
    repeat: bool = False
    gives_way: bool = False
    height: Optional[float] = None


class SceneObject(NamedTuple):
    """Object other than a person: `start` and `moves`, or `pushed_by` a person (number from 1).

    Its shape is that of its class (see `scene_objects.SHAPES`) unless `size` (x, y, z) makes it a box, at the height
    `above` over the floor.
    """

    label: str
    start: Optional[Point] = None
    facing: float = 0.0
    moves: Tuple[Move, ...] = ()
    repeat: bool = False
    pushed_by: Optional[int] = None
    size: Optional[Tuple[float, float, float]] = None
    above: float = 0.0
    color: Optional[Color] = None


class Scenario(NamedTuple):
    """Scene. The same `seed` gives the same images."""

    duration: float = 12.0
    rate: float = 15.0
    seed: int = 1
    depth_noise: bool = True
    color_noise: float = 2.2
    room: Room = Room()
    robot: Robot = Robot()
    people: Tuple[Person, ...] = ()
    objects: Tuple[SceneObject, ...] = ()


MOVE_KEYS = {'to': ('to', 'speed', 'rate'), 'turn': ('turn', 'rate'), 'wait': ('wait', 'facing', 'crouch')}
RECORDS = {'room': Room, 'robot': Robot, 'follow': Follow, 'drive': Drive}
LISTS = {'furniture': Furniture, 'people': Person, 'objects': SceneObject, 'moves': Move, 'cameras': Mount}
VECTORS = {'bounds': 4, 'at': 2, 'size': 3, 'to': 2, 'start': 2, 'pose': 3, 'mount': 3, 'odometry_drift': 3,
           'footprint': 2, 'odometry_error': 2, 'color': 3}
FLAGS = {'repeat', 'gives_way', 'depth_noise'}
WHOLE = {'seed', 'person', 'pushed_by'}
NAME = re.compile(r'[A-Za-z]\w*$')  # a topic namespace
TYPES = (  # keys, check of a value, and its description
    (LISTS, lambda value: isinstance(value, list), 'a list'),
    (FLAGS, lambda value: isinstance(value, bool), 'true or false'),
    ({'name'}, lambda value: isinstance(value, str) and NAME.match(value), 'a name such as front'),
    ({'label'}, lambda value: isinstance(value, str) and not label_fault(value), 'the name of a class such as dog'))
RANGES = (  # the same for numbers
    (WHOLE, lambda number: number == int(number) and 0 <= number < 2 ** 32, 'an integer from 0 to 4294967295'),
    ({'duration', 'rate', 'height', 'speed', 'distance', 'size', 'footprint', 'acceleration', 'angular_acceleration'},
     lambda number: number > 0, 'more than 0'),
    ({'odometry_error'}, lambda number: -1 < number < 1, 'more than -1 and less than 1'),
    ({'rate'}, lambda number: number <= 1000, 'at most 1000'),
    ({'wait', 'color_noise', 'above'}, lambda number: number >= 0, 'at least 0'),
    ({'crouch'}, lambda number: 0 <= number <= 1, '0 to 1'),
    ({'color'}, lambda number: 0 <= number <= 255, '0 to 255'))


def read_scenario(path):
    """Read a scenario file. Its `room` may be the path of another file, relative to the scenario file.

    Raises ValueError if the file is not YAML, or has an unknown key or an invalid value; the message names the key and
    the value. Raises OSError if the file cannot be opened.
    """
    content = _load(path)
    if isinstance(content, dict) and isinstance(content.get('room'), str):
        content['room'] = _load(os.path.join(os.path.dirname(path), content['room']))
    try:
        return scenario_from(content)
    except ValueError as error:
        raise ValueError('%s: %s' % (path, error))


def _load(path):
    with open(path) as stream:
        try:
            content = load_yaml(stream)
        except yaml.YAMLError as error:
            raise ValueError('%s is not YAML: %s' % (path, error))
    return {} if content is None else content


def scenario_from(content):
    """Convert the content of a scenario file to a Scenario. Raises ValueError."""
    scenario = _record(Scenario, content, 'scenario')
    room, robot = scenario.room, scenario.robot
    if not (room.bounds[0] < room.bounds[1] and room.bounds[2] < room.bounds[3]):
        raise ValueError('room.bounds is %s; x0 < x1 and y0 < y1 expected' % (list(room.bounds),))
    # The cameras must stay inside the room at any heading of the robot.
    camera_m = max(sum(abs(part) for part in camera.mount[:2]) for camera in robot.mounts)
    _check_inside(room.bounds, 'robot', robot.pose[:2], robot.moves, camera_m)
    for number, person in enumerate(scenario.people, 1):
        _check_inside(room.bounds, 'people[%d]' % number, person.start, person.moves)
    for number, scene_object in enumerate(scenario.objects, 1):
        _check_object(scene_object, 'objects[%d]' % number, scenario)
    _check_cameras(robot, room)
    if robot.follow is not None and not 1 <= robot.follow.person <= len(scenario.people):
        raise ValueError('robot.follow.person is %d; 1 to %d expected' % (robot.follow.person, len(scenario.people)))
    return scenario


def with_overrides(scenario, rate=None, seed=None):
    """Replace the rate and the seed of a scenario unless they are None. Raises ValueError if one is invalid."""
    given = {name: _value(name, value, name) for name, value in (('rate', rate), ('seed', seed)) if value is not None}
    return scenario._replace(**given)


def _check_cameras(robot, room):
    names = [camera.name for camera in robot.cameras]
    if len(set(names)) < len(names):
        raise ValueError('robot.cameras have the names %s; unique names expected' % ', '.join(names))
    if robot.cameras and (robot.mount, robot.pitch) != (Robot().mount, Robot().pitch):
        raise ValueError('robot has mount or pitch as well as cameras; only one of both is allowed')
    for camera in robot.mounts:
        if not 0 < robot.base_height + camera.mount[2] < room.height:
            raise ValueError('robot.mount is %s with robot.base_height %g, outside the room of height %g'
                             % (list(camera.mount), robot.base_height, room.height))


def _check_object(scene_object, name, scenario):
    if (scene_object.start is None) == (scene_object.pushed_by is None):
        raise ValueError('%s is a %s; either start or pushed_by expected' % (name, scene_object.label))
    if scene_object.start is not None:
        _check_inside(scenario.room.bounds, name, scene_object.start, scene_object.moves)
    elif not 1 <= scene_object.pushed_by <= len(scenario.people):
        raise ValueError('%s.pushed_by is %d; 1 to %d expected' % (name, scene_object.pushed_by, len(scenario.people)))
    elif scene_object.moves:
        raise ValueError('%s has moves and pushed_by; only one of both is allowed' % name)
    if scene_object.size is None and scene_object.label not in SHAPES:
        raise ValueError('%s is a %s, whose shape is not known; a size, or one of %s expected'
                         % (name, scene_object.label, ', '.join(sorted(SHAPES))))


def _check_inside(bounds, name, start, moves, margin_m=0.0):
    x0, x1, y0, y1 = bounds = [bound + sign * margin_m for bound, sign in zip(bounds, (1, -1, 1, -1))]
    for x, y in [start] + [move.to for move in moves if move.to is not None]:
        if not (x0 < x < x1 and y0 < y < y1):
            raise ValueError('%s is at (%g, %g), outside the room %s' % (name, x, y, bounds))


def _record(kind, given, where):
    if not isinstance(given, dict):
        raise ValueError('%s is %r; a mapping expected' % (where, given))
    for name in given:
        if name not in kind._fields:
            raise ValueError('%s has the unknown key %r; did you mean %s? Known keys: %s'
                             % (where, name, nearest_name(str(name), kind._fields), ', '.join(kind._fields)))
    try:
        record = kind(**{name: _value(name, value, '%s.%s' % (where, name)) for name, value in given.items()})
    except TypeError:
        required = [name for name in kind._fields if name not in kind._field_defaults]
        raise ValueError('%s has the keys %s; %s expected, too' % (
            where, list(given), ', '.join(name for name in required if name not in given)))
    if kind is Move:
        _check_move(given, where)
    return record


def _check_move(given, where):
    verbs = [name for name in MOVE_KEYS if given.get(name) is not None]
    if len(verbs) != 1:
        raise ValueError('%s is %s; exactly one of to, turn, wait expected' % (where, given))
    for name in given:
        if name not in MOVE_KEYS[verbs[0]]:
            raise ValueError('%s is %s; %s is only allowed with %s'
                             % (where, given, name, ' or '.join(v for v in MOVE_KEYS if name in MOVE_KEYS[v])))


def _value(name, value, where):
    _check(TYPES, name, value, where)
    if name in RECORDS:
        return _record(RECORDS[name], value, where)
    if name in LISTS:
        return tuple(_record(LISTS[name], entry, '%s[%d]' % (where, number)) for number, entry in enumerate(value, 1))
    if name in VECTORS:
        if not (isinstance(value, list) and len(value) == VECTORS[name]):
            raise ValueError('%s is %r; %d numbers expected' % (where, value, VECTORS[name]))
        return tuple(_number(name, entry, where) for entry in value)
    if name in FLAGS or name in ('name', 'label'):
        return value
    return _number(name, value, where)


def _check(checks, name, value, where):
    for names, is_valid, expected in checks:
        if name in names and not is_valid(value):
            raise ValueError('%s is %r; %s expected' % (where, value, expected))


def _number(name, value, where):
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) < 1e10:
        raise ValueError('%s is %r; a number expected' % (where, value))
    _check(RANGES, name, value, where)
    return int(value) if name in WHOLE else float(value)
