"""Scenario files: error messages for invalid files, and checks of the shipped scenarios."""
import glob
import os

import numpy as np
import pytest

from ros_3d_bb_lab.simulation.motion import person_motion, robot_motion
from ros_3d_bb_lab.simulation.scenario import (Drive, Follow, Furniture, Mount, Move, Person, Robot, Room, Scenario,
                                               read_scenario, scenario_from)

FOLDER = os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', '..', 'config', 'scenarios')
SHIPPED = sorted(os.path.basename(path) for path in glob.glob(os.path.join(FOLDER, '*.yaml')))
RATE_HZ, AFTER_S, HEIGHT_M = 10, 2.0, 1.75  # AFTER_S: duration of the last prediction
# Key path of each record, as in error messages.
PLACES = {'scenario': (Scenario, lambda record: record),
          'scenario.room': (Room, lambda record: {'room': record}),
          'scenario.room.furniture[2]': (Furniture, lambda record: {'room': {'furniture': [
              {'at': [0, 0], 'size': [1, 1, 1]}, dict({'at': [1, 1], 'size': [1, 1, 1]}, **record)]}}),
          'scenario.robot': (Robot, lambda record: {'robot': record}),
          'scenario.robot.cameras[1]': (Mount, lambda record: {'robot': {'cameras': [
              dict({'name': 'front'}, **record)]}}),
          'scenario.robot.drive': (Drive, lambda record: {'robot': {'drive': record}}),
          'scenario.robot.follow': (Follow, lambda record: {'people': [{'start': [1, 1]}], 'robot': {
              'follow': dict({'person': 1}, **record)}}),
          'scenario.people[1]': (Person, lambda record: {'people': [dict({'start': [1, 1]}, **record)]}),
          'scenario.people[1].moves[1]': (Move, lambda record: {'people': [{'start': [1, 1], 'moves': [
              dict({'wait': 1.0}, **record)]}]})}
KEYS = [(where, name) for where, (kind, _wrap) in PLACES.items() for name in kind._fields]


def error_of(content):
    with pytest.raises(ValueError) as caught:
        scenario_from(content)
    return str(caught.value)


def content_with(where, name, value):
    return PLACES[where][1]({name: value})


@pytest.mark.parametrize('where,name', KEYS)
def test_errors_name_the_path_of_a_key(where, name):
    text = error_of(content_with(where, name + 'x', 1))
    assert text.startswith(where + ' ') and "'%sx'" % name in text and ' mean %s?' % name in text
    for value in (None, 'much', '1.0', object(), float('nan'), float('inf'), [[1]], [1, 'a', 2], {'a': 1}, {1: 2}):
        if name == 'name' and value == 'much':
            continue
        text = error_of(content_with(where, name, value))
        assert text.startswith('%s.%s' % (where, name)) and ('expected' in text or 'unknown key' in text)


# The second to last entry is the value in the message, the last one the limit or type that is expected.
@pytest.mark.parametrize('where,name,value,quoted,expected', [
    ('scenario', 'duration', 0, '0', 'more than 0'),
    ('scenario', 'rate', 5000, '5000', '1000'),
    ('scenario', 'seed', -1, '-1', 'integer'),
    ('scenario', 'seed', 1.5, '1.5', 'integer'),
    ('scenario', 'seed', True, 'True', 'number'),
    ('scenario', 'depth_noise', 1, '1', 'true'),
    ('scenario', 'color_noise', -1, '-1', 'at least 0'),
    ('scenario', 'people', {}, '{}', 'list'),
    ('scenario.room', 'bounds', [0, 1, 2], '[0, 1, 2]', '4 numbers'),
    ('scenario.room.furniture[2]', 'color', [1, 2, 256], '256', '255'),
    ('scenario.robot.cameras[1]', 'name', 'the front', "'the front'", 'name'),
    ('scenario.people[1]', 'crouch', 1.1, '1.1', '0 to 1'),
    ('scenario.robot.drive', 'odometry_error', [1.0, 0], '1.0', 'less than 1'),
    ('scenario.people[1].moves[1]', 'wait', -1, '-1', 'at least 0')])
def test_the_error_of_a_value_out_of_range_names_path_value_and_limit(where, name, value, quoted, expected):
    key, _verb, rest = error_of(content_with(where, name, value)).split(' ', 2)
    assert key.partition('[')[0] == ('%s.%s' % (where, name)).partition('[')[0] and name in key
    assert rest.split('; ')[0] == quoted and expected in rest.split('; ')[1]


def test_values_are_read_into_their_attributes():
    scenario = scenario_from({
        'duration': 3, 'rate': 10, 'seed': 2 ** 32 - 1, 'depth_noise': False, 'color_noise': 0,
        'room': {'bounds': [-5, 5, -6, 6], 'height': 3, 'furniture': [{'at': [1, 2], 'size': [1, 1, 2], 'yaw': .5}]},
        'robot': {'pose': [0, 1, 2], 'moves': [{'turn': -1}], 'pitch': .1},
        'people': [{'start': [3, 3], 'repeat': True, 'long_hair': True, 'shirt': [1, 2, 3],
                    'moves': [{'to': [4, 3], 'speed': 1}, {'wait': 1, 'facing': 2, 'crouch': .5}]}]})
    assert scenario == Scenario(
        3.0, 10.0, 2 ** 32 - 1, False, 0.0, Room((-5, 5, -6, 6), 3.0, (Furniture((1, 2), (1, 1, 2), .5),)),
        Robot((0, 1, 2), (Move(turn=-1.0),), pitch=.1),
        (Person((3, 3), moves=(Move(to=(4, 3), speed=1.0), Move(wait=1.0, facing=2.0, crouch=.5)), repeat=True,
                long_hair=True, shirt=(1, 2, 3)),))
    assert isinstance(scenario.seed, int) and isinstance(scenario.duration, float)


def trajectories(scenario):
    """Times, positions of the people (times, n, 2), and positions of the robot (times, 2)."""
    times_s = np.arange(0, scenario.duration + AFTER_S, 1. / RATE_HZ)
    motions = [person_motion(person, HEIGHT_M, scenario.duration) for person in scenario.people]
    robot = robot_motion(scenario.robot, motions, scenario.duration)
    people = np.array([[motion.at(time_s).position_m for motion in motions] for time_s in times_s])
    return times_s, people.reshape(len(times_s), -1, 2), np.array([robot.at(time_s).position_m for time_s in times_s])


def distance_to(furniture, points):
    """Distance of points (..., 2) from the footprint of a piece of furniture; 0 inside."""
    c, s = np.cos(furniture.yaw), np.sin(furniture.yaw)
    local = (points - np.array(furniture.at)).dot([[c, -s], [s, c]])
    return np.linalg.norm(np.maximum(np.abs(local) - np.array(furniture.size[:2]) / 2, 0), axis=-1)


def assert_apart(distances_m, min_m, times_s, objects):
    """Assert that distances, whose first axis is time, exceed a minimum."""
    worst = np.unravel_index(np.argmin(distances_m), distances_m.shape) if distances_m.size else None
    assert worst is None or distances_m[worst] > min_m, '%s: %.2f m at %.1f s, numbers %s from 1' % (
        objects, distances_m[worst], times_s[worst[0]], [number + 1 for number in worst[1:]])


@pytest.mark.slow
@pytest.mark.parametrize('name', sorted(set(SHIPPED) - {'follow.yaml'}))  # its robot is driven, its people give way
def test_shipped_scenarios_have_no_collisions(name):
    scenario = read_scenario(os.path.join(FOLDER, name))
    times_s, people, robot = trajectories(scenario)
    low, high = np.array(scenario.room.bounds).reshape(2, 2).T
    assert_apart(np.minimum(people - low, high - people).min(axis=-1), .3, times_s, 'a person and the wall')
    assert_apart(np.minimum(robot - low, high - robot).min(axis=-1), .4, times_s, 'the robot and the wall')
    for number, item in enumerate(scenario.room.furniture, 1):
        assert_apart(distance_to(item, people), .2, times_s, 'a person and furniture %d' % number)
        assert_apart(distance_to(item, robot), .4, times_s, 'the robot and furniture %d' % number)
    between = np.linalg.norm(people[:, :, None] - people[:, None], axis=-1)
    assert_apart(between + 9 * np.eye(people.shape[1]), .45, times_s, 'two people')
    assert_apart(np.linalg.norm(people - robot[:, None], axis=-1), .6, times_s, 'a person and the robot')
