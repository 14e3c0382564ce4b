"""Jumps of time, as when a bag or a simulated scene starts again."""
import time
from typing import Dict, Optional, Tuple

from ros_3d_bb.core.time_sync import JUMP_NS, NS

SETTLING_S = 1.0  # chosen: longer than the pipeline takes from image to tracks


class TimeJumps(object):
    """Detects jumps of clocks: of ROS time and of the stamps of a topic, either of which may jump first.

    A clock jumps if it goes back by more than `JUMP_NS`, or ahead by so much more than the clock of the machine. For
    `SETTLING_S` after a jump, while `are_recent`, stamps and ROS time may disagree although each is right.
    """

    def __init__(self) -> None:
        self._latest: Dict[str, Tuple[int, float]] = {}  # (time of the clock, machine time in seconds), by clock
        self._jumped_s = float('-inf')

    def see(self, clock: str, time_ns: int, now_s: Optional[float] = None) -> None:
        """Record the time of a clock, given by a name, at a monotonic time, by default the current one."""
        now_s = time.monotonic() if now_s is None else now_s
        before_ns, before_s = self._latest.get(clock, (time_ns, now_s))
        self._latest[clock] = time_ns, now_s
        if not -JUMP_NS <= time_ns - before_ns <= (now_s - before_s) * NS + JUMP_NS:
            self._jumped_s = now_s

    def are_recent(self, now_s: Optional[float] = None) -> bool:
        """Whether a clock has jumped within the last `SETTLING_S`."""
        return (time.monotonic() if now_s is None else now_s) - self._jumped_s <= SETTLING_S
