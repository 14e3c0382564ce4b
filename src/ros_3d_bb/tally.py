"""What became of each input: counted, and said where something was refused or missing."""
import collections
import contextlib
import threading


class Tally(object):
    """Counts events, and keeps the first sentence that was said about each.

    Attributes
    ----------
    counts : dict
        How often each event was, in the order in which they came up.
    sentences : dict
        By event, of those about which something was said.
    """

    def __init__(self):
        self._lock = threading.Lock()  # a topic with two publishers has two threads
        self.counts = collections.OrderedDict()
        self.sentences = {}

    def count(self, event, amount=1):
        """Something went as it should."""
        with self._lock:
            self.counts[event] = self.counts.get(event, 0) + amount

    def count_some(self, event, amount):
        """The same of what seldom happens: nothing is shown of it until it does."""
        if amount:
            self.count(event, amount)

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

    @contextlib.contextmanager
    def refusing(self, inputs):
        """Around what is done with one input: a ValueError there refuses that one, and the next is taken."""
        try:
            yield
        except ValueError as error:
            self.warn('%s refused' % inputs, '%s refused: %s; waiting for the next' % (inputs, error))
