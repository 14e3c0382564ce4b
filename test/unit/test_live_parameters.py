"""Live parameters of a table as dynamic_reconfigure describes them."""
from typing import NamedTuple

import pytest

from ros_3d_bb.core.params import Param, parameters
from ros_3d_bb.nodes.common.live_parameters import description_of, live_in, plain_values


@parameters()
class Params(NamedTuple):
    time: float = Param(2.0, 'How far ahead.', 's', live=(0, 7.5))
    count: int = Param(3, 'How often.', live=(1, 9))
    color: str = Param('id', 'Its colour.', choices=('id', 'status'), live=True, section='drawing')
    frame: str = Param('map', 'Its frame.')


@parameters('drawing')
class Drawing(NamedTuple):
    shapes: list = Param(('a', 'b'), 'What is drawn.', choices=('a', 'b', 'c'), live=True)
    drawn: bool = Param(True, 'Whether it is.', live=True)


KINDS = (Params, Drawing)


@pytest.fixture
def entries():
    """The described parameters by name."""
    first = description_of(KINDS).config_description
    return {entry['name']: entry for group in [first] + first['groups'] for entry in group['parameters']}


def test_types_are_those_of_the_defaults_and_limits_have_them_too(entries):
    description = description_of(KINDS)
    types = {name: entry['type'] for name, entry in entries.items()}
    assert types == {'time': 'double', 'count': 'int', 'color': 'str', 'shapes': 'str', 'drawn': 'bool'}
    assert description.min == {'time': 0.0, 'count': 1, 'color': '', 'shapes': '', 'drawn': False}
    assert description.max == {'time': 7.5, 'count': 9, 'color': '', 'shapes': '', 'drawn': True}
    assert description.defaults == {'time': 2.0, 'count': 3, 'color': 'id', 'shapes': 'a, b', 'drawn': True}
    assert all(type(description.max[name]) is type(description.defaults[name]) for name in types)


def test_sections_are_groups():
    first = description_of(KINDS).config_description
    group, = first['groups']
    assert [entry['name'] for entry in first['parameters']] == ['time', 'count']
    assert [entry['name'] for entry in group['parameters']] == ['color', 'shapes', 'drawn']
    assert (group['name'], group['id'], group['parent']) == ('drawing', 1, first['id'])


def test_descriptions_have_text_unit_and_limits(entries):
    assert entries['time']['description'] == 'How far ahead. Unit: s. Live: 0 to 7.5.'


def test_words_to_choose_from_are_a_choice_and_lists_are_none(entries):
    methods = {name: entry['edit_method'] for name, entry in entries.items()}
    assert "'value': 'status'" in methods['color'] and methods['shapes'] == methods['drawn'] == ''


def test_what_is_read_at_the_start_only_is_not_described():
    assert list(live_in(KINDS)) == ['time', 'count', 'color', 'shapes', 'drawn']


def test_lists_are_text_with_commas():
    assert plain_values([Params(time=1.0), Drawing(shapes=['c', 4])]) == {
        'time': 1.0, 'count': 3, 'color': 'id', 'frame': 'map', 'shapes': 'c, 4', 'drawn': True}
