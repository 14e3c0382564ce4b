"""Convert messages to observations, for running graphs and bags alike, and observe the first seconds of a bag."""
import collections
import contextlib
import functools

import numpy as np
import tf2_ros
from genpy.message import get_message_class
from sensor_msgs.msg import CameraInfo, Image
from tf2_msgs.msg import TFMessage

from ros_3d_bb.bags.bag_reader import BagReader, message_in
from ros_3d_bb.bags.bag_tf_buffer import BagTransforms
from ros_3d_bb.camera.alignment import EdgeComparison, frames_fault, size_fault, viewing_fault
from ros_3d_bb.conversions.camera_msgs import (DEPTH_TOPICS, IMAGE_KINDS, RAW, STATIC_TOPIC, TF_TOPIC, info_of_images,
                                               uncompressed)
from ros_3d_bb.conversions.image_msgs import DEPTH_SCALES, imgmsg_to_depth, imgmsg_to_rgb
from ros_3d_bb.conversions.perception_msgs import boxes2d_from_msg, camera_from_msg, time_from
from ros_3d_bb.core.senders import Senders, sender_of
from ros_3d_bb.core.time_jumps import TimeJumps
from ros_3d_bb.core.time_sync import JUMP_NS, NS, SAME_NS
from ros_3d_bb.diagnosis.camera_mount import camera_mount
from ros_3d_bb.diagnosis.observations import COMPRESSED_IMAGE, IMAGE, KEPT, Newest, Observations, Stream, TfSeen
from ros_3d_bb.diagnosis.roles import COLOR, DEPTH, INFO, ROLES
from ros_3d_bb.diagnosis.tf_arrivals import TfArrivals
from ros_3d_bb.diagnosis.tf_tree import links_in
from ros_3d_bb.pipeline.tracking_stage import TrackerNodeParams

COMPARED_NS, PAIRS = NS // 4, 16  # between two images that are kept and compared; number of those that are kept
RECENT = 30  # images that may have the stamp of a later one: a second of them; chosen
# Stamps of images that arrive within TOGETHER_NS and differ by more than APART_S are compared by their images; chosen:
# in that time, people move by less than an edge of a person is wide, and in the other by more.
APART_S, TOGETHER_NS = 0.1, NS // 50
POSES, MOVED = 8, 0.02  # poses of the camera that are compared; metres or sines of angles of one that moves; chosen
BAG_SECONDS = 10.0  # cache length of tf2


class EdgeObserver(object):
    """Compare the edges of colour and depth images with the same stamp, at most every `COMPARED_NS`, and those of
    images that arrive together with different stamps: if these agree, the stamps are of different clocks.
    """

    def __init__(self, color, depth):
        self._color, self._depth = color, depth
        self._edges, self._edges_together = EdgeComparison(), EdgeComparison()
        self._recent = {one: collections.deque(maxlen=RECENT) for one in (color, depth)}  # messages
        # (stamp, RGB, DepthImage)
        self._same, self._near, self._together = (collections.deque(maxlen=PAIRS) for _kind in range(3))
        color.on_message, depth.on_message = (functools.partial(self._compare, *both)
                                              for both in ((color, depth), (depth, color)))

    @property
    def pairs(self):
        """Up to `PAIRS` colour images, RGB, with the DepthImage of their stamp or, if the camera does not synchronize
        its images, of a stamp at most `COMPARED_NS` away; without such, None and the latest DepthImages."""
        pairs = [pair[1:] for pair in self._same or self._near]
        with contextlib.suppress(ValueError):  # reported as an invalid encoding
            return pairs or [(None, imgmsg_to_depth(message)) for message in list(self._recent[self._depth])[::4]]
        return []

    def faults(self):
        return {'edges_fault': self._edges.fault(), 'edges_together': self._edges_together.fault()}

    def _compare(self, one, other):
        """Compare the newest message of an Observation with those of the other."""
        self._recent[one].append(one.newest)
        same = [message for message in self._recent[other] if abs(_gap_ns(one.newest, message)) <= SAME_NS]
        for message in same[-1:]:
            self._add(self._same, one, message, self._edges)
        if other.newest is None or same:
            return
        if abs(_gap_ns(one.newest, other.newest)) <= COMPARED_NS:
            self._add(self._near, one, other.newest)
        if one.lag_s is not None and other.lag_s is not None and (
                abs(one.lag_s - other.lag_s) > APART_S and one.arrival_ns - other.arrival_ns < TOGETHER_NS):
            self._add(self._together, one, other.newest, self._edges_together)

    def _add(self, pairs, one, message, edges=None):
        """Add the newest message of an Observation and one of the other to some pairs, and compare their edges."""
        color, depth = (one.newest, message) if one is self._color else (message, one.newest)
        stamp_ns = color.header.stamp.to_nsec()
        if pairs and abs(stamp_ns - pairs[-1][0]) < COMPARED_NS:
            return
        with contextlib.suppress(ValueError):  # reported as an invalid encoding
            pairs.append((stamp_ns, imgmsg_to_rgb(color), imgmsg_to_depth(depth)))
            if edges is not None:
                edges.add(*pairs[-1][1:])


def _gap_ns(message, other):
    return message.header.stamp.to_nsec() - other.header.stamp.to_nsec()


class Observation(object):
    """Statistics of the messages of one topic: their count, stamps and arrival times, and the newest message.

    `role` is that of the topic (see `checks.ROLES`), or None; `on_message` is called after each message. `arrival_ns`
    is the arrival of the newest one in ROS time, and `lag_s` the time since its stamp, None if either is unknown.
    """

    def __init__(self, role, topic):
        self.role, self.topic, self.newest, self.on_message = role, topic, None, lambda: None
        self._count, self._passed_ns, self.arrival_ns, self._is_empty = 0, 0, None, True
        self._received_ns, self.lag_s, self._machine_lag_s = collections.deque(maxlen=KEPT), None, None
        self._senders, self._jumps = Senders(), TimeJumps()

    def take(self, message, ros_ns, machine_s=None):
        """Record a message with its arrival in ROS time (0 before the first /clock message) and in machine time."""
        self._count += 1
        if self.arrival_ns:
            self._passed_ns += max(ros_ns - self.arrival_ns, 0)  # not from the end of a looped bag to its start
        self.arrival_ns, self.newest = ros_ns, message
        self._is_empty = self._is_empty and _is_empty(message)
        stamp_ns = _stamp_in(message)
        if stamp_ns:
            self._received_ns.append((stamp_ns, ros_ns))
        self._senders.add(sender_of(message))
        if stamp_ns and machine_s is not None:
            self._jumps.see('ROS time', ros_ns, machine_s)
            self._jumps.see('stamps', stamp_ns, machine_s)
        if stamp_ns and ros_ns and not (machine_s is not None and self._jumps.are_recent(machine_s)):
            self.lag_s = (ros_ns - stamp_ns) / NS
            self._machine_lag_s = None if machine_s is None else machine_s - stamp_ns / NS
        self.on_message()

    def stream(self, published_kind, publishers=()):
        rate_hz = (self._count - 1) * NS / self._passed_ns if self._passed_ns else 0.0
        stamps_ns = tuple(stamp_ns for stamp_ns, _arrival_ns in list(self._received_ns))
        return Stream(self.role, self.topic, published_kind, publishers, self._count, rate_hz, stamps_ns, self.lag_s,
                      self._machine_lag_s, self._senders.take(), self._is_empty)

    def tf_seen(self, transforms, target_frame, source_frame='', arrivals=TfArrivals(), timeout_s=0.0):
        """Look up the pose of the camera in the fixed frame at the stamp of an image. None without images.

        `transforms` is a TransformBuffer; `source_frame` replaces the frame_id of the image. `arrivals` has those of
        the transforms, for which each image waits `timeout_s`.
        """
        if not self._received_ns:
            return None
        images_ns = list(self._received_ns)
        stamps_ns = [stamp_ns for stamp_ns, _arrival_ns in images_ns]
        begin = max((end for end in range(1, len(stamps_ns)) if stamps_ns[end] < stamps_ns[end - 1] - JUMP_NS),
                    default=0)  # tf has no transforms from before a jump back in time
        stamp_ns = stamps_ns[(begin + len(stamps_ns)) // 2]  # the middle one: its transforms must have arrived
        target, source = target_frame.lstrip('/'), (source_frame or self.newest.header.frame_id).lstrip('/')
        stamp, fault, of_viewing = time_from(stamp_ns), '', ''
        try:
            of_viewing = viewing_fault(source, transforms.lookup(target, source, stamp))
        except tf2_ros.TransformException as error:
            fault = str(error)
        up, down = transforms.ancestors(source), transforms.ancestors(target)
        between = set(up) ^ set(down) if up[-1] == down[-1] else ()
        images_ns = [image_ns for image_ns in images_ns[begin:] if image_ns[1]]
        poses = _poses(transforms, up[-1], source, stamps_ns[begin:])
        return TfSeen(target, source, stamp.to_sec(), links_in(transforms.all_frames_as_yaml()), fault, of_viewing,
                      poses[0] if poses else None, any(np.abs(pose - poses[0]).max() > MOVED for pose in poses),
                      arrivals.lags_s(between), arrivals.share_in_time(between, images_ns, timeout_s))


def _poses(transforms, root, camera_frame, stamps_ns):
    """Return poses (4, 4) of a camera in the root of its tree, at some of the stamps of its images."""
    poses = []
    for number in np.unique(np.linspace(0, len(stamps_ns) - 1, POSES).astype(int)) if root != camera_frame else ():
        with contextlib.suppress(tf2_ros.TransformException):
            poses.append(transforms.lookup(root, camera_frame, time_from(stamps_ns[number])))
    return poses


def observations_of(observed, depth_info, topics, seconds, publishers_of=lambda _topic: (), depth_scale=0.0, **others):
    """Return the Observations of recorded messages; `topics`, `seconds` and `others` are fields of it.

    `observed` has an Observation for each role, `depth_info` is that of the camera_info of depth, and `publishers_of`
    returns the publishers of a topic; it is called for silent ones. `depth_scale` is as for bbox3d_node.
    """
    color_key = COLOR if others['depth_is_raw'] else DEPTH  # of the images with the intrinsics of colour

    def camera_of(images):
        return lambda message: camera_from_msg(info_of_images(message, observed[images].topic))

    streams = {}
    for key, one in observed.items():
        publishers = publishers_of(one.topic) if one.newest is None and one.topic in topics else ()
        streams[key] = one.stream(topics.get(one.topic, ''), publishers)
    return Observations(streams, topics, seconds,
                        color_info=_newest(observed[INFO].newest, camera_of(color_key)),
                        depth_info=_newest(depth_info.newest, camera_of(DEPTH)),
                        color=_newest_image(observed[COLOR].newest, imgmsg_to_rgb),
                        depth=_newest_image(observed[DEPTH].newest, functools.partial(
                            imgmsg_to_depth, scale_m=depth_scale, check_unit=True)), **others)


def observe_bag(path, name_of, target_frame, depth='aligned'):
    """Return the Observations of the first BAG_SECONDS of a bag. Raises BagError if it cannot be read.

    `name_of` maps topics of the nodes to their names in the bag, with a leading slash; `depth` is as for bbox3d_node.
    """
    depth_topic, info_topic = DEPTH_TOPICS[depth]
    roles = dict(ROLES, **{DEPTH: ROLES[DEPTH]._replace(name=depth_topic)})
    observed = {key: Observation(role, name_of(role.name)) for key, role in roles.items()}
    depth_info, transforms, arrivals = Observation(None, name_of(info_topic)), BagTransforms(), TfArrivals()
    edges = EdgeObserver(observed[COLOR], observed[DEPTH])
    with BagReader(path) as reader:
        topics = reader.topics
        raw_topics = _raw_topics(reader, topics)
        _read(reader, observed, depth_info, transforms, arrivals)
    info = observed[INFO].newest
    frame_id = info.header.frame_id if depth == RAW and info is not None else ''  # that of the 3D boxes
    timeout_s = TrackerNodeParams().tf_timeout
    seen = observations_of(observed, depth_info, topics, BAG_SECONDS, is_bag=True, depth_is_raw=depth == RAW,
                           tf=observed[DEPTH].tf_seen(transforms, target_frame, frame_id, arrivals, timeout_s),
                           tf_timeout_s=timeout_s, raw_topics=raw_topics, depth_info_topic=depth_info.topic,
                           **edges.faults())
    is_usable = depth != RAW and seen.color_info is not None and seen.depth is not None and not (
        seen.color_info.fault or seen.depth.fault or seen.edges_fault
        or size_fault(seen.color_info.converted, *seen.depth.converted.shape[::-1]))
    return seen._replace(mount=camera_mount(edges.pairs, seen.color_info.converted)) if is_usable else seen


def _raw_topics(reader, topics):
    """Return the topics of depth images whose frame or size is that of no colour image: they are not aligned."""
    depths, colors = {}, set()
    for topic, kind in topics.items():
        if kind not in (IMAGE, COMPRESSED_IMAGE) or '/ros_3d_bb/' in topic:
            continue
        with contextlib.suppress(ValueError, StopIteration):
            image = uncompressed(message_in(next(reader.messages([topic])), *IMAGE_KINDS))
            seen = image.header.frame_id, image.width, image.height
            if image.encoding in DEPTH_SCALES:
                depths[topic] = seen
            elif not image.encoding.startswith('mono') and 'infra' not in topic:
                colors.add(seen)
    return tuple(sorted(topic for topic, (frame, *size) in depths.items() if colors and not any(
        list(color_size) == size and not frames_fault(color_frame, frame) for color_frame, *color_size in colors)))


def _read(reader, observed, depth_info, transforms, arrivals):
    """Read the first seconds of a bag. Messages that have another type or are damaged are ignored."""
    def add_transforms(message, time_ns):
        transforms.add(message)
        for transform in message.transforms:
            arrivals.add(transform, time_ns)

    for raw in reader.messages(['/' + STATIC_TOPIC]):
        with contextlib.suppress(ValueError):
            transforms.add_static(message_in(raw, TFMessage))
    takers = {one.topic: (one.take, [get_message_class(kind) for kind in one.role.kinds]) for one in observed.values()}
    takers[depth_info.topic] = depth_info.take, [CameraInfo]
    takers['/' + TF_TOPIC] = add_transforms, [TFMessage]
    begin_ns = None
    for raw in reader.messages(sorted(takers)):
        time_ns = raw.time.to_nsec()
        begin_ns = time_ns if begin_ns is None else begin_ns
        if time_ns - begin_ns > BAG_SECONDS * NS:
            break
        take, kinds = takers[raw.topic]
        with contextlib.suppress(ValueError):
            take(message_in(raw, *kinds), time_ns)


def _stamp_in(message):
    """Return the stamp of a message, or of the image of 2D boxes, in nanoseconds; None if it has no valid stamp."""
    if hasattr(message, 'header'):
        return message.header.stamp.to_nsec()
    try:
        return boxes2d_from_msg(message).stamp_ns
    except ValueError:
        return None


def _is_empty(message):
    return any(len(getattr(message, name)) == 0 for name in ('data', 'boxes', 'objects') if hasattr(message, name))


def _newest(message, convert):
    if message is None:
        return None
    try:
        return Newest(message, convert(message))
    except ValueError as error:
        return Newest(message, None, str(error))


def _newest_image(message, convert):
    """As `_newest`, of a sensor_msgs/Image; an empty one replaces a compressed image that cannot be decoded."""
    try:
        return _newest(None if message is None else uncompressed(message), convert)
    except ValueError as error:
        return Newest(Image(header=message.header), None, str(error))
