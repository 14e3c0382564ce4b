"""Parameters: types, and unknown keys with the nearest known one. test_package.py tests limits and choices."""
import re
from typing import NamedTuple

import pytest

from ros_3d_bb.core.params import NestedList, Param, params_from, parameters


RATE = Param(30.0, 'Rate of the images.', 'Hz', limits=(0.5, 60), live=(1, 60), section='both')


@parameters()
class Camera(NamedTuple):
    rate: float = RATE
    frame: str = Param('camera')
    enabled: bool = Param(True, 'Whether it runs.')


@parameters('filter')
class Filter(NamedTuple):
    rate: float = RATE
    stride: int = Param(20, 'Step.', section='sampling')
    classes: list = Param(('person',), 'What to find.')
    areas: NestedList = Param('', 'Where not to look.')


@pytest.mark.parametrize('kind, name, given, value', [
    (Camera, 'rate', 5, 5.0), (Camera, 'frame', 0, '0'), (Camera, 'frame', '', ''), (Camera, 'enabled', False, False),
    (Filter, 'classes', ['a', 1], ['a', 1]), (Filter, 'classes', 'a, b', ['a', 'b']),
    (Filter, 'classes', 'person', ['person']), (Filter, 'classes', 3, ['3']),
    (Filter, 'areas', [[[1, 2.5], [3, 4]]], '[[[1, 2.5], [3, 4]]]'), (Filter, 'areas', '[[1]]', '[[1]]')])
def test_values_of_a_related_type_are_converted(kind, name, given, value):
    params, = params_from({name: given}, kind)
    assert getattr(params, name) == value and type(getattr(params, name)) is type(value)


@pytest.mark.parametrize('given', [{'rate': 'fast'}, {'rate': True}, {'enabled': 1}, {'enabled': 'yes'},
                                   {'stride': 2.5}, {'stride': True}, {'frame': ['a']}, {'classes': {'a': 1}},
                                   {'areas': {'a': 1}}])
def test_values_of_another_type_are_rejected(given):
    (name, value), = given.items()
    with pytest.raises(ValueError, match=re.escape('parameter ~%s is %r' % (name, value))):
        params_from(given, Camera, Filter)


def test_unknown_keys_name_the_nearest_known_one():
    with pytest.raises(ValueError, match='unknown parameter ~strid; did you mean ~stride') as error:
        params_from({'strid': 5}, Camera, Filter)
    assert str(error.value).endswith('Known: areas, classes, enabled, frame, rate, stride')  # both have rate
