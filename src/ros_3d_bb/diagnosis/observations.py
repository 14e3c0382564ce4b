"""Data types of the observations of a running graph or a bag. Stamps are integer nanoseconds, times are seconds."""
from typing import Any, Dict, NamedTuple, Optional, Tuple


IMAGE, COMPRESSED_IMAGE = 'sensor_msgs/Image', 'sensor_msgs/CompressedImage'
KEPT = 1000  # stamps per topic


class Role(NamedTuple):
    title: str  # content of the topic
    name: str  # in the nodes, before remapping
    kind: str
    argument: str  # launch argument that renames the topic, or empty
    source: str  # its publisher
    when_silent: str  # what to do if the publisher is silent

    @property
    def kinds(self):
        """The types that the nodes accept: images may be compressed."""
        return (IMAGE, COMPRESSED_IMAGE) if self.kind == IMAGE else (self.kind,)


class Publisher(NamedTuple):
    node: str
    problem: str = ''  # why it cannot be received here
    fix: str = ''


class Stream(NamedTuple):
    """Observations on the topic of a role."""

    role: Role
    topic: str  # resolved name
    published_kind: str = ''  # empty without publishers
    publishers: Tuple[Publisher, ...] = ()
    count: int = 0
    rate_hz: float = 0.0
    stamps_ns: Tuple[int, ...] = ()  # of the messages that have one
    lag_s: Optional[float] = None  # ROS time minus stamp at the arrival of the newest message
    machine_lag_s: Optional[float] = None  # the same by the clock of the machine
    senders: Tuple[str, ...] = ()  # nodes that publish it at once; empty if there is one
    is_empty: bool = False  # whether no message contains a box or a track


class Newest(NamedTuple):
    """The newest message of a topic, and its conversion to a type of this package, or why it cannot be converted."""

    message: Any
    converted: Any
    fault: str = ''


class TfSeen(NamedTuple):
    """Result of a tf lookup at a stamp."""

    target: str
    source: str
    stamp_s: float
    links: dict  # of all frames, {frame: tf_tree.Link}
    fault: str  # why there is no transform; empty if there is one
    viewing_fault: str = ''  # why the frame cannot be that of the images
    root_from_camera: Any = None  # pose (4, 4) of the camera in the root of its tree; None if it is unknown
    moves: bool = False  # whether this pose changes
    lags_s: Dict[str, float] = {}  # arrival minus stamp of the transforms of frames that tf repeats, median
    in_time: Optional[float] = None  # share of the images at whose stamp tf has the pose, after waiting for it


class Observations(NamedTuple):
    """All observations; fields are None if nothing was received."""

    streams: Dict[str, Stream]
    topics: Dict[str, str]  # types of all published topics
    seconds: float  # duration
    is_bag: bool = False
    color_info: Optional[Newest] = None
    depth_info: Optional[Newest] = None
    color: Optional[Newest] = None
    depth: Optional[Newest] = None
    edges_fault: Optional[str] = None  # of `alignment.EdgeComparison`, for images of the same stamp
    edges_together: Optional[str] = None  # the same for images that arrive together with other stamps
    tf: Optional[TfSeen] = None
    use_sim_time: bool = False
    clock_count: int = 0  # number of /clock messages
    tf_senders: Dict[str, Tuple[str, ...]] = {}  # nodes that publish the same frame of tf at once, by frame
    nodes: dict = {}  # {name: (level, sentence)} from the diagnostics of nodes
    mount: Any = None  # camera_mount.CameraMount of a bag with aligned depth
    floor_frame: str = 'base_link'  # of bbox3d_node
    frame_id: str = ''  # of bbox3d_node, which replaces that of the images; empty: none
    depth_is_raw: bool = False  # not aligned to colour; the nodes register it
    raw_topics: Tuple[str, ...] = ()  # topics of a bag with depth images that are not aligned to colour
    depth_info_topic: str = ''  # of the camera_info of depth
    stamp_tolerance_s: float = 0.0
    tf_timeout_s: float = 0.2  # of tracker_node
    cache_length_s: float = 1.0


class Finding(NamedTuple):
    """Result of a check: its subject, and either a fact or a fault with its fix."""

    subject: str
    fact: str = ''
    fault: str = ''
    fix: str = ''
    is_fatal: bool = True  # of a fault: whether results are wrong or missing because of it

    @property
    def lines(self):
        if self.fault:
            return ['wrong  %s: %s' % (self.subject, self.fault), '       fix: %s' % self.fix]
        return ['ok     %s: %s' % (self.subject, self.fact)]
