"""What became of each input is counted, whoever counts at the same time."""
import sys
import threading
from unittest import mock

import pytest

from ros_3d_bb.core.event_counter import EventCounter


@pytest.fixture
def switching():
    """Threads that take turns as often as Python lets them."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


def test_events_are_counted_in_the_order_in_which_they_came_up():
    events = EventCounter()
    events.count('images')
    events.warn('refused', 'why')
    events.warn('refused', 'why again')
    events.count('images', 3)
    assert list(events.counts.items()) == [('images', 4), ('refused', 2)] and events.sentences == {'refused': 'why'}


def test_events_of_one_message_are_counted_at_once():
    events = EventCounter()
    events.count('boxes')
    events.count_all({'images': 1, 'boxes': 3, 'boxes without depth': 0})
    assert list(events.counts.items()) == [('boxes', 4), ('images', 1), ('boxes without depth', 0)]


def test_a_message_is_counted_as_received_whether_it_is_refused_or_not():
    events = EventCounter()
    with events.receiving('boxes'):
        pass
    with events.receiving('boxes'):
        raise ValueError('3 numbers')
    assert events.received == {'boxes': 2} and events.counts == {'boxes rejected': 1}


def test_other_errors_are_raised_unless_they_are_harmless():
    events = EventCounter()
    with pytest.raises(ZeroDivisionError), events.rejecting('boxes'):
        raise ZeroDivisionError
    events.is_harmless = lambda error: isinstance(error, ZeroDivisionError)
    with events.rejecting('boxes'):
        raise ZeroDivisionError
    assert not events.counts


def test_the_latency_of_a_result_is_the_age_of_its_stamp():
    now, stamp = mock.Mock(to_nsec=lambda: 12500), mock.Mock(to_nsec=lambda: 11700)
    events = EventCounter(clock=lambda: now)
    events.record_latency(stamp)
    assert list(events.lags_ns) == [800]


def test_an_input_that_is_refused_is_counted_and_the_next_is_taken():
    events = EventCounter()
    with events.rejecting('boxes'):
        raise ValueError('3 numbers')
    assert events.counts == {'boxes rejected': 1} and '3 numbers' in events.sentences['boxes rejected']


def test_no_count_is_lost_between_threads(switching):
    """rospy has a thread for each publisher of a topic."""
    events = EventCounter()
    threads = [threading.Thread(target=lambda: [events.count('images') for _ in range(5000)]) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert events.counts == {'images': 20000}


def test_parts_that_are_left_out_are_counted_one_by_one():
    events = EventCounter()
    events.count_dropped('3D boxes', [])
    assert not events.counts
    events.count_dropped('3D boxes', ['box 0 is 11 m wide', 'box 2 is 12 m wide'])
    assert events.counts == {'3D boxes dropped': 2} and 'box 0 is 11 m wide' in events.sentences['3D boxes dropped']
