"""Scenario files: a room, a robot, people and other objects in YAML.

`config/scenarios/README.md` describes all keys and units.
"""
import os
import re
from typing import NamedTuple, Optional, Tuple

import yaml

from ros_3d_bb.core.object_classes import label_fault
from ros_3d_bb.core.yaml_loader import load_yaml
from ros_3d_bb.core.yaml_records import record_from
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
NAME = re.compile(r'[A-Za-z]\w*$')  # a topic namespace
CHECKS = (  # keys, check of a value, and its description
    ({'name'}, NAME.match, 'a name such as front'),
    ({'label'}, lambda label: not label_fault(label), 'the name of a class such as dog'),
    ({'seed', 'person', 'pushed_by'}, lambda number: 0 <= number < 2 ** 32, 'an integer from 0 to 4294967295'),
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
    scenario = record_from(Scenario, content, 'scenario', CHECKS)
    room, robot = scenario.room, scenario.robot
    if not (room.bounds[0] < room.bounds[1] and room.bounds[2] < room.bounds[3]):
        raise ValueError('room.bounds is %s; x0 < x1 and y0 < y1 expected' % (list(room.bounds),))
    # The cameras must stay inside the room at any heading of the robot.
    camera_m = max(sum(abs(part) for part in camera.mount[:2]) for camera in robot.mounts)
    _check_path(room.bounds, 'robot', robot.pose[:2], robot.moves, camera_m)
    for number, person in enumerate(scenario.people, 1):
        _check_path(room.bounds, 'people[%d]' % number, person.start, person.moves)
    for number, scene_object in enumerate(scenario.objects, 1):
        _check_object(scene_object, 'objects[%d]' % number, scenario)
    _check_cameras(robot, room)
    if robot.follow is not None and not 1 <= robot.follow.person <= len(scenario.people):
        raise ValueError('robot.follow.person is %d; 1 to %d expected' % (robot.follow.person, len(scenario.people)))
    return scenario


def with_overrides(scenario, rate=None, seed=None):
    """Replace the rate and the seed of a scenario unless they are None. Raises ValueError if one is invalid."""
    given = {name: value for name, value in (('rate', rate), ('seed', seed)) if value is not None}
    checked = record_from(Scenario, given, checks=CHECKS)
    return scenario._replace(**{name: getattr(checked, name) for name in given})


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
        _check_path(scenario.room.bounds, name, scene_object.start, scene_object.moves)
    elif not 1 <= scene_object.pushed_by <= len(scenario.people):
        raise ValueError('%s.pushed_by is %d; 1 to %d expected' % (name, scene_object.pushed_by, len(scenario.people)))
    elif scene_object.moves:
        raise ValueError('%s has moves and pushed_by; only one of both is allowed' % name)
    if scene_object.size is None and scene_object.label not in SHAPES:
        raise ValueError('%s is a %s, whose shape is not known; a size, or one of %s expected'
                         % (name, scene_object.label, ', '.join(sorted(SHAPES))))


def _check_path(bounds, name, start, moves, margin_m=0.0):
    for number, move in enumerate(moves, 1):
        _check_move(move, '%s.moves[%d]' % (name, number))
    x0, x1, y0, y1 = bounds = [bound + sign * margin_m for bound, sign in zip(bounds, (1, -1, 1, -1))]
    for x, y in [start] + [move.to for move in moves if move.to is not None]:
        if not (x0 < x < x1 and y0 < y < y1):
            raise ValueError('%s is at (%g, %g), outside the room %s' % (name, x, y, bounds))


def _check_move(move, name):
    verbs = [verb for verb in MOVE_KEYS if getattr(move, verb) is not None]
    if len(verbs) != 1:
        raise ValueError('%s has %s; exactly one of to, turn, wait expected' % (name, ' and '.join(verbs) or 'none'))
    for key in Move._fields:
        if getattr(move, key) != Move._field_defaults[key] and key not in MOVE_KEYS[verbs[0]]:
            raise ValueError('%s has %s and %s, which is only allowed with %s'
                             % (name, verbs[0], key, ' or '.join(verb for verb in MOVE_KEYS if key in MOVE_KEYS[verb])))
