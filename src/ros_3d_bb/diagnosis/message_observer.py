"""Convert messages to observations, for running graphs and bags alike, and observe the first seconds of a bag."""
import collections
import contextlib
import functools

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
from ros_3d_bb.core.time_jumps import TimeJumps
from ros_3d_bb.core.time_sync import JUMP_NS, NS, SAME_NS
from ros_3d_bb.diagnosis.camera_mount import camera_mount
from ros_3d_bb.diagnosis.checks import COLOR, DEPTH, INFO, ROLES
from ros_3d_bb.diagnosis.observations import COMPRESSED_IMAGE, IMAGE, KEPT, Newest, Observations, Stream, TfSeen
from ros_3d_bb.core.senders import Senders, sender_of
from ros_3d_bb.diagnosis.tf_tree import links_in

COMPARED_NS, PAIRS = NS // 4, 16  # between two images that are kept and compared; number of those that are kept
BAG_SECONDS = 10.0  # cache length of tf2


class EdgeObserver(object):
    """Compare the edges of colour and depth images with the same stamp, at most every `COMPARED_NS`."""

    def __init__(self, color, depth):
        self._edges, self._color, self._depth = EdgeComparison(), color, depth
        self._same, self._near = (collections.deque(maxlen=PAIRS) for _kind in range(2))  # (stamp, RGB, DepthImage)
        color.on_message = depth.on_message = self._compare

    @property
    def pairs(self):
        """Up to `PAIRS` colour images, RGB, with the DepthImage of their stamp or, if the camera does not synchronize
        its images, of a stamp at most `COMPARED_NS` away."""
        return [pair[1:] for pair in self._same or self._near]

    def fault(self):
        """Return a sentence if the edges disagree, '' otherwise."""
        return self._edges.fault()

    def _compare(self):
        color, depth = self._color.newest, self._depth.newest
        if color is None or depth is None:
            return
        stamp_ns, depth_stamp_ns = color.header.stamp.to_nsec(), depth.header.stamp.to_nsec()
        is_same = abs(stamp_ns - depth_stamp_ns) <= SAME_NS
        pairs = self._same if is_same else self._near
        is_near = not self._same and abs(stamp_ns - depth_stamp_ns) <= COMPARED_NS
        if (is_same or is_near) and not (pairs and abs(stamp_ns - pairs[-1][0]) < COMPARED_NS):
            with contextlib.suppress(ValueError):  # reported as an invalid encoding
                pairs.append((stamp_ns, imgmsg_to_rgb(color), imgmsg_to_depth(depth)))
                if is_same:
                    self._edges.add(*pairs[-1][1:])


class Observation(object):
    """Statistics of the messages of one topic: their count, stamps and arrival times, and the newest message.

    `role` is that of the topic (see `checks.ROLES`), or None; `on_message` is called after each message.
    """

    def __init__(self, role, topic):
        self.role, self.topic, self.newest, self.on_message = role, topic, None, lambda: None
        self._count, self._passed_ns, self._last_ns = 0, 0, None
        self._stamps_ns, self._lags_s = collections.deque(maxlen=KEPT), (None, None)
        self._senders, self._jumps = Senders(), TimeJumps()

    def take(self, message, ros_ns, machine_s=None):
        """Record a message with its arrival in ROS time (0 before the first /clock message) and in machine time."""
        self._count += 1
        self._passed_ns += max(ros_ns - (self._last_ns or ros_ns), 0)  # not from the end of a looped bag to its start
        self._last_ns = ros_ns
        self.newest = message
        stamp_ns = _stamp_in(message)
        if stamp_ns:
            self._stamps_ns.append(stamp_ns)
        self._senders.add(sender_of(message))
        if stamp_ns and machine_s is not None:
            self._jumps.see('ROS time', ros_ns, machine_s)
            self._jumps.see('stamps', stamp_ns, machine_s)
        if stamp_ns and ros_ns and not (machine_s is not None and self._jumps.are_recent(machine_s)):
            self._lags_s = (ros_ns - stamp_ns) / NS, None if machine_s is None else machine_s - stamp_ns / NS
        self.on_message()

    def stream(self, published_kind, publishers=()):
        rate_hz = (self._count - 1) * NS / self._passed_ns if self._passed_ns else 0.0
        return Stream(self.role, self.topic, published_kind, publishers, self._count, rate_hz, tuple(self._stamps_ns),
                      *self._lags_s, senders=self._senders.take())

    def tf_seen(self, transforms, target_frame, source_frame=''):
        """Look up the pose of the camera in the fixed frame at the stamp of an image. None without images.

        `transforms` is a TransformBuffer; `source_frame` replaces the frame_id of the image.
        """
        if not self._stamps_ns:
            return None
        stamps_ns = list(self._stamps_ns)
        begin = max((end for end in range(1, len(stamps_ns)) if stamps_ns[end] < stamps_ns[end - 1] - JUMP_NS),
                    default=0)  # tf has no transforms from before a jump back in time
        stamp_ns = stamps_ns[(begin + len(stamps_ns)) // 2]  # the middle one: its transforms must have arrived
        target, source = target_frame.lstrip('/'), (source_frame or self.newest.header.frame_id).lstrip('/')
        stamp, fault, of_viewing = time_from(stamp_ns), '', ''
        try:
            of_viewing = viewing_fault(source, transforms.lookup(target, source, stamp))
        except tf2_ros.TransformException as error:
            fault = str(error)
        return TfSeen(target, source, stamp.to_sec(), links_in(transforms.all_frames_as_yaml()), fault, of_viewing)


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
    depth_info, transforms = Observation(None, name_of(info_topic)), BagTransforms()
    edges = EdgeObserver(observed[COLOR], observed[DEPTH])
    with BagReader(path) as reader:
        topics = reader.topics
        raw_topics = _raw_topics(reader, topics)
        _read(reader, observed, depth_info, transforms)
    info = observed[INFO].newest
    frame_id = info.header.frame_id if depth == RAW and info is not None else ''  # that of the 3D boxes
    seen = observations_of(observed, depth_info, topics, BAG_SECONDS, is_bag=True, edges_fault=edges.fault(),
                           tf=observed[DEPTH].tf_seen(transforms, target_frame, frame_id), depth_is_raw=depth == RAW,
                           raw_topics=raw_topics, depth_info_topic=depth_info.topic)
    if depth == RAW:
        return seen
    is_aligned = seen.color_info is not None and seen.depth is not None and not (
        seen.color_info.fault or seen.depth.fault or seen.edges_fault
        or size_fault(seen.color_info.converted, *seen.depth.converted.shape[::-1]))
    if is_aligned and edges.pairs and seen.tf is not None and seen.tf.fault:
        return seen._replace(mount=camera_mount(edges.pairs, seen.color_info.converted))
    return seen


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


def _read(reader, observed, depth_info, transforms):
    """Read the first seconds of a bag. Messages that have another type or are damaged are ignored."""
    for raw in reader.messages(['/' + STATIC_TOPIC]):
        with contextlib.suppress(ValueError):
            transforms.add_static(message_in(raw, TFMessage))
    takers = {one.topic: (one.take, [get_message_class(kind) for kind in one.role.kinds]) for one in observed.values()}
    takers[depth_info.topic] = depth_info.take, [CameraInfo]
    takers['/' + TF_TOPIC] = lambda message, _time_ns: transforms.add(message), [TFMessage]
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
