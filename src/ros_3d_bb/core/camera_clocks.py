"""Whether the stamps of several cameras are of one time, and which cameras are right where they are not."""
from typing import NamedTuple

from ros_3d_bb.core.time_sync import JUMP_NS, NS

ALIVE_NS = NS  # a camera without images for longer has no say
LONGEST_LAG_NS = 4 * NS  # a camera whose stamps are behind by less may have the right time and a slow detector
NEVER = float('inf')


class _Clock(NamedTuple):
    """The latest image of a camera, and the time of arrival since which its stamps are accepted and have not leapt."""

    stamp_ns: int
    arrival_ns: int
    since_ns: float = NEVER

    def is_near(self, other, limit_ns):
        """Whether the stamps of two cameras differ by no more than a limit, apart from what their arrival explains."""
        return abs(self.stamp_ns - self.arrival_ns - other.stamp_ns + other.arrival_ns) <= limit_ns

    def leaps_to(self, later):
        """Whether the stamp of the next image goes back, or forward by more than the time that has passed."""
        return not -JUMP_NS <= later.stamp_ns - self.stamp_ns <= later.arrival_ns - self.arrival_ns + JUMP_NS


class CameraClocks(object):
    """Decides between cameras whose stamps differ by more than `JUMP_NS`.

    Only a camera whose images are tracked can keep others out. Of those that differ,

    - the majority is right, where the difference is longer than a lag;
    - else the camera that has been accepted without a leap for longest. A new camera is as old as those that it may lag
      behind, or that may lag behind it;
    - of equally old ones the camera whose stamps are ahead, as images come late, and never early.
    """

    def __init__(self):
        self._clocks, self._tracked = {}, {}  # by camera: of its latest image, and of the latest that was tracked

    def accept(self, stamp_ns, now_ns, camera):
        """Take the stamp of an image, which arrived at `now_ns`.

        Returns
        -------
        str or None
            None where it is accepted; else the camera that is right.

        Raises
        ------
        ValueError
            If the latest tracked image of the camera has this stamp.
        """
        if camera in self._tracked and stamp_ns == self._tracked[camera].stamp_ns:
            raise ValueError('stamp %.9f of camera %r comes a second time' % (stamp_ns / NS, camera))
        alive = {name: clock for name, clock in self._clocks.items() if now_ns - clock.arrival_ns <= ALIVE_NS}
        clock = alive[camera] = self._continued(_Clock(stamp_ns, now_ns), camera, alive)

        def rank(name):
            own = alive[name]
            supporters = sum(own.is_near(other, LONGEST_LAG_NS) for other in alive.values())
            return supporters, -own.since_ns, own.stamp_ns - own.arrival_ns
        right = max([name for name in alive if name == camera or self.is_tracked(name, now_ns)], key=rank)
        is_accepted = clock.is_near(alive[right], JUMP_NS)
        self._clocks[camera] = clock._replace(since_ns=min(clock.since_ns, now_ns) if is_accepted else NEVER)
        return None if is_accepted else right

    def _continued(self, clock, camera, alive):
        """The clock of a camera with the time since which it is right, as far as its former images and others tell."""
        former = self._clocks.get(camera)
        if former is not None and former.since_ns != NEVER and not former.leaps_to(clock):
            return clock._replace(since_ns=former.since_ns)
        limit_ns = LONGEST_LAG_NS if former is None else JUMP_NS
        return clock._replace(since_ns=min((other.since_ns for name, other in alive.items()
                                            if name != camera and clock.is_near(other, limit_ns)), default=NEVER))

    def track(self, camera):
        """The latest image of a camera was tracked."""
        self._tracked[camera] = self._clocks[camera]

    def is_tracked(self, camera, now_ns):
        """Whether an image of a camera was tracked lately."""
        return camera in self._tracked and now_ns - self._tracked[camera].arrival_ns <= ALIVE_NS
