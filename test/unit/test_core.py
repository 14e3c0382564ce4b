import re
import threading
from typing import NamedTuple

import pytest

from ros_3d_bb.core.event_counter import EventCounter
from ros_3d_bb.core.latest_worker import NewestWorker
from ros_3d_bb.core.params import NestedList, Param, parameters, params_from


@pytest.fixture
def events():
    return EventCounter()


def test_events_are_counted_in_order_with_their_first_message(events):
    events.count('images')
    events.warn('broken', 'why')
    events.warn('broken', 'why again')
    events.count_all({'boxes': 1, 'images': 3, 'boxes without depth': 0})
    assert list(events.counts.items()) == [('images', 4), ('broken', 2), ('boxes', 1), ('boxes without depth', 0)]
    assert events.sentences == {'broken': 'why'}


def test_a_message_is_counted_as_received_whether_it_is_rejected_or_not(events):
    with events.receiving('boxes'):
        pass
    with events.receiving('boxes'):
        raise ValueError('3 numbers')
    assert events.received == {'boxes': 2} and events.counts == {'boxes rejected': 1}
    assert '3 numbers' in events.sentences['boxes rejected']


def test_only_the_newest_of_the_waiting_items_is_processed():
    started, may_continue, done = threading.Event(), threading.Event(), threading.Event()
    processed = []

    def work(item):
        started.set()
        assert may_continue.wait(10)
        processed.append(item)
        if item == 4:
            done.set()
    worker = NewestWorker(work, None)
    assert not worker.offer(1)
    assert started.wait(10)
    assert [worker.offer(item) for item in (2, 3, 4)] == [False, True, True]
    may_continue.set()
    assert done.wait(10)
    worker.stop()
    assert processed == [1, 4]


def test_an_error_is_reported_and_the_next_item_is_processed():
    errors, failed, done = [], threading.Event(), threading.Event()
    actions = {'bad': lambda: [][0], 'good': done.set}
    worker = NewestWorker(lambda item: actions[item](), lambda error: (errors.append(error), failed.set()))
    worker.offer('bad')
    assert failed.wait(10)
    worker.offer('good')
    assert done.wait(10)
    worker.stop()
    assert [type(error) for error in errors] == [IndexError]


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
