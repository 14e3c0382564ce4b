import concurrent.futures
import sys
import threading

import pytest

from ros_3d_bb.core.event_counter import EventCounter
from ros_3d_bb.core.latest_worker import NewestWorker


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


def test_no_count_is_lost_between_threads(events):
    """rospy has a thread for each publisher of a topic."""
    interval_s = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    with concurrent.futures.ThreadPoolExecutor(4) as pool:
        for _thread in range(4):
            pool.submit(lambda: [events.count('images') for _ in range(5000)])
    sys.setswitchinterval(interval_s)
    assert events.counts == {'images': 20000}


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
