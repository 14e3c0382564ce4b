"""Which parameters can be changed while a node runs, as their file in config/ says it."""
from typing import NamedTuple

import pytest

from ros_3d_bb.live_parameters import description_of, parameters_in, plain_values

TEXT = '''# Parameters of some node.
# Those marked Live can be changed.

# How far ahead, seconds. Default: 2.0 (thesis).
# Live: 0 to 7.5.
time: 2.0
# How often. Default: 3. Live: 1 to 9.
count: 3

# --- what is drawn (in colour)
# Colour of it. Default: id. Live: id, status.
color: id
# What is drawn. Default: [a, b]. Live.
shapes: [a, b]
# Whether it is. Default: true. Live.
drawn: true
# Frame of it. Default: map.
frame: map
'''


class Params(NamedTuple):
    time: float = 2.0
    count: int = 3
    color: str = 'id'
    frame: str = 'map'


class Drawing(NamedTuple):
    shapes: list = ('a', 'b')
    drawn: bool = True


@pytest.fixture
def live():
    return [parameter for parameter in parameters_in(TEXT) if parameter.live is not None]


def test_comments_say_what_parameters_mean_and_which_are_live():
    parameters = parameters_in(TEXT)
    assert [parameter.name for parameter in parameters] == ['time', 'count', 'color', 'shapes', 'drawn', 'frame']
    assert [parameter.live for parameter in parameters] == ['0 to 7.5', '1 to 9', 'id, status', '', '', None]
    assert [parameter.section for parameter in parameters] == [''] * 2 + ['what is drawn'] * 4
    assert parameters[0].description == 'How far ahead, seconds. Default: 2.0 (thesis).'
    assert parameters[5].description == 'Frame of it. Default: map.'


def test_types_are_those_of_the_node_and_limits_have_them_too(live):
    description = description_of(live, (Params, Drawing))
    first, group = description.config_description, description.config_description['groups'][0]
    types = {entry['name']: entry['type'] for entry in first['parameters'] + group['parameters']}
    assert types == {'time': 'double', 'count': 'int', 'color': 'str', 'shapes': 'str', 'drawn': 'bool'}
    assert description.min == {'time': 0.0, 'count': 1, 'color': '', 'shapes': '', 'drawn': False}
    assert description.max == {'time': 7.5, 'count': 9, 'color': '', 'shapes': '', 'drawn': True}
    assert description.defaults == {'time': 2.0, 'count': 3, 'color': 'id', 'shapes': 'a, b', 'drawn': True}
    assert all(type(description.max[name]) is type(description.defaults[name]) for name in types)


def test_sections_are_groups(live):
    first = description_of(live, (Params, Drawing)).config_description
    group, = first['groups']
    assert [entry['name'] for entry in first['parameters']] == ['time', 'count']
    assert (group['name'], group['id'], group['parent']) == ('what is drawn', 1, first['id'])
    assert [entry['description'] for entry in group['parameters']][0] == 'Colour of it. Default: id.'


def test_words_to_choose_from_are_a_choice_and_free_text_is_none(live):
    group, = description_of(live, (Params, Drawing)).config_description['groups']
    methods = {entry['name']: entry['edit_method'] for entry in group['parameters']}
    assert "'value': 'status'" in methods['color'] and methods['shapes'] == methods['drawn'] == ''


def test_lists_are_text_with_commas():
    assert plain_values([Params(time=1.0), Drawing(shapes=['c', 4])]) == {
        'time': 1.0, 'count': 3, 'color': 'id', 'frame': 'map', 'shapes': 'c, 4', 'drawn': True}
