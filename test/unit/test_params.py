"""Parameters: defaults, types, and unknown keys with the nearest known one."""
from typing import NamedTuple

import pytest

from ros_3d_bb.params import check_not_negative, params_from


class Camera(NamedTuple):
    rate: float = 30.0
    frame: str = 'camera'
    enabled: bool = True


class Filter(NamedTuple):
    stride: int = 20
    classes: list = ('person',)


def test_what_is_not_given_keeps_its_default():
    assert params_from({}, Camera, Filter) == [Camera(), Filter()]
    assert params_from({'rate': 5.0, 'stride': 3}, Camera, Filter) == [Camera(rate=5.0), Filter(stride=3)]


@pytest.mark.parametrize('given,field,value', [
    ({'rate': 5}, 'rate', 5.0), ({'frame': 0}, 'frame', '0'), ({'frame': ''}, 'frame', ''),
    ({'enabled': False}, 'enabled', False)])
def test_values_of_a_kindred_type_are_converted(given, field, value):
    params, = params_from(given, Camera)
    assert getattr(params, field) == value and type(getattr(params, field)) is type(value)


@pytest.mark.parametrize('given,value', [(['a', 1], ['a', 1]), ('a, b', ['a', 'b']), ('person', ['person']),
                                         (3, ['3'])])
def test_lists_can_be_written_with_commas(given, value):
    assert params_from({'classes': given}, Filter)[0].classes == value


@pytest.mark.parametrize('given', [{'rate': 'fast'}, {'rate': True}, {'enabled': 1}, {'enabled': 'yes'},
                                   {'stride': 2.5}, {'stride': True}, {'frame': ['a']}, {'classes': {'a': 1}}])
def test_values_of_another_type_are_named(given):
    (name, value), = given.items()
    with pytest.raises(ValueError) as error:
        params_from(given, Camera, Filter)
    assert '~' + name in str(error.value) and repr(value) in str(error.value)


def test_unknown_keys_name_the_nearest_known_one():
    with pytest.raises(ValueError, match='unknown parameter ~strid; did you mean ~stride'):
        params_from({'strid': 5}, Camera, Filter)


@pytest.mark.parametrize('rate', [-0.1, float('nan'), float('inf'), 1e6])
def test_numbers_that_make_no_sense_are_named(rate):
    check_not_negative(Camera(rate=0.0), 'rate')
    with pytest.raises(ValueError, match='parameter ~rate is .*; 0 or more expected'):
        check_not_negative(Camera(rate=rate), 'rate')
