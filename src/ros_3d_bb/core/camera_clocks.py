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

    def leaps_to(self, later):
        """Whether the stamp of the next image jumps back, or forward by more than the elapsed time."""
        return not -JUMP_NS <= later.stamp_ns - self.stamp_ns <= later.arrival_ns - self.arrival_ns + JUMP_NS


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

    def accept(self, stamp_ns, now_ns, camera):
        """Check the stamp of an image that arrived at `now_ns`.

        Parameters
        ----------
        stamp_ns : int
        now_ns : int
            Arrival time, see `time_sync.arrival_clock_ns`.
        camera : str

        Returns
        -------
        str or None
            None if the image is accepted; otherwise the camera with the correct time.

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
        """The clock with `since_ns` from the camera's previous image, or from the other cameras with the same time."""
        former = self._clocks.get(camera)
        if former is not None and former.since_ns != NEVER and not former.leaps_to(clock):
            return clock._replace(since_ns=former.since_ns)
        limit_ns = LONGEST_LAG_NS if former is None else JUMP_NS
        return clock._replace(since_ns=min((other.since_ns for name, other in alive.items()
                                            if name != camera and clock.is_near(other, limit_ns)), default=NEVER))

    def track(self, camera):
        """Record that the latest image of a camera was tracked."""
        self._tracked[camera] = self._clocks[camera]

    def is_tracked(self, camera, now_ns):
        """Whether an image of a camera was tracked within the last `ALIVE_NS`."""
        return camera in self._tracked and now_ns - self._tracked[camera].arrival_ns <= ALIVE_NS
