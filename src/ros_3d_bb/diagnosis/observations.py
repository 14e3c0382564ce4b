"""What was observed of a running graph, or of a bag. Stamps are integer nanoseconds, clocks seconds."""
from typing import Any, Dict, NamedTuple, Optional, Tuple


class Role(NamedTuple):
    """A topic of the pipeline.

    `title`: what comes on it; `name`: what the nodes call it; `kind`: its type; `argument`: the launch argument that
    renames it, empty where there is none; `source`: what publishes it; `when_silent`: what to do where that is silent.
    """

    title: str
    name: str
    kind: str
    argument: str
    source: str
    when_silent: str


class Publisher(NamedTuple):
    """A node that publishes a topic; `problem` says why nothing of it can come here, empty where it can."""

    node: str
    problem: str = ''


class Stream(NamedTuple):
    """What was seen on the topic of a role.

    `topic`: its full name here; `published_kind`: the type it is published with, empty where nobody does; `stamps_ns`:
    of the messages that carry one; `lag_s`: ROS time minus the stamp when the newest came, None where there is none;
    `machine_lag_s`: the same by the machine's clock.
    """

    role: Role
    topic: str
    published_kind: str = ''
    publishers: Tuple[Publisher, ...] = ()
    count: int = 0
    rate_hz: float = 0.0
    stamps_ns: Tuple[int, ...] = ()
    lag_s: Optional[float] = None
    machine_lag_s: Optional[float] = None


class CameraSeen(NamedTuple):
    """A camera_info: `camera` (`geometry.Camera`), or None and why it cannot be used."""

    camera: Any
    frame_id: str
    fault: str = ''


class ImageSeen(NamedTuple):
    """The newest image of a topic; `fault`: why it cannot be used, or empty."""

    width: int
    height: int
    encoding: str
    frame_id: str
    fault: str = ''


class TfSeen(NamedTuple):
    """`links`: {frame: `tf_tree.Link`}; `fault`: why there is no transform at a stamp, empty where there is one."""

    target: str
    source: str
    stamp_s: float
    links: dict
    fault: str


class Clock(NamedTuple):
    """Whether the graph is told the time, and how often that came."""

    use_sim_time: bool
    count: int


class Observations(NamedTuple):
    """All that was observed; None where nothing was. `clock` is None of a bag.

    `topics`: {name: type} of all that is published; `nodes`: {name: (level, sentence)} of what nodes say of themselves;
    `seconds`: for how long it was listened.
    """

    streams: Dict[str, Stream]
    topics: Dict[str, str]
    seconds: float
    is_bag: bool = False
    color_camera: Optional[CameraSeen] = None
    depth_camera: Optional[CameraSeen] = None
    color: Optional[ImageSeen] = None
    depth: Optional[ImageSeen] = None
    tf: Optional[TfSeen] = None
    clock: Optional[Clock] = None
    nodes: dict = {}
    stamp_tolerance_s: float = 0.005
    cache_length_s: float = 1.0


class Finding(NamedTuple):
    """What a check says: about what, and what is wrong (empty: nothing) with its fix, or what is well."""

    subject: str
    fact: str = ''
    fault: str = ''
    fix: str = ''

    @property
    def is_wrong(self):
        """Whether something is wrong."""
        return bool(self.fault)

    @property
    def lines(self):
        """As it is printed."""
        if self.is_wrong:
            return ['wrong  %s: %s' % (self.subject, self.fault), '       fix: %s' % self.fix]
        return ['ok     %s: %s' % (self.subject, self.fact)]
