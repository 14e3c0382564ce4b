"""Pairing by stamp: the last second of messages, and those that wait for one. Stamps are integer nanoseconds."""
import collections
from typing import Any, NamedTuple

NS = 1000000000  # nanoseconds in a second


class Stamped(NamedTuple):
    """A value with its stamp, and when it arrived here on a clock of the caller's; both integer nanoseconds."""

    stamp_ns: int
    arrival_ns: int
    value: Any


class StampedCache(object):
    """The latest values of one topic, as far back as `length_ns` before the newest."""

    def __init__(self, length_ns):
        self._length_ns = length_ns
        self._entries = collections.deque()

    def __len__(self):
        return len(self._entries)

    @property
    def newest_ns(self):
        """The newest stamp, None where the cache is empty."""
        return self._entries[-1].stamp_ns if self._entries else None

    def add(self, stamp_ns, arrival_ns, value):
        """Keep a value.

        One topic brings its stamps in order; where one goes back, time did (a bag looped, somebody sought in it), and
        the values of the time before are forgotten.

        Returns
        -------
        bool
            Whether time went back.
        """
        went_back = bool(self._entries) and stamp_ns < self.newest_ns
        if went_back:
            self.clear()
        self._entries.append(Stamped(stamp_ns, arrival_ns, value))
        while self._entries[0].stamp_ns < stamp_ns - self._length_ns:
            self._entries.popleft()
        return went_back

    def at(self, stamp_ns, tolerance_ns=0):
        """The entry whose stamp is nearest, within the tolerance; None where there is none."""
        best = min(self._entries, key=lambda entry: abs(entry.stamp_ns - stamp_ns), default=None)
        return best if best is not None and abs(best.stamp_ns - stamp_ns) <= tolerance_ns else None

    def arrived_at(self, arrival_ns):
        """The entry that arrived nearest to a time; None where the cache is empty."""
        return min(self._entries, key=lambda entry: abs(entry.arrival_ns - arrival_ns), default=None)

    def clear(self):
        """Forget everything."""
        self._entries.clear()


class Pairing(object):
    """Pairs the boxes found in colour images with the depth images of the same stamp.

    Boxes come later than their depth image by the time the detector takes; those that come before it wait for it.
    Boxes without a stamp are paired by their arrival: with the depth image that came nearest to `assumed_delay_ns`
    before them.

    Parameters
    ----------
    length_ns : int
        How long depth images are kept, and how long boxes wait.
    tolerance_ns : int
        By how much the stamps of a pair may differ.
    assumed_delay_ns : int
        How long the detector takes, for boxes without a stamp.
    capacity : int
        How many arrays of boxes can wait at once; one more drives out the one that waits longest.
    """

    def __init__(self, length_ns, tolerance_ns, assumed_delay_ns, capacity=10):
        self._length_ns, self._tolerance_ns, self._assumed_delay_ns = length_ns, tolerance_ns, assumed_delay_ns
        self._depths = StampedCache(length_ns)
        self._waiting = collections.deque(maxlen=capacity)

    @property
    def newest_ns(self):
        """The stamp of the newest depth image, None where there is none."""
        return self._depths.newest_ns

    def add_depth(self, stamp_ns, arrival_ns, depth):
        """Take a depth image; where its stamp goes back, everything of the time before is forgotten.

        Returns
        -------
        list of (Stamped or None, boxes)
            Boxes that need wait no longer and their depth image; None where it did not come.
        """
        if self._depths.add(stamp_ns, arrival_ns, depth):
            self._waiting.clear()
        called, staying = [], []
        for boxes in self._waiting:
            due = boxes.stamp_ns <= stamp_ns or arrival_ns - boxes.arrival_ns > self._length_ns
            (called if due or self._matching(boxes) else staying).append(boxes)
        self._waiting.clear()
        self._waiting.extend(staying)
        return [(self._matching(boxes), boxes.value) for boxes in called]

    def add_boxes(self, stamp_ns, arrival_ns, boxes):
        """Take the boxes of one image; `stamp_ns` None where they carry no stamp. Returns as `add_depth`."""
        if stamp_ns is None:
            return [(self._depths.arrived_at(arrival_ns - self._assumed_delay_ns), boxes)]
        entry = Stamped(stamp_ns, arrival_ns, boxes)
        if self._matching(entry) is None and (self.newest_ns is None or stamp_ns > self.newest_ns):
            self._waiting.append(entry)
            return []
        return [(self._matching(entry), boxes)]

    def _matching(self, boxes):
        return self._depths.at(boxes.stamp_ns, self._tolerance_ns)
