"""Event counters for the inputs of a node: processed, rejected or missing."""
import collections
import contextlib
import threading

MOST_LAGS = 10000  # maximum number of stored latencies


class EventCounter(object):
    """Counts events, and keeps the first message about each. `clock` returns ROS time, for `record_latency`."""

    def __init__(self, clock=None):
        self._lock = threading.Lock()  # a topic with two publishers has two threads
        self._clock = clock
        self.counts = {}  # by event, in the order of first occurrence
        self.received = {}  # number of inputs of each kind
        self.sentences = {}  # first message of each event that has one
        self.lags_ns = collections.deque(maxlen=MOST_LAGS)  # latencies of the newest results

    def count(self, event, amount=1):
        """Count an expected event."""
        self.count_all({event: amount})

    def count_all(self, amounts):
        """Count several events at once; `amounts` maps each event to its number."""
        with self._lock:
            for event, amount in amounts.items():
                self.counts[event] = self.counts.get(event, 0) + amount

    def totals(self):
        """Return the current counters as a dict: of the events, then '<inputs> received' of each kind of inputs."""
        with self._lock:
            received = {'%s received' % inputs: amount for inputs, amount in self.received.items()}
            return dict(self.counts, **received)

    def note(self, event, sentence):
        """Count an event that is worth reporting, and keep its first message."""
        self.count(event)
        self.sentences.setdefault(event, sentence)

    def warn(self, event, sentence):
        """Count rejected or missing input; `sentence` states what failed, why, and what happens next."""
        self.note(event, sentence)

    def count_dropped(self, parts, faults):
        """Count unusable parts of an input; `faults` has one message for each. The other parts are used."""
        for fault in faults:
            self.warn('%s dropped' % parts, '%s; the others in this image are used' % fault)

    def receiving(self, inputs):
        """Context manager for a callback: `rejecting`, and count the message as received.

        Comparing both counts shows whether every message had an outcome.
        """
        with self._lock:
            self.received[inputs] = self.received.get(inputs, 0) + 1
        return self.rejecting(inputs)

    @contextlib.contextmanager
    def rejecting(self, inputs):
        """Context manager for the processing of one input: a ValueError rejects the input and is not raised further."""
        try:
            yield
        except ValueError as error:
            self.warn('%s rejected' % inputs, '%s rejected: %s; waiting for the next' % (inputs, error))
        except Exception as error:
            if not self.is_harmless(error):
                raise

    def is_harmless(self, _error):
        """Whether an exception other than ValueError ends the processing of an input without being reported."""
        return False

    def record_latency(self, stamp):
        """Record the latency of a processed image, with or without a result, for the reported rate and latency."""
        self.lags_ns.append(self._clock().to_nsec() - stamp.to_nsec())
