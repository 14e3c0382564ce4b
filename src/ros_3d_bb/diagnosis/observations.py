"""Data types of the observations of a running graph or a bag. Stamps are integer nanoseconds, times are seconds."""
from typing import Any, Dict, NamedTuple, Optional, Tuple


class Role(NamedTuple):
    """A topic of the pipeline.

    `title`: content of the topic; `name`: its name in the nodes; `kind`: its type; `argument`: the launch argument that
    renames it, or empty; `source`: its publisher; `when_silent`: what to do if the publisher is silent.
    """

    title: str
    name: str
    kind: str
    argument: str
    source: str
    when_silent: str


class Publisher(NamedTuple):
    """A node that publishes a topic; `problem` states why it cannot be received here, empty if it can."""

    node: str
    problem: str = ''


class Stream(NamedTuple):
    """Observations on the topic of a role.

    `topic`: its resolved name; `published_kind`: its published type, empty without publishers; `stamps_ns`: stamps
    of the messages that have one; `lag_s`: ROS time minus stamp at the arrival of the newest message, None if unknown;
    `machine_lag_s`: the same by the clock of the machine.
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
    """A camera_info: `camera` is a `camera_model.Camera`, or None if it cannot be used; `fault` states why."""

    camera: Any
    frame_id: str
    fault: str = ''


class ImageSeen(NamedTuple):
    """The newest image of a topic; `fault` states why it cannot be used, empty if it can."""

    width: int
    height: int
    encoding: str
    frame_id: str
    fault: str = ''


class TfSeen(NamedTuple):
    """Result of a tf lookup at a stamp: all links, {frame: `tf_tree.Link`}, and why the transform is missing, if so."""

    target: str
    source: str
    stamp_s: float
    links: dict
    fault: str


class Observations(NamedTuple):
    """All observations; fields are None if nothing was received.

    `topics`: {name: type} of all published topics; `nodes`: {name: (level, sentence)} from the diagnostics of nodes;
    `seconds`: duration of the observation; `clock_count`: number of /clock messages.
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
    use_sim_time: bool = False
    clock_count: int = 0
    nodes: dict = {}
    stamp_tolerance_s: float = 0.005
    cache_length_s: float = 1.0


class Finding(NamedTuple):
    """Result of a check: its subject, and either a fact or a fault with its fix."""

    subject: str
    fact: str = ''
    fault: str = ''
    fix: str = ''

    @property
    def lines(self):
        """The finding as printed lines."""
        if self.fault:
            return ['wrong  %s: %s' % (self.subject, self.fault), '       fix: %s' % self.fix]
        return ['ok     %s: %s' % (self.subject, self.fact)]
