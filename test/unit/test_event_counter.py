"""Event counters: counts, first messages, and rejected inputs."""
import concurrent.futures
import sys
from unittest import mock

import pytest

from ros_3d_bb.core.event_counter import EventCounter


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


def test_the_latency_of_a_result_is_the_age_of_its_stamp():
    events = EventCounter(clock=lambda: mock.Mock(to_nsec=lambda: 12500))
    events.record_latency(mock.Mock(to_nsec=lambda: 11700))
    assert list(events.lags_ns) == [800]


def test_no_count_is_lost_between_threads(events):
    """rospy has a thread for each publisher of a topic."""
    interval_s = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    with concurrent.futures.ThreadPoolExecutor(4) as pool:
        for _thread in range(4):
            pool.submit(lambda: [events.count('images') for _ in range(5000)])
    sys.setswitchinterval(interval_s)
    assert events.counts == {'images': 20000}
