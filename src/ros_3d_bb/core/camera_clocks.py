"""Detection of cameras whose clocks differ, and selection of the cameras with the correct time."""
from typing import NamedTuple

from ros_3d_bb.core.time_sync import JUMP_NS, NS

ALIVE_NS = NS  # a camera without images for longer is ignored
LONGEST_LAG_NS = 4 * NS  # a camera that lags by less than this may have the correct time and a slow detector
NEVER = float('inf')


class _Clock(NamedTuple):
    """The latest image of a camera, and the arrival time since which its stamps are accepted without a jump."""

    stamp_ns: int
    arrival_ns: int
    since_ns: float = NEVER

    def is_near(self, other, limit_ns):
        """Whether the stamps of two cameras, relative to their arrival times, differ by at most `limit_ns`."""
        return abs(self.stamp_ns - self.arrival_ns - other.stamp_ns + other.arrival_ns) <= limit_ns


class CameraClocks(object):
    """Decides between cameras whose stamps differ by more than `JUMP_NS`.

    Only a camera whose images are tracked can exclude others. Conflicts are resolved by these rules, in this order:

    - if the difference is longer than `LONGEST_LAG_NS`, the majority of the cameras is correct;
    - otherwise the camera that has been accepted without a jump for the longest time is correct. A new camera is as old
      as the cameras that it may lag behind, or that may lag behind it;
    - of equally old cameras, the one whose stamps are ahead is correct, because images arrive late, never early.
    """

    def __init__(self):
        self._clocks, self._tracked = {}, {}  # by camera: clock of the latest image, and of the latest tracked image
        self._newest_ns = {}  # newest stamp of the tracked images, by camera

    @property
    def newest_ns(self):
        """The newest stamp of a tracked image; None if there is none since the last `restart`."""
        return max(self._newest_ns.values(), default=None)

    def accept(self, stamp_ns, now_ns, camera):
        """Check the stamp of an image that arrived at `now_ns`, see `time_sync.arrival_clock_ns`.

        Returns None if the image is accepted; otherwise the camera with the correct time. Raises ValueError if the
        latest tracked image of the camera has this stamp.
        """
        if camera in self._tracked and stamp_ns == self._tracked[camera].stamp_ns:
            raise ValueError('duplicate stamp %.9f of camera %r' % (stamp_ns / NS, camera))
        alive = {name: clock for name, clock in self._clocks.items() if now_ns - clock.arrival_ns <= ALIVE_NS}
        clock = alive[camera] = self._continued(_Clock(stamp_ns, now_ns), camera, alive)

        def rank(name):
            own = alive[name]
            supporters = sum(own.is_near(other, LONGEST_LAG_NS) for other in alive.values())
            return supporters, -own.since_ns, own.stamp_ns - own.arrival_ns
        trusted, is_accepted = camera, True
        if len(alive) > 1:
            trusted = max([name for name in alive if name == camera or self._is_tracked(name, now_ns)], key=rank)
            is_accepted = clock.is_near(alive[trusted], JUMP_NS)
        self._clocks[camera] = clock._replace(since_ns=min(clock.since_ns, now_ns) if is_accepted else NEVER)
        return None if is_accepted else trusted

    def _continued(self, clock, camera, alive):
        """The clock with `since_ns` from the camera's previous image, or from the other cameras with the same time."""
        former = self._clocks.get(camera)
        if former is not None and former.since_ns != NEVER:
            passed_ns, advance_ns = clock.arrival_ns - former.arrival_ns, clock.stamp_ns - former.stamp_ns
            if -JUMP_NS <= advance_ns <= passed_ns + JUMP_NS:  # the stamp jumps neither back nor ahead of the arrivals
                return clock._replace(since_ns=former.since_ns)
        limit_ns = LONGEST_LAG_NS if former is None else JUMP_NS
        return clock._replace(since_ns=min((other.since_ns for name, other in alive.items()
                                            if name != camera and clock.is_near(other, limit_ns)), default=NEVER))

    def track(self, stamp_ns, camera):
        """Record that the latest accepted image of a camera was tracked. Returns the newest stamp of tracked images."""
        self._tracked[camera] = self._clocks[camera]
        self._newest_ns[camera] = max(stamp_ns, self._newest_ns.get(camera, stamp_ns))
        return self.newest_ns

    def is_jump_back(self, stamp_ns, now_ns, camera):
        """Whether an accepted image is a backward jump in time, and not a camera that lags behind an ended one."""
        if stamp_ns >= max(self._newest_ns.values(), default=stamp_ns) - JUMP_NS:
            return False
        ahead = {other: newest_ns for other, newest_ns in self._newest_ns.items() if stamp_ns < newest_ns - JUMP_NS}
        return (camera in ahead or any(self._is_tracked(other, now_ns) for other in ahead)
                or stamp_ns < max(ahead.values(), default=stamp_ns) - LONGEST_LAG_NS)

    def restart(self):
        """Forget the newest stamps, after a backward jump in time."""
        self._newest_ns = {}

    def _is_tracked(self, camera, now_ns):
        """Whether an image of a camera was tracked within the last `ALIVE_NS`."""
        return camera in self._tracked and now_ns - self._tracked[camera].arrival_ns <= ALIVE_NS
