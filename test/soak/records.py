"""Record of a soak. All times are seconds of the same clock of the machine, stamps are integer nanoseconds."""
from typing import Any, Dict, List, NamedTuple, Optional, Set, Tuple

INTERRUPTED = 'interrupted'  # name of a fault while it lasts, and after Ctrl-C


class Status(NamedTuple):
    """Counters of a node on /diagnostics, and the memory of its process at that time."""

    at_s: float
    node: str
    pid: int
    counts: Dict[str, int]
    rss_mb: float


class Track(NamedTuple):
    """ID of a track in a message, and when it was first and last seen."""

    id: int
    first_ns: int
    last_ns: int


class Fault(NamedTuple):
    """A fault, the time at which its cause ended, and that of the first answer to a later image (None: never)."""

    name: str
    began_s: float
    ended_s: float
    recovered_s: Optional[float]
    disorders: bool  # whether stamps may decrease meanwhile

    def overlaps(self, from_s, to_s, margin_s=0.0):
        """Whether a part of an interval lies between the start and the recovery, plus a margin."""
        return self.began_s <= to_s and (self.recovered_s is None or from_s <= self.recovered_s + margin_s)


class Record(NamedTuple):
    """Everything that is measured in a soak."""

    began_s: float
    ended_s: float
    images: List[Tuple[int, float]]      # stamp and time of each valid image, in the order of sending
    wrong_ns: Set[int]                   # stamps of invalid messages
    sent: Dict[str, int]                 # number of valid and invalid messages by topic, to existing subscribers
    arrivals: Dict[str, Any]             # time and stamp of each message by topic
    empty: Dict[str, int]                # number of messages without people by topic
    tracks: List[Any]                    # time, stamp and list of Track of each message
    statuses: List[Status]
    faults: List[Fault]
    deaths: List[Tuple[float, int, str]]  # time, process ID and description
    killed: Set[int]                     # process IDs
    errors: List[Tuple[float, str]]      # uncaught exceptions in the log

    @property
    def finished_faults(self):
        """Faults whose recovery was awaited. An interrupted one only excuses violations while it lasts."""
        return [fault for fault in self.faults if fault.name != INTERRUPTED]
