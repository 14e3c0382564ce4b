"""Work that is slower than its input."""
import threading


class NewestWorker(object):
    """Runs `work(item)` in a thread of its own, always on the newest item offered; what it replaces is dropped.

    Parameters
    ----------
    work : callable
        Called with one item at a time.
    on_error : callable
        Called with the exception where `work` raised one; the thread goes on with the next item.
    """

    def __init__(self, work, on_error):
        self._work, self._on_error = work, on_error
        self._news = threading.Condition()
        self._newest, self._waiting, self._stopped = None, False, False
        self._thread = threading.Thread(target=self._run)
        self._thread.daemon = True
        self._thread.start()

    def offer(self, item):
        """Hand over an item. Returns at once; whether it took the place of one that nobody had worked on yet."""
        with self._news:
            replaced = self._waiting
            self._newest, self._waiting = item, True
            self._news.notify()
        return replaced

    def stop(self):
        """Finish the item at hand and end the thread."""
        with self._news:
            self._stopped = True
            self._news.notify()
        self._thread.join()

    def _run(self):
        while True:
            with self._news:
                self._news.wait_for(lambda: self._waiting or self._stopped)
                if self._stopped:
                    return
                item, self._newest, self._waiting = self._newest, None, False
            try:
                self._work(item)
            except Exception as error:  # one item must not end the thread
                self._on_error(error)
