"""Whether the stamps of several cameras are of one time."""
from typing import NamedTuple

from ros_3d_bb.stamped import NS

JUMP_NS = NS  # a stamp that differs by more from what is expected is a jump in time, by less a late message
ALIVE_NS = NS  # a camera from which nothing has arrived for longer does not count
MOST_RECENT = 100  # images of one camera within half a second of stamps; no camera is so fast


class _Arrival(NamedTuple):
    stamp_ns: int
    arrival_ns: int

    def is_ahead_of(self, other):
        """Whether the stamp is later than that of an image which came before lets expect."""
        return self.stamp_ns - other.stamp_ns > self.arrival_ns - other.arrival_ns + JUMP_NS


class CameraClocks(object):
    """Finds stamps that leap ahead of those of the other cameras.

    Where somebody seeks forward in a bag the stamps of all cameras leap; where only one camera's do, they are wrong. So
    a leap is refused until every other camera that still sends images has leapt as well. Of a single camera nothing is
    refused.
    """

    def __init__(self):
        self._received, self._accepted = {}, {}  # by camera: its latest _Arrival

    def accept(self, stamp_ns, now_ns, camera, is_trusted=False):
        """Take the stamp of an image, which arrived at `now_ns`.

        A trusted one is always accepted. What continues the accepted stamps of its own camera is no leap: where two
        clocks differ from the beginning, the camera that came first goes on.

        Returns
        -------
        str or None
            None where it is accepted; else the camera that it is too far ahead of.
        """
        arrival = self._received[camera] = _Arrival(stamp_ns, now_ns)
        own = self._accepted.get(camera)
        if not is_trusted and (own is None or arrival.is_ahead_of(own)):
            for other, theirs in sorted(self._received.items()):
                if other != camera and self.is_alive(other, now_ns) and arrival.is_ahead_of(theirs):
                    return other
        self._accepted[camera] = arrival
        return None

    def is_alive(self, camera, now_ns):
        """Whether an image of a camera has arrived lately."""
        return camera in self._received and now_ns - self._received[camera].arrival_ns <= ALIVE_NS

    def forget(self, camera):
        """Compare the next image of a camera only with those of the others."""
        self._accepted.pop(camera, None)


class RecentStamps(object):
    """The stamps of the latest images of each camera, at most `MOST_RECENT` within `span_ns`.

    The tracker keeps its latest images, to take late ones in, as far back as their stamps reach. Stamps that hardly
    advance would keep them all.
    """

    def __init__(self, span_ns):
        self._span_ns, self._stamps_ns = span_ns, {}

    def check(self, stamp_ns, camera):
        """Raise ValueError where there are too many images close to a stamp."""
        if len(self._near(stamp_ns, camera)) >= MOST_RECENT:
            raise ValueError('stamp %.9f is within %.1f s of those of %d images of camera %r; its stamps stand still'
                             % (stamp_ns / NS, self._span_ns / NS, MOST_RECENT, camera))

    def add(self, stamp_ns, camera):
        """Take the stamp of an image that was used."""
        self._stamps_ns[camera] = self._near(stamp_ns, camera) + [stamp_ns]

    def _near(self, stamp_ns, camera):
        return [other_ns for other_ns in self._stamps_ns.get(camera, ()) if abs(other_ns - stamp_ns) <= self._span_ns]
