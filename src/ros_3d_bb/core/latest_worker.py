"""Worker thread that processes only the newest inputs, for work that is slower than its input."""
import collections
import threading


class NewestWorker(object):
    """Calls `work(item)` in a separate thread with the newest items offered, in order. At most `most` items wait.

    An exception of `work` is passed to `on_error`, and the thread continues with the next item.
    """

    def __init__(self, work, on_error, most=1):
        self._work, self._on_error = work, on_error
        self._news = threading.Condition()
        self._waiting, self._stopped = collections.deque(maxlen=most), False
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def offer(self, item):
        """Offer an item without blocking. Returns whether it replaced an item that was still waiting."""
        with self._news:
            replaced = len(self._waiting) == self._waiting.maxlen
            self._waiting.append(item)
            self._news.notify()
        return replaced

    def stop(self):
        """Finish the current item and stop the thread."""
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
                item = self._waiting.popleft()
            try:
                self._work(item)
            except Exception as error:  # one item must not end the thread
                self._on_error(error)
