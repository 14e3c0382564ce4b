"""What became of each input: counted, and said where something was refused or missing."""
import collections
import contextlib
import threading


MOST_LAGS = 10000  # that are kept for a report, where none can be made


class EventCounter(object):
    """Counts events, and keeps the first sentence about each.

    Parameters
    ----------
    clock : callable, optional
        Returns ROS time (genpy.Time), for the latencies that `answered` records.

    Attributes
    ----------
    counts : dict
        How often each event occurred, in the order in which they came up.
    sentences : dict
        By event, of those with a sentence.
    received : dict
        How many inputs of each kind `taking` saw.
    lags_ns : collections.deque
        Latencies of the newest results, nanoseconds.
    """

    def __init__(self, clock=None):
        self._lock = threading.Lock()  # a topic with two publishers has two threads
        self._clock = clock
        self.counts, self.received = collections.OrderedDict(), collections.OrderedDict()
        self.sentences = {}
        self.lags_ns = collections.deque(maxlen=MOST_LAGS)

    def count(self, event, amount=1):
        """Something went as it should."""
        with self._lock:
            self.counts[event] = self.counts.get(event, 0) + amount

    def count_all(self, amounts):
        """Several events at once, by event."""
        with self._lock:
            for event, amount in amounts.items():
                self.counts[event] = self.counts.get(event, 0) + amount

    def note(self, event, sentence):
        """Something happened that one should know of."""
        self.count(event)
        self.sentences.setdefault(event, sentence)

    def warn(self, event, sentence):
        """Something was refused or missing; `sentence` says what, why, and what happens next."""
        self.note(event, sentence)

    def leave_out(self, parts, faults):
        """Some parts of an input cannot be used; `faults` has one sentence for each. The others are used."""
        for fault in faults:
            self.warn('%s left out' % parts, '%s; the others in this image are used' % fault)

    def receiving(self, inputs):
        """Around a callback: counts its message as received, so that one sees whether each got an outcome."""
        with self._lock:
            self.received[inputs] = self.received.get(inputs, 0) + 1
        return self.rejecting(inputs)

    @contextlib.contextmanager
    def rejecting(self, inputs):
        """Around what is done with one input: a ValueError rejects that input, and the next one is processed."""
        try:
            yield
        except ValueError as error:
            self.warn('%s refused' % inputs, '%s refused: %s; waiting for the next' % (inputs, error))
        except Exception as error:
            if not self.is_harmless(error):
                raise

    def is_harmless(self, _error):
        """Whether an exception other than ValueError ends the processing of an input without being reported."""
        return False

    def record_latency(self, stamp):
        """An image of a stamp was answered: its result is published, or it has none. Makes a rate and a latency."""
        self.lags_ns.append(self._clock().to_nsec() - stamp.to_nsec())
