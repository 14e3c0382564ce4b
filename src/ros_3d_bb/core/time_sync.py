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


class MessageCache(object):
    """The latest values of one topic, as far back as `length_ns` before the newest.

    Their number is bounded, whatever the stamps are: a driver whose clock hangs, or a frozen /clock, must not fill the
    memory. The bound is a count, as arrival times say nothing where a bag is played slowly.

    Attributes
    ----------
    newest_ns : int
        The newest stamp, None where the cache is empty.
    """

    def __init__(self, length_ns):
        self._length_ns = length_ns
        self._entries = collections.deque(maxlen=length_ns * MAX_RATE_HZ // NS + 1)
        self.newest_ns = None

    def __len__(self):
        return len(self._entries)

    def __reversed__(self):
        """The entries, the newest first."""
        return reversed(self._entries)

    def add(self, stamp_ns, arrival_ns, value):
        """Keep a value.

        One topic brings its stamps in order; where one goes back, time did (a bag looped, somebody sought in it), and
        the values of the time before are forgotten. Of values with equal stamps the newest is kept.

        Returns
        -------
        bool
            Whether time went back.
        """
        went_back = self.newest_ns is not None and stamp_ns < self.newest_ns
        if went_back:
            self.clear()
        elif stamp_ns == self.newest_ns:
            self._entries.pop()
        self._entries.append(Stamped(stamp_ns, arrival_ns, value))
        self.newest_ns = stamp_ns
        while self._entries[0].stamp_ns < stamp_ns - self._length_ns:
            self._entries.popleft()
        return went_back

    def nearest(self, stamp_ns, tolerance_ns=0):
        """The entry whose stamp is nearest, within the tolerance; None where there is none."""
        nearest, nearest_ns = None, tolerance_ns
        for entry in list(self._entries):  # a copy, as another thread may add entries
            distance_ns = abs(entry.stamp_ns - stamp_ns)
            if distance_ns < nearest_ns or (nearest is None and distance_ns <= nearest_ns):
                nearest, nearest_ns = entry, distance_ns
        return nearest

    def arrived_at(self, arrival_ns, tolerance_ns):
        """The entry that arrived nearest to a time, within the tolerance; None where there is none."""
        in_time = [entry for entry in list(self._entries) if abs(entry.arrival_ns - arrival_ns) <= tolerance_ns]
        return min(in_time, key=lambda entry: abs(entry.arrival_ns - arrival_ns), default=None)

    def clear(self):
        """Forget everything."""
        self._entries.clear()
        self.newest_ns = None


class StampSynchronizer(object):
    """Pairs the boxes of a colour image with the depth image and the camera of the same stamp.

    Boxes arrive later than their depth image by the latency of the detector. Boxes that arrive first wait for the depth
    image and its camera; where that camera is lost, the one nearest in time is used as soon as a newer message shows
    that it will not come. Boxes without a stamp are paired by arrival: with the depth image that arrived nearest to
    `assumed_delay_ns` before them. A camera without a stamp is used for any image: intrinsics do not change with time.

    All boxes end in one of the two callbacks, in the order in which they arrived. Callbacks are called by `add_depth`,
    `add_camera`, `add_boxes` and `end`.

    Parameters
    ----------
    length_ns : int
        How long images are kept, and how long boxes wait.
    tolerance_ns : int
        By how much the stamps of a pair may differ.
    assumed_delay_ns : int
        Latency of the detector, for boxes without a stamp; an attribute, too.
    on_frame : callable
        Called with boxes, depth and camera of one stamp.
    on_lost : callable
        Called with boxes that stay without depth or camera, and whether the reason is that time went back.
    """

    def __init__(self, length_ns, tolerance_ns, assumed_delay_ns, on_frame, on_lost):
        self._length_ns, self._tolerance_ns, self.assumed_delay_ns = length_ns, tolerance_ns, assumed_delay_ns
        self._on_frame, self._on_lost = on_frame, on_lost
        self._depths, self._cameras = MessageCache(length_ns), MessageCache(length_ns)
        self._plain_camera = None  # without a stamp; None where the newest one has a stamp
        self._waiting = []
        self._end_before_ns = 0  # the last stamp before time went back

    @property
    def newest_ns(self):
        """The stamp of the newest depth image, None before the first."""
        return self._depths.newest_ns

    @property
    def has_camera(self):
        """Whether any camera has arrived."""
        return len(self._cameras) > 0 or self._plain_camera is not None

    def add_depth(self, stamp_ns, now_ns, depth):
        """Add a depth image; where its stamp goes back, everything of the time before is forgotten."""
        newest_ns = self._depths.newest_ns
        if self._depths.add(stamp_ns, now_ns, depth):
            if (self._cameras.newest_ns or 0) > stamp_ns + self._length_ns:  # no camera of the new time has come yet
                self._cameras.clear()
            self._end_before_ns = newest_ns
            forgotten, self._waiting = self._waiting, []
            for entry in forgotten:
                self._on_lost(entry.value, True)
        self._settle(now_ns)

    def add_camera(self, stamp_ns, now_ns, camera):
        """Add the camera of an image; `stamp_ns` None where it carries no stamp: it then replaces all others."""
        if stamp_ns is None:
            self._cameras.clear()
            self._plain_camera = camera
        else:
            self._cameras.add(stamp_ns, now_ns, camera)
            self._plain_camera = None
        self._settle(now_ns)

    def add_boxes(self, stamp_ns, now_ns, boxes):
        """Add the boxes of one image; `stamp_ns` None where they carry no stamp."""
        if stamp_ns is None:
            depth = self._depths.arrived_at(now_ns - self.assumed_delay_ns, self._length_ns)
            stamp_ns = None if depth is None else depth.stamp_ns
        newest_ns = self._depths.newest_ns
        if stamp_ns is None:
            self._settle(now_ns)
            self._on_lost(boxes, False)
        elif newest_ns is not None and newest_ns + self._length_ns < stamp_ns <= self._end_before_ns:
            self._on_lost(boxes, True)  # they were still on their way when time went back
            self._settle(now_ns)
        else:
            self._waiting.append(Stamped(stamp_ns, now_ns, boxes))
            self._settle(now_ns)

    def end(self):
        """Nothing more will come: all boxes that still wait are lost."""
        waiting, self._waiting = self._waiting, []
        for entry in waiting:
            self._on_lost(entry.value, False)

    def _settle(self, now_ns):
        """Hand on the boxes whose frame is complete, and those whose frame will not come."""
        complete_or_lost, waiting = [], []
        for number, entry in enumerate(self._waiting):
            frame = self._frame(entry.stamp_ns)
            crowded = len(self._waiting) - number > MAX_WAITING
            if frame is not None or crowded or self._is_hopeless(entry, now_ns):
                complete_or_lost.append((entry.value, frame))
            else:
                waiting.append(entry)
        self._waiting = waiting
        for boxes, frame in complete_or_lost:
            if frame is None:
                self._on_lost(boxes, False)
            else:
                depth, camera = frame
                self._on_frame(boxes, depth, camera)

    def _frame(self, stamp_ns):
        """Depth and camera of a stamp, None while one of them is missing."""
        depth = self._depths.nearest(stamp_ns, self._tolerance_ns)
        if depth is None:
            return None
        if self._plain_camera is not None:
            return depth.value, self._plain_camera
        camera = self._cameras.nearest(depth.stamp_ns, self._tolerance_ns)
        if camera is None and max(self._depths.newest_ns, self._cameras.newest_ns or 0) > depth.stamp_ns:
            camera = self._cameras.nearest(depth.stamp_ns, float('inf'))
        return None if camera is None else (depth.value, camera.value)

    def _is_hopeless(self, entry, now_ns):
        """Whether boxes have waited too long, or their image was lost or arrived too long ago."""
        newest_ns = self._depths.newest_ns
        is_past = newest_ns is not None and entry.stamp_ns < newest_ns
        is_lost = is_past and self._depths.nearest(entry.stamp_ns, self._tolerance_ns) is None
        return is_lost or now_ns - entry.arrival_ns > self._length_ns
