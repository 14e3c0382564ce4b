"""What a soak wrote down. All times are seconds of one clock of the machine, stamps integer nanoseconds."""
from typing import Any, Dict, List, NamedTuple, Optional, Set, Tuple

INTERRUPTED = 'interrupted'  # in place of a fault's name: somebody ended the soak before it could recover


class Status(NamedTuple):
    """What a node said of itself on /diagnostics, and what its process used by then."""

    at_s: float
    node: str
    pid: int
    counts: Dict[str, int]
    cpu_s: float
    rss_mb: float


class Track(NamedTuple):
    """Of one track in one array: its number, and when the person was first and last seen."""

    id: int
    first_ns: int
    last_ns: int


class Death(NamedTuple):
    """A process that ended while the graph ran."""

    at_s: float
    node: str
    pid: int
    how: str


class FaultDone(NamedTuple):
    """A fault: when it began, when its cause ended, and when an image sent after that was answered, None: never.

    `disturbs`: stamps may go back meanwhile.
    """

    name: str
    began_s: float
    ended_s: float
    recovered_s: Optional[float]
    disturbs: bool

    def covers(self, at_s):
        """Whether a time lies between its beginning and the recovery."""
        return self.overlaps(at_s, at_s, 0.0)

    def overlaps(self, from_s, to_s, margin_s):
        """Whether a part of a time lies between its beginning and the recovery and so much more."""
        return self.began_s <= to_s and (self.recovered_s is None or from_s <= self.recovered_s + margin_s)


class Record(NamedTuple):
    """A soak.

    Attributes
    ----------
    images : [(stamp_ns, sent_s), ...]
        The good ones, in the order in which they were sent.
    wrong_ns : set of int
        Stamps of the wrong messages that were thrown in.
    sent : {topic: count}
        Messages, good and wrong, to whomever was there.
    arrivals : {topic: [(at_s, stamp_ns), ...]}
    tracks : [(at_s, stamp_ns, [Track, ...]), ...]
    killed : set of int
        Process numbers.
    errors : [(at_s, text), ...]
        Exceptions that nobody caught.
    """

    began_s: float
    ended_s: float
    images: List[Tuple[int, float]]
    wrong_ns: Set[int]
    sent: Dict[str, int]
    arrivals: Dict[str, Any]
    tracks: List[Any]
    statuses: List[Status]
    faults: List[FaultDone]
    deaths: List[Death]
    killed: Set[int]
    errors: List[Tuple[float, str]]

    @property
    def finished_faults(self):
        """Those whose recovery was waited for. The interrupted one excuses what others do, and is judged no further."""
        return [fault for fault in self.faults if fault.name != INTERRUPTED]

    def is_quiet(self, at_s):
        """Whether no fault was there at a time."""
        return not any(fault.covers(at_s) for fault in self.faults)
