"""The worker: always the newest item, and no item can end it."""
import threading

from ros_3d_bb.core.latest_worker import NewestWorker


def test_only_the_newest_of_the_waiting_items_is_worked_on():
    started, go_on, done = threading.Event(), threading.Event(), threading.Event()
    worked = []

    def work(item):
        started.set()
        assert go_on.wait(10)
        worked.append(item)
        if item == 4:
            done.set()
    worker = NewestWorker(work, None)
    assert not worker.offer(1)
    assert started.wait(10)
    assert [worker.offer(item) for item in (2, 3, 4)] == [False, True, True]
    go_on.set()
    assert done.wait(10)
    worker.stop()
    assert worked == [1, 4]


def test_an_error_is_reported_and_the_next_item_is_worked_on():
    errors, done = [], threading.Event()

    def work(item):
        if item == 'bad':
            raise ValueError('bad item')
        done.set()
    failed = threading.Event()
    worker = NewestWorker(work, lambda error: (errors.append(str(error)), failed.set()))
    worker.offer('bad')
    assert failed.wait(10)
    worker.offer('good')
    assert done.wait(10)
    worker.stop()
    assert errors == ['bad item']
