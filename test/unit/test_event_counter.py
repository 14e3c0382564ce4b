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
    tally = EventCounter()
    tally.count('images')
    tally.warn('refused', 'why')
    tally.warn('refused', 'why again')
    tally.count('images', 3)
    assert list(tally.counts.items()) == [('images', 4), ('refused', 2)] and tally.sentences == {'refused': 'why'}


def test_events_of_one_message_are_counted_at_once():
    tally = EventCounter()
    tally.count('boxes')
    tally.count_all({'images': 1, 'boxes': 3, 'boxes without depth': 0})
    assert list(tally.counts.items()) == [('boxes', 4), ('images', 1), ('boxes without depth', 0)]


def test_a_message_is_counted_as_received_whether_it_is_refused_or_not():
    tally = EventCounter()
    with tally.receiving('boxes'):
        pass
    with tally.receiving('boxes'):
        raise ValueError('3 numbers')
    assert tally.received == {'boxes': 2} and tally.counts == {'boxes refused': 1}


def test_other_errors_are_raised_unless_they_are_harmless():
    tally = EventCounter()
    with pytest.raises(ZeroDivisionError), tally.rejecting('boxes'):
        raise ZeroDivisionError
    tally.is_harmless = lambda error: isinstance(error, ZeroDivisionError)
    with tally.rejecting('boxes'):
        raise ZeroDivisionError
    assert not tally.counts


def test_the_latency_of_a_result_is_the_age_of_its_stamp():
    now, stamp = mock.Mock(to_nsec=lambda: 12500), mock.Mock(to_nsec=lambda: 11700)
    tally = EventCounter(clock=lambda: now)
    tally.record_latency(stamp)
    assert list(tally.lags_ns) == [800]


def test_an_input_that_is_refused_is_counted_and_the_next_is_taken():
    tally = EventCounter()
    with tally.rejecting('boxes'):
        raise ValueError('3 numbers')
    assert tally.counts == {'boxes refused': 1} and '3 numbers' in tally.sentences['boxes refused']


def test_no_count_is_lost_between_threads(switching):
    """rospy has a thread for each publisher of a topic."""
    tally = EventCounter()
    threads = [threading.Thread(target=lambda: [tally.count('images') for _ in range(5000)]) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert tally.counts == {'images': 20000}


def test_parts_that_are_left_out_are_counted_one_by_one():
    tally = EventCounter()
    tally.leave_out('3D boxes', [])
    assert not tally.counts
    tally.leave_out('3D boxes', ['box 0 is 11 m wide', 'box 2 is 12 m wide'])
    assert tally.counts == {'3D boxes left out': 2} and 'box 0 is 11 m wide' in tally.sentences['3D boxes left out']
