"""Seeded scenes of the navigation benchmark. The robot is to drive from (0, 0) to `GOAL_M`.

Convention: map frame, metres, radians, seconds. The seed varies positions, speeds and start times of the people.

The robot has three cameras of 55 degrees, which see bearings up to 76 degrees: a person at 1.2 m/s who meets a robot at
0.8 m/s at a right angle stays at a bearing of 56 degrees.
"""
import numpy as np

GOAL_M = (8.0, 0.0)
DURATION_S = 45.0
BOUNDS_M = [-4.0, 13.0, -4.0, 4.0]
MEETING_X_M = 4.0
REACHED_AFTER_S = 5.5  # the undisturbed robot needs this time to MEETING_X_M
DOOR_M = 1.6  # width of the door
RATE_HZ = 10.0  # images of each camera, by default
CAMERAS = [{'name': name, 'mount': [0.17, side * 0.05, 0.20], 'yaw': side * 0.85}
           for name, side in (('left', 1), ('front', 0), ('right', -1))]


def standing(random):
    return [_person((MEETING_X_M, _around(random, 0, .15)), facing=float(random.uniform(-3, 3)))], []


def head_on(random):
    y = _around(random, 0, .15)
    return [_person((10.0, y), _walk((-3.0, y), _around(random, 1.0, .2)))], []


def crossing_left(random):
    return [_crossing(random, 1)], []


def crossing_right(random):
    return [_crossing(random, -1)], []


def overtaking(random):
    y = _around(random, 0, .1)
    return [_person((1.8, y), _walk((12.0, y), _around(random, .35, .05)))], []


def doorway(random):
    """A person comes through a door towards the robot, and gives way."""
    half = DOOR_M / 2
    walls = [_box((5.0, side * (4 + half) / 2), (.2, 4 - half - .02, 2.2)) for side in (1, -1)]
    speed = _around(random, .9, .15)
    moves = _walk((5.0, _around(random, 0, .1)), speed) + _walk((-2.0, _around(random, 1.0, .3)), speed)
    return [dict(_person((9.5, _around(random, 0, .5)), moves), gives_way=True)], walls


def crowd(random):
    """Six people cross in both directions; they give way."""
    people = []
    for number in range(6):
        side, x = 1 - 2 * (number % 2), 2.5 + .8 * number
        goal, speed = (_around(random, x, .8), -3.2 * side), _around(random, .9, .2)
        moves = [{'wait': float(random.uniform(0, 4))}] + _walk(goal, speed)
        people.append(dict(_person((_around(random, x, .2), 3.2 * side), moves), gives_way=True))
    return people, []


def pillar(random):
    """A person steps out from behind a pillar when the robot is near."""
    speed = _around(random, 1.0, .15)
    moves = [{'wait': _around(random, REACHED_AFTER_S - 1.2, .4)}] + _walk((MEETING_X_M + .8, -3.2), speed)
    return [_person((MEETING_X_M + .7, 2.0), moves)], [_box((MEETING_X_M, 1.2), (.7, .7, 2.2))]


SCENES = {scene.__name__: scene for scene in (standing, head_on, crossing_left, crossing_right, overtaking, doorway,
                                              crowd, pillar)}


def scenario_of(name, seed, rate_hz=RATE_HZ):
    random = np.random.RandomState([seed, sorted(SCENES).index(name)])
    people, furniture = SCENES[name](random)
    return {'duration': DURATION_S, 'rate': rate_hz, 'seed': seed, 'people': people,
            'robot': {'pose': [0.0, 0.0, 0.0], 'cameras': CAMERAS},
            'room': {'bounds': BOUNDS_M, 'height': 2.8, 'furniture': furniture}}


def _crossing(random, side):
    """Person who crosses the way of the robot; `side` 1: from the left."""
    speed, x = _around(random, 1.0, .2), _around(random, MEETING_X_M, .2)
    wait_s = REACHED_AFTER_S - 3.2 / speed + _around(random, 0, .5)
    return _person((x, 3.2 * side), [{'wait': wait_s}] + _walk((x, -3.2 * side), speed))


def _person(start, moves=(), facing=0.0):
    return {'start': [float(part) for part in start], 'facing': facing, 'moves': list(moves)}


def _walk(to, speed):
    return [{'to': [float(part) for part in to], 'speed': speed}]


def _box(at, size):
    return {'at': [float(part) for part in at], 'size': list(size)}


def _around(random, center, spread):
    return float(center + random.uniform(-spread, spread))
