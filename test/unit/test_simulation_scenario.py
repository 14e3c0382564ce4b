"""Scenario files: values, and error messages for invalid files."""
import pytest

from ros_3d_bb_lab.simulation.scenario import (Drive, Follow, Furniture, Mount, Move, Person, Robot, Room, Scenario,
                                               scenario_from)

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
    ('scenario', 'seed', True, 'True', 'number'),
    ('scenario.room', 'bounds', [0, 1, 2], '[0, 1, 2]', '4 numbers'),
    ('scenario.room.furniture[2]', 'color', [1, 2, 256], '256', '255'),
    ('scenario.robot.follow', 'person', .5, '0.5', 'integer'),
    ('scenario.people[1]', 'crouch', 1.1, '1.1', '0 to 1'),
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
        'people': [{'start': [3, 3], 'repeat': True,
                    'moves': [{'to': [4, 3], 'speed': 1}, {'wait': 1, 'facing': 2, 'crouch': .5}]}]})
    assert scenario == Scenario(
        3.0, 10.0, 2 ** 32 - 1, False, 0.0, Room((-5, 5, -6, 6), 3.0, (Furniture((1, 2), (1, 1, 2), .5),)),
        Robot((0, 1, 2), (Move(turn=-1.0),), pitch=.1),
        (Person((3, 3), moves=(Move(to=(4, 3), speed=1.0), Move(wait=1.0, facing=2.0, crouch=.5)), repeat=True),))
    assert isinstance(scenario.seed, int) and isinstance(scenario.duration, float)
