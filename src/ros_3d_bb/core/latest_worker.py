"""Worker thread that processes only the newest inputs, for work that is slower than its input."""
import collections
import threading
from typing import Any, Callable, Deque


class NewestWorker(object):
    """Calls `work(item)` in a separate thread with the newest items offered, in order. At most `most` items wait.

    An exception of `work` is passed to `on_error`, and the thread continues with the next item.
    """

    def __init__(self, work: Callable[[Any], Any], on_error: Callable[[Exception], Any], most: int = 1) -> None:
        self._work, self._on_error = work, on_error
        self._news = threading.Condition()
        self._waiting: Deque[Any] = collections.deque(maxlen=most)
        self._stopped = False
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def offer(self, item: Any) -> bool:
        """Offer an item without blocking. Returns whether it replaced an item that was still waiting."""
        with self._news:
            replaced = len(self._waiting) == self._waiting.maxlen
            self._waiting.append(item)
            self._news.notify()
        return replaced

    def stop(self) -> None:
        with self._news:
            self._stopped = True
            self._news.notify()
        self._thread.join()

    def _run(self) -> None:
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
