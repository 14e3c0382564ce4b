"""Pairing by stamp: the last second of messages, and those that wait for one. Stamps are integer nanoseconds."""
import collections
import time
from typing import Any, NamedTuple

NS = 1000000000  # nanoseconds in a second
MAX_WAITING = 100  # boxes that wait at once; more than any camera sends in a second
MAX_RATE_HZ = 300  # by stamps; no camera is faster. Closer stamps stand still, and not all of their images are kept
JUMP_NS = NS  # stamps that are earlier or later than expected by more show a jump in time


def arrival_clock_ns():
    """The machine's clock: tells when something arrived, whatever /clock does; never a stamp."""
    return int(time.monotonic() * NS)


class Stamped(NamedTuple):
    """A value with its stamp, and when it arrived here on a clock of the caller's; both integer nanoseconds."""

    stamp_ns: int
    arrival_ns: int
    value: Any


class StampedCache(object):
    """The latest values of one topic, as far back as `length_ns` before the newest.

    Their number is bounded, whatever the stamps are: a driver whose clock hangs, or a frozen /clock, must not fill the
    memory. The bound is a count, as arrival times say nothing where a bag is played slowly.
    """

    def __init__(self, length_ns):
        self._length_ns = length_ns
        self._entries = collections.deque(maxlen=length_ns * MAX_RATE_HZ // NS + 1)

    def __len__(self):
        return len(self._entries)

    def __reversed__(self):
        """The entries, the newest first."""
        return reversed(self._entries)

    @property
    def newest_ns(self):
        """The newest stamp, None where the cache is empty."""
        return self._entries[-1].stamp_ns if self._entries else None

    def add(self, stamp_ns, arrival_ns, value):
        """Keep a value.

        One topic brings its stamps in order; where one goes back, time did (a bag looped, somebody sought in it), and
        the values of the time before are forgotten. Of values with equal stamps the newest is kept.

        Returns
        -------
        bool
            Whether time went back.
        """
        went_back = bool(self._entries) and stamp_ns < self.newest_ns
        if went_back:
            self.clear()
        elif stamp_ns == self.newest_ns:
            self._entries.pop()
        self._entries.append(Stamped(stamp_ns, arrival_ns, value))
        while self._entries[0].stamp_ns < stamp_ns - self._length_ns:
            self._entries.popleft()
        return went_back

    def at(self, stamp_ns, tolerance_ns=0):
        """The entry whose stamp is nearest, within the tolerance; None where there is none."""
        return self._nearest(lambda entry: abs(entry.stamp_ns - stamp_ns), tolerance_ns)

    def arrived_at(self, arrival_ns, tolerance_ns):
        """The entry that arrived nearest to a time, within the tolerance; None where there is none."""
        return self._nearest(lambda entry: abs(entry.arrival_ns - arrival_ns), tolerance_ns)

    def _nearest(self, distance_ns, tolerance_ns):
        best = min(self._entries, key=distance_ns, default=None)
        return best if best is not None and distance_ns(best) <= tolerance_ns else None

    def clear(self):
        """Forget everything."""
        self._entries.clear()


class Frame(NamedTuple):
    """A depth image and the camera it was taken with."""

    stamp_ns: int
    depth: Any
    camera: Any


class Pairing(object):
    """Pairs the boxes found in colour images with the depth image and the camera of the same stamp.

    Boxes come later than their depth image by the time the detector takes. Those that come first wait for it, and for
    its camera; where that is lost, the one nearest in time serves once the next image shows that it will not come.
    Boxes without a stamp are paired by their arrival: with the depth image that came nearest to `assumed_delay_ns`
    before them. A camera without a stamp serves any image: what it says of the lens does not change with time.

    Each `add_` returns what it settled, a list of (Frame, boxes) in the order in which the boxes came; (None, boxes)
    where the image did not come in time, or was lost.

    Parameters
    ----------
    length_ns : int
        How long images are kept, and how long boxes wait.
    tolerance_ns : int
        By how much the stamps of a pair may differ.
    assumed_delay_ns : int
        How long the detector takes, for boxes without a stamp; an attribute, too.
    """

    def __init__(self, length_ns, tolerance_ns, assumed_delay_ns):
        self._length_ns, self._tolerance_ns, self.assumed_delay_ns = length_ns, tolerance_ns, assumed_delay_ns
        self._depths, self._cameras = StampedCache(length_ns), StampedCache(length_ns)
        self._plain_camera = None  # without a stamp; None where the newest one has a stamp
        self._waiting = []
        self._end_before_ns = 0  # the last stamp before time went back
        self._forgotten = 0

    @property
    def newest_ns(self):
        """The stamp of the newest depth image, None where none has come."""
        return self._depths.newest_ns

    @property
    def has_camera(self):
        """Whether any camera has come."""
        return len(self._cameras) > 0 or self._plain_camera is not None

    def add_depth(self, stamp_ns, now_ns, depth):
        """Take a depth image; where its stamp goes back, everything of the time before is forgotten."""
        newest_ns = self.newest_ns
        if self._depths.add(stamp_ns, now_ns, depth):
            if (self._cameras.newest_ns or 0) > stamp_ns + self._length_ns:  # no camera of the new time has come yet
                self._cameras.clear()
            self._forgotten += len(self._waiting)
            self._waiting = []
            self._end_before_ns = newest_ns
        return self._settled(now_ns)

    def add_camera(self, stamp_ns, now_ns, camera):
        """Take the camera of an image; `stamp_ns` None where it carries no stamp: it then replaces all others."""
        if stamp_ns is None:
            self._cameras.clear()
            self._plain_camera = camera
        else:
            self._cameras.add(stamp_ns, now_ns, camera)
            self._plain_camera = None
        return self._settled(now_ns)

    def add_boxes(self, stamp_ns, now_ns, boxes):
        """Take the boxes of one image; `stamp_ns` None where they carry no stamp."""
        if stamp_ns is None:
            depth = self._depths.arrived_at(now_ns - self.assumed_delay_ns, self._length_ns)
            if depth is None:
                return self._settled(now_ns) + [(None, boxes)]
            stamp_ns = depth.stamp_ns
        if self._is_of_time_before(stamp_ns):
            self._forgotten += 1
        else:
            self._waiting.append(Stamped(stamp_ns, now_ns, boxes))
        return self._settled(now_ns)

    def end(self):
        """Nothing more will come: settle what still waits. Returns as the others, all with None."""
        waiting, self._waiting = self._waiting, []
        return [(None, entry.value) for entry in waiting]

    def take_forgotten(self):
        """How many boxes were dropped without a word since the last call, as time went back."""
        forgotten, self._forgotten = self._forgotten, 0
        return forgotten

    def _is_of_time_before(self, stamp_ns):
        """Whether boxes were still on their way when time went back; they are dropped without a word."""
        return self.newest_ns is not None and self.newest_ns + self._length_ns < stamp_ns <= self._end_before_ns

    def _settled(self, now_ns):
        settled, waiting = [], []
        for number, entry in enumerate(self._waiting):
            frame = self._frame(entry.stamp_ns)
            crowded = len(self._waiting) - number > MAX_WAITING
            if frame is not None or crowded or self._is_hopeless(entry, now_ns):
                settled.append((frame, entry.value))
            else:
                waiting.append(entry)
        self._waiting = waiting
        return settled

    def _frame(self, stamp_ns):
        """The frame of a stamp, None as long as a part of it is missing."""
        depth = self._depths.at(stamp_ns, self._tolerance_ns)
        if depth is None:
            return None
        if self._plain_camera is not None:
            return Frame(depth.stamp_ns, depth.value, self._plain_camera)
        camera = self._cameras.at(depth.stamp_ns, self._tolerance_ns)
        if camera is None and max(self._depths.newest_ns, self._cameras.newest_ns or 0) > depth.stamp_ns:
            camera = self._cameras.at(depth.stamp_ns, float('inf'))
        return None if camera is None else Frame(depth.stamp_ns, depth.value, camera.value)

    def _is_hopeless(self, entry, now_ns):
        """Whether boxes have waited too long, or belong to an image that was lost or came too long ago."""
        newest_ns = self.newest_ns
        lost = newest_ns is not None and entry.stamp_ns < newest_ns and (
            self._depths.at(entry.stamp_ns, self._tolerance_ns) is None)
        return lost or now_ns - entry.arrival_ns > self._length_ns
