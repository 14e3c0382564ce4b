"""Event counters for the inputs of a node: processed, rejected or missing."""
import contextlib
import threading
from typing import ContextManager, Dict, Iterable, Iterator, Mapping


class EventCounter(object):
    """Counts events, and keeps the first message about each."""

    def __init__(self) -> None:
        self._lock = threading.Lock()  # a topic with two publishers has two threads
        self.counts: Dict[str, int] = {}  # by event, in the order of first occurrence
        self.received: Dict[str, int] = {}  # number of inputs of each kind
        self.sentences: Dict[str, str] = {}  # first message of each event that has one

    def count(self, event: str, amount: int = 1) -> None:
        self.count_all({event: amount})

    def count_all(self, amounts: Mapping[str, int]) -> None:
        """Count several events at once; `amounts` maps each event to its number."""
        with self._lock:
            for event, amount in amounts.items():
                self.counts[event] = self.counts.get(event, 0) + amount

    def totals(self) -> Dict[str, int]:
        """Return the current counters as a dict: of the events, then '<inputs> received' of each kind of inputs."""
        with self._lock:
            received = {'%s received' % inputs: amount for inputs, amount in self.received.items()}
            return dict(self.counts, **received)

    def note(self, event: str, sentence: str) -> None:
        """Count an event that is worth reporting, and keep its first message."""
        self.count(event)
        self.sentences.setdefault(event, sentence)

    def warn(self, event: str, sentence: str) -> None:
        """Count rejected or missing input; `sentence` states what failed, why, and what happens next."""
        self.note(event, sentence)

    def count_dropped(self, parts: str, faults: Iterable[str]) -> None:
        """Count unusable parts of an input; `faults` has one message for each. The other parts are used."""
        for fault in faults:
            self.warn('%s dropped' % parts, '%s; the others in this image are used' % fault)

    def receiving(self, inputs: str) -> ContextManager[None]:
        """Context manager for a callback: `rejecting`, and count the message as received.

        Comparing both counts shows whether every message had an outcome.
        """
        with self._lock:
            self.received[inputs] = self.received.get(inputs, 0) + 1
        return self.rejecting(inputs)

    @contextlib.contextmanager
    def rejecting(self, inputs: str) -> Iterator[None]:
        """Context manager for the processing of one input: a ValueError rejects the input and is not raised further."""
        try:
            yield
        except ValueError as error:
            self.warn('%s rejected' % inputs, '%s rejected: %s; waiting for the next' % (inputs, error))
        except Exception as error:
            if not self.is_harmless(error):
                raise

    def is_harmless(self, _error: Exception) -> bool:
        """Whether an exception other than ValueError ends the processing of an input without being reported."""
        return False
