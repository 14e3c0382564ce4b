"""Observe the first seconds of a bag, as input of the checks."""
import contextlib

from genpy.message import get_message_class
from sensor_msgs.msg import CameraInfo
from tf2_msgs.msg import TFMessage

from ros_3d_bb.bags.bag_reader import BagReader, message_in
from ros_3d_bb.bags.bag_tf_buffer import BagTransforms
from ros_3d_bb.conversions.camera_msgs import INFO_TOPICS, STATIC_TOPIC, TF_TOPIC
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.diagnosis.checks import DEPTH
from ros_3d_bb.diagnosis.message_observer import Observation, observations_of
from ros_3d_bb.diagnosis.topic_roles import ROLES

SECONDS = 10.0  # cache length of tf2


def observe_bag(path, name_of, target_frame):
    """Return the Observations of the first SECONDS of a bag. Raises BagError if it cannot be read.

    `name_of` maps the name of a topic of the nodes to its name in the bag, with a leading slash.
    """
    observed = {key: Observation(role, name_of(role.name)) for key, role in ROLES.items()}
    depth_info, transforms = Observation(None, name_of(INFO_TOPICS[1])), BagTransforms()
    with BagReader(path) as reader:
        topics = reader.topics
        _read(reader, observed, depth_info, transforms)
    return observations_of(observed, depth_info, topics, SECONDS, is_bag=True,
                           tf=observed[DEPTH].tf_seen(transforms, target_frame))


def _read(reader, observed, depth_info, transforms):
    """Read the first seconds of a bag. Messages that have another type or are damaged are ignored."""
    for raw in reader.messages(['/' + STATIC_TOPIC]):
        with contextlib.suppress(ValueError):
            transforms.set_static(message_in(raw, TFMessage))
    takers = {one.topic: (one.take, get_message_class(one.role.kind)) for one in observed.values()}
    takers[depth_info.topic] = depth_info.take, CameraInfo
    takers['/' + TF_TOPIC] = lambda message, _time_ns: transforms.ahead(message), TFMessage
    begin_ns = None
    for raw in reader.messages(sorted(takers)):
        time_ns = raw.time.to_nsec()
        begin_ns = time_ns if begin_ns is None else begin_ns
        if time_ns - begin_ns > SECONDS * NS:
            break
        take, kind = takers[raw.topic]
        with contextlib.suppress(ValueError):
            take(message_in(raw, kind), time_ns)
