"""The worker processes the newest item, and continues after an error."""
import threading

from ros_3d_bb.core.latest_worker import NewestWorker


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
