"""Time synchronization of messages by stamp, and of cameras by their clocks. Stamps are integer nanoseconds."""
import collections
import math
import time
from typing import Any, Callable, Deque, Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple

NS = 1000000000  # nanoseconds in a second
MAX_WAITING = 100  # maximum number of waiting box arrays; more than any camera sends in a second
WITHOUT_CAMERA = 2  # images in succession without a camera_info, after which none is expected; chosen
MAX_RATE_HZ = 300  # faster than any camera; if stamps are closer, the clock hangs and not all images are kept
SAME_NS = NS // 200  # the stamps of one image differ by less
JITTER = 0.05  # variation of the period of images, relative to the period
JUMP_NS = NS  # a larger deviation from the expected stamp is a jump in time
ALIVE_NS = NS  # a camera without images for longer is ignored
RECENT = 10  # colour images whose median period counts; chosen
LONGEST_LAG_NS = 4 * NS  # a camera that lags by less than this may have the correct time and a slow detector
NEVER = float('inf')


def arrival_clock_ns() -> int:
    """Monotonic clock of the machine, for arrival times. It is independent of /clock, and never used as a stamp."""
    return int(time.monotonic() * NS)


def median_period_ns(stamps_ns: Sequence[int]) -> int:
    """Median period of a stream that has `stamps_ns`, in order; 0 for less than two stamps."""
    periods_ns = sorted(later - earlier for earlier, later in zip(stamps_ns, stamps_ns[1:]))
    return periods_ns[len(periods_ns) // 2] if periods_ns else 0


def half_period_of(stamps_ns: Sequence[int]) -> int:
    """Tolerance for the stamps of a stream that is not synchronized with one that has `stamps_ns`, in order.

    It is half of the median period and a margin for its variation; at least `SAME_NS`, for stamps that should be equal.
    """
    return max(SAME_NS, int(median_period_ns(stamps_ns) * (0.5 + JITTER)))


class Stamped(NamedTuple):
    """A value with its stamp and its arrival time on the caller's clock; both integer nanoseconds."""

    stamp_ns: int
    arrival_ns: int
    value: Any


class MessageCache(object):
    """Cache of the latest values of one topic, up to `length_ns` before the newest stamp, `newest_ns`, if any.

    The number of values is bounded for any stamps, so that a driver whose clock hangs or a frozen /clock does not
    exhaust the memory. The bound is a count, because arrival times are not meaningful when a bag is played slowly.
    """

    def __init__(self, length_ns: int) -> None:
        self._length_ns = length_ns
        self._entries: Deque[Stamped] = collections.deque(maxlen=length_ns * MAX_RATE_HZ // NS + 1)
        self.newest_ns: Optional[int] = None

    def __len__(self) -> int:
        return len(self._entries)

    def __reversed__(self) -> Iterator[Stamped]:
        return reversed(self._entries)

    def add(self, stamp_ns: int, arrival_ns: int, value: Any) -> bool:
        """Add a value, or replace that of the same stamp. Returns whether time jumped back.

        A stamp that goes back by less than `length_ns` is that of a late message. By more, it means that time jumped
        back (a bag was looped or rewound); the previous values are then deleted.
        """
        went_back = self.newest_ns is not None and stamp_ns < self.newest_ns - self._length_ns
        if went_back:
            self.clear()
        later = []
        while self._entries and self._entries[-1].stamp_ns >= stamp_ns:
            later.append(self._entries.pop())
        if later and later[-1].stamp_ns == stamp_ns:
            later.pop()
        self._entries.append(Stamped(stamp_ns, arrival_ns, value))
        self._entries.extend(reversed(later))
        self.newest_ns = self._entries[-1].stamp_ns
        while self._entries[0].stamp_ns < self.newest_ns - self._length_ns:
            self._entries.popleft()
        return went_back

    def matching(self, stamp_ns: int, tolerance_ns: int = 0) -> Optional[Stamped]:
        """The entry with this stamp, otherwise the nearest within the tolerance, or None. The tolerance 0 stands for
        `half_period_ns`."""
        return self.nearest(stamp_ns) or self.nearest(stamp_ns, tolerance_ns or self.half_period_ns)

    @property
    def period_ns(self) -> int:
        return median_period_ns([entry.stamp_ns for entry in list(self._entries)])

    @property
    def half_period_ns(self) -> int:
        return half_period_of([entry.stamp_ns for entry in list(self._entries)])

    def nearest(self, stamp_ns: int, tolerance_ns: float = 0) -> Optional[Stamped]:
        """The entry with the nearest stamp within the tolerance, or None."""
        nearest, nearest_ns = None, tolerance_ns
        for entry in list(self._entries):  # a copy, as another thread may add entries
            distance_ns = abs(entry.stamp_ns - stamp_ns)
            if distance_ns < nearest_ns or (nearest is None and distance_ns <= nearest_ns):
                nearest, nearest_ns = entry, distance_ns
        return nearest

    def arrived_at(self, arrival_ns: int, tolerance_ns: int) -> Optional[Stamped]:
        """The entry with the nearest arrival time within the tolerance, or None."""
        in_time = [entry for entry in list(self._entries) if abs(entry.arrival_ns - arrival_ns) <= tolerance_ns]
        return min(in_time, key=lambda entry: abs(entry.arrival_ns - arrival_ns), default=None)

    def clear(self) -> None:
        self._entries.clear()
        self.newest_ns = None


class StampSynchronizer(object):
    """Synchronizes the boxes of a colour image with the depth image and the camera_info of the same stamp.

    Boxes usually arrive after their depth image, by the latency of the detector. Boxes that arrive first wait for the
    depth image and the camera_info. If that camera_info is lost, the one nearest in time is used as soon as a newer
    message shows the loss; at once if the last images had none, as of a driver that sends one at its start. Boxes
    without a stamp are matched by arrival time, to the depth image that arrived nearest to `assumed_delay_ns`, an
    attribute, before them. A camera_info without a stamp is used for all images, because intrinsics do not change with
    time.

    Images are kept, and boxes wait, for `length_ns`. The stamps of one frame differ by at most `tolerance_ns`, see
    `MessageCache.matching`. All boxes are passed to exactly one of two callbacks, in the order of arrival, by the
    methods `add_` and `end`: `on_frame` with boxes and depth, both Stamped, and camera of one frame, or `on_lost` with
    unmatched boxes, their stamp, None without one, and whether they are lost because time jumped.
    """

    def __init__(self, length_ns: int, tolerance_ns: int, assumed_delay_ns: int,
                 on_frame: Callable[[Stamped, Stamped, Any], Any],
                 on_lost: Callable[[Any, Optional[int], bool], Any]) -> None:
        self._length_ns, self._tolerance_ns, self.assumed_delay_ns = length_ns, tolerance_ns, assumed_delay_ns
        self._on_frame, self._on_lost = on_frame, on_lost
        self._depths, self._cameras = MessageCache(length_ns), MessageCache(length_ns)
        self._plain_camera = None  # camera_info without a stamp; None if the newest one has a stamp
        self._waiting: List[Stamped] = []
        self._boxes_ns: Deque[int] = collections.deque(maxlen=RECENT)
        self._end_before_ns = 0  # the last stamp before time jumped back
        self._ahead_ns = 0, 0  # the last stamp before time jumped ahead, and the first one after it
        self._newest_boxes_ns, self._boxes_went_back = 0, False  # whether depth images of the new time are awaited

    @property
    def newest_ns(self) -> Optional[int]:
        """Stamp of the newest depth image, None before the first."""
        return self._depths.newest_ns

    def gap_text(self, stamp_ns: int) -> str:
        """Sentence about the stamp of the nearest depth image, and how to pair it; '' if there is no depth image."""
        depth = self._depths.nearest(stamp_ns, float('inf'))
        if depth is None:
            return ''
        gap_ns = abs(depth.stamp_ns - stamp_ns)
        gap_s = gap_ns / NS
        if gap_ns > self._length_ns:
            return ('colour and depth are %.3f s apart at best: depth images are missing, or have stamps of another '
                    'clock' % gap_s)
        return ('colour and depth are %.3f s apart at best; to pair them, set ~stamp_tolerance: %.2f'
                % (gap_s, math.ceil(100 * gap_s) / 100))

    @property
    def has_camera(self) -> bool:
        return len(self._cameras) > 0 or self._plain_camera is not None

    def add_depth(self, stamp_ns: int, now_ns: int, depth: Any) -> None:
        """Add a depth image; if its stamp goes back, all data from before the time jump is deleted."""
        newest_ns, newest = self._depths.newest_ns, next(reversed(self._depths), None)
        if newest is not None and stamp_ns - newest.stamp_ns > now_ns - newest.arrival_ns + JUMP_NS:
            self._ahead_ns = newest.stamp_ns, stamp_ns
        if self._depths.add(stamp_ns, now_ns, depth):
            if len(self._cameras) > 1 and (self._cameras.newest_ns or 0) > stamp_ns + self._length_ns:
                self._cameras.clear()  # each image has one of its own
            self._end_before_ns = newest_ns or 0
            self._end_before_jump(stamp_ns)
        self._match_waiting(now_ns)

    def add_camera(self, stamp_ns: Optional[int], now_ns: int, camera: Any) -> None:
        """Add a camera_info; if `stamp_ns` is None, it has no stamp and replaces all others."""
        if stamp_ns is None:
            self._cameras.clear()
            self._plain_camera = camera
        else:
            self._cameras.add(stamp_ns, now_ns, camera)
            self._plain_camera = None
        self._match_waiting(now_ns)

    def add_boxes(self, stamp_ns: Optional[int], now_ns: int, boxes: Any) -> None:
        """Add the boxes of one image; `stamp_ns` is None if they have no stamp."""
        if stamp_ns is None:
            depth = self._depths.arrived_at(now_ns - self.assumed_delay_ns, self._length_ns)
            stamp_ns = None if depth is None else depth.stamp_ns
        newest_ns = self._depths.newest_ns
        if stamp_ns is None:
            self._match_waiting(now_ns)
            self._on_lost(boxes, None, False)
        elif newest_ns is not None and newest_ns + self._length_ns < stamp_ns <= self._end_before_ns:
            self._on_lost(boxes, stamp_ns, True)  # boxes from before the time jump
            self._match_waiting(now_ns)
        else:
            self._boxes_went_back = self._boxes_went_back or stamp_ns < self._newest_boxes_ns - self._length_ns
            self._newest_boxes_ns = stamp_ns
            self._boxes_ns.append(stamp_ns)
            self._waiting.append(Stamped(stamp_ns, now_ns, boxes))
            self._match_waiting(now_ns)

    def end(self) -> None:
        self._match_waiting(NEVER)

    def _end_before_jump(self, start_ns: int) -> None:
        """Give up the boxes from before a time jump to `start_ns`. Those of the new time may have arrived first."""
        waiting, self._waiting = self._waiting, []
        for entry in waiting:
            if self._boxes_went_back and entry.stamp_ns <= start_ns + self._length_ns:
                self._waiting.append(entry)
            else:
                self._on_lost(entry.value, entry.stamp_ns, True)
        self._boxes_went_back = False

    def _match_waiting(self, now_ns: float) -> None:
        """Call the callbacks for boxes whose frame is complete, is lost, or did not arrive in time."""
        if not self._waiting:
            return
        settled, waiting = [], []
        for number, entry in enumerate(self._waiting):
            depth = self._depths.matching(entry.stamp_ns, self._tolerance_ns)
            is_late = now_ns - entry.arrival_ns > self._length_ns
            if depth is not None and not is_late and self._is_next_nearer(depth.stamp_ns, entry.stamp_ns):
                depth = None
            camera = None if depth is None else self._camera_at(entry.stamp_ns)
            is_lost = depth is None and self._is_past(entry.stamp_ns)
            is_crowded = len(self._waiting) - number > MAX_WAITING
            if camera is not None or is_lost or is_late or is_crowded:
                settled.append((entry, depth, camera))
            else:
                waiting.append(entry)
        self._waiting = waiting
        for entry, depth, camera in settled:
            if depth is None or camera is None:
                self._on_lost(entry.value, entry.stamp_ns, self._is_from_before_jump_ahead(entry.stamp_ns))
            else:
                self._on_frame(entry, depth, camera)

    def _is_from_before_jump_ahead(self, stamp_ns: int) -> bool:
        """Whether the depth image of boxes has been deleted because time has just jumped ahead."""
        before_ns, after_ns = self._ahead_ns
        return stamp_ns <= before_ns and (self._depths.newest_ns or 0) <= after_ns + self._length_ns

    def _is_next_nearer(self, depth_ns: int, stamp_ns: int) -> bool:
        """Whether the depth image after the one with the stamp `depth_ns` should be nearer, and has not arrived.

        It should if half of the period of depth images has passed. If half of the period of boxes has passed, the boxes
        before were nearer, also where depth images are lost or all rates have just changed.
        """
        after_ns = stamp_ns - depth_ns
        # The first comparison saves the medians of the periods where stamps are equal, as of most cameras.
        if after_ns <= 0 or depth_ns != self._depths.newest_ns:
            return False
        boxes_ns = list(self._boxes_ns)
        periods_ns = self._depths.period_ns, median_period_ns(boxes_ns), median_period_ns(boxes_ns[-2:])
        return 2 * after_ns > min([period for period in periods_ns if period > 0], default=NEVER)

    def _is_past(self, stamp_ns: int) -> bool:
        """Whether no depth image can arrive any more for boxes with this stamp."""
        newest_ns = self._depths.newest_ns
        if newest_ns is None or stamp_ns >= newest_ns:
            return False
        if self._boxes_went_back and stamp_ns < newest_ns - self._length_ns:
            return False
        return self._tolerance_ns > 0 or len(self._depths) > 1  # else the tolerance is unknown

    def _camera_at(self, stamp_ns: int) -> Any:
        """The camera of the boxes, or the nearest one as soon as no own one is expected any more."""
        if self._plain_camera is not None:
            return self._plain_camera
        camera = self._cameras.matching(stamp_ns, self._tolerance_ns)
        if camera is None and self._cameras.newest_ns is not None:
            newest_ns = self._cameras.newest_ns
            without = sum(newest_ns < depth.stamp_ns < stamp_ns for depth in reversed(self._depths))
            if without >= WITHOUT_CAMERA or max(self._depths.newest_ns or 0, newest_ns) > stamp_ns:
                camera = self._cameras.nearest(stamp_ns, float('inf'))
        return None if camera is None else camera.value


class _Clock(NamedTuple):
    """The latest image of a camera, and the arrival time since which its stamps are accepted without a jump."""

    stamp_ns: int
    arrival_ns: int
    since_ns: float = NEVER

    def is_near(self, other: '_Clock', limit_ns: int) -> bool:
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

    def __init__(self) -> None:
        self._clocks: Dict[str, _Clock] = {}  # of the latest image, by camera
        self._tracked: Dict[str, _Clock] = {}  # of the latest tracked image
        self._newest_ns: Dict[str, int] = {}  # newest stamp of the tracked images

    @property
    def newest_ns(self) -> Optional[int]:
        """The newest stamp of a tracked image; None if there is none since the last `restart`."""
        return max(self._newest_ns.values(), default=None)

    def accept(self, stamp_ns: int, now_ns: int, camera_name: str) -> Optional[str]:
        """Check the stamp of an image that arrived at `now_ns`, see `arrival_clock_ns`.

        Returns None if the image is accepted; otherwise the camera with the correct time. Raises ValueError if the
        latest tracked image of the camera has this stamp.
        """
        if camera_name in self._tracked and stamp_ns == self._tracked[camera_name].stamp_ns:
            raise ValueError('duplicate stamp %.9f of camera %r' % (stamp_ns / NS, camera_name))
        alive = {name: clock for name, clock in self._clocks.items() if now_ns - clock.arrival_ns <= ALIVE_NS}
        clock = alive[camera_name] = self._continued(_Clock(stamp_ns, now_ns), camera_name, alive)

        def rank(name: str) -> Tuple[int, float, int]:
            own = alive[name]
            supporters = sum(own.is_near(other, LONGEST_LAG_NS) for other in alive.values())
            return supporters, -own.since_ns, own.stamp_ns - own.arrival_ns
        trusted, is_accepted = camera_name, True
        if len(alive) > 1:
            trusted = max([name for name in alive if name == camera_name or self._is_tracked(name, now_ns)], key=rank)
            is_accepted = clock.is_near(alive[trusted], JUMP_NS)
        self._clocks[camera_name] = clock._replace(since_ns=min(clock.since_ns, now_ns) if is_accepted else NEVER)
        return None if is_accepted else trusted

    def _continued(self, clock: _Clock, camera_name: str, alive: Dict[str, _Clock]) -> _Clock:
        """The clock with `since_ns` from the camera's previous image, or from the other cameras with the same time."""
        former = self._clocks.get(camera_name)
        if former is not None and former.since_ns != NEVER:
            passed_ns, advance_ns = clock.arrival_ns - former.arrival_ns, clock.stamp_ns - former.stamp_ns
            if -JUMP_NS <= advance_ns <= passed_ns + JUMP_NS:  # the stamp jumps neither back nor ahead of the arrivals
                return clock._replace(since_ns=former.since_ns)
        limit_ns = LONGEST_LAG_NS if former is None else JUMP_NS
        return clock._replace(since_ns=min((other.since_ns for name, other in alive.items()
                                            if name != camera_name and clock.is_near(other, limit_ns)), default=NEVER))

    def track(self, stamp_ns: int, camera_name: str) -> int:
        """Record that the latest accepted image of a camera was tracked. Returns the newest stamp of tracked images."""
        self._tracked[camera_name] = self._clocks[camera_name]
        self._newest_ns[camera_name] = max(stamp_ns, self._newest_ns.get(camera_name, stamp_ns))
        return max(self._newest_ns.values())

    def is_jump_back(self, stamp_ns: int, now_ns: int, camera_name: str) -> bool:
        """Whether an accepted image is a backward jump in time, and not a camera that lags behind an ended one."""
        if stamp_ns >= max(self._newest_ns.values(), default=stamp_ns) - JUMP_NS:
            return False
        ahead = {other: newest_ns for other, newest_ns in self._newest_ns.items() if stamp_ns < newest_ns - JUMP_NS}
        return (camera_name in ahead or any(self._is_tracked(other, now_ns) for other in ahead)
                or stamp_ns < max(ahead.values(), default=stamp_ns) - LONGEST_LAG_NS)

    def restart(self) -> None:
        """Forget the newest stamps, after a backward jump in time."""
        self._newest_ns = {}

    def _is_tracked(self, camera_name: str, now_ns: int) -> bool:
        return camera_name in self._tracked and now_ns - self._tracked[camera_name].arrival_ns <= ALIVE_NS
