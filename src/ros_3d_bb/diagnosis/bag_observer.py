"""Observe the first seconds of a bag, as input of the checks."""
import genpy
import tf2_ros
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Int32MultiArray
from tf2_msgs.msg import TFMessage

from ros_3d_bb.bags.bag_reader import BagReader, message_in
from ros_3d_bb.bags.bag_tf_buffer import BagTransforms
from ros_3d_bb.conversions.camera_msgs import INFO_TOPICS, STATIC_TOPIC, TF_TOPIC
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.diagnosis.checks import BOXES2D, BOXES3D, COLOR, DEPTH, INFO, TRACKS
from ros_3d_bb.diagnosis.message_observer import Observation, camera_seen, color_seen, depth_seen
from ros_3d_bb.diagnosis.observations import Observations, TfSeen
from ros_3d_bb.diagnosis.tf_tree import links_in
from ros_3d_bb.diagnosis.topic_roles import ROLES
from ros_3d_bb.msg import BoundingBox3DArray, TrackedObjectArray

CLASSES = {COLOR: Image, DEPTH: Image, INFO: CameraInfo, BOXES2D: Int32MultiArray, BOXES3D: BoundingBox3DArray,
           TRACKS: TrackedObjectArray}
SECONDS = 10.0  # cache length of tf2


def observe_bag(path, name_of, target_frame, seconds=SECONDS):
    """Read the first seconds of a bag.

    Parameters
    ----------
    path : str
    name_of : callable
        Maps the name of a topic of the nodes to its name in the bag, with a leading slash.
    target_frame : str
        Fixed frame of the tracks.
    seconds : float
        Duration that is read.

    Returns
    -------
    Observations

    Raises
    ------
    BagError
        If the bag cannot be read.
    """
    observed = {key: Observation(key, name_of(role.name)) for key, role in ROLES.items()}
    depth_info = _Newest(name_of(INFO_TOPICS[1]))
    with BagReader(path) as reader:
        kinds = reader.topics
        transforms = _read(reader, observed, depth_info, seconds)
    streams = {key: one.stream(kinds.get(one.topic, '')) for key, one in observed.items()}
    return Observations(streams, kinds, seconds, is_bag=True, color_camera=camera_seen(observed[INFO].newest),
                        depth_camera=camera_seen(depth_info.newest), color=color_seen(observed[COLOR].newest),
                        depth=depth_seen(observed[DEPTH].newest), tf=tf_seen(transforms, observed[DEPTH], target_frame))


class _Newest(object):
    """The newest message of a topic without a role."""

    def __init__(self, topic):
        self.topic, self.newest = topic, None

    def take(self, message, *_times):
        self.newest = message


def _read(reader, observed, depth_info, seconds):
    """Read the first seconds of a bag into the observations. Returns the BagTransforms."""
    transforms, begin_ns = BagTransforms(), None
    for raw in reader.messages(['/' + STATIC_TOPIC]):
        _try(lambda: transforms.set_static(message_in(raw, TFMessage)))
    takers = {one.topic: (one.take, CLASSES[key]) for key, one in observed.items()}
    takers[depth_info.topic] = depth_info.take, CameraInfo
    takers['/' + TF_TOPIC] = lambda message, *_times: transforms.ahead(message), TFMessage
    for raw in reader.messages(sorted(takers)):
        time_ns = raw.time.to_nsec()
        begin_ns = time_ns if begin_ns is None else begin_ns
        if time_ns - begin_ns > seconds * NS:
            break
        take, kind = takers[raw.topic]
        _try(lambda: take(message_in(raw, kind), time_ns))
    return transforms


def _try(take):
    """Process a message and ignore it if it has another type or is damaged."""
    try:
        take()
    except ValueError:
        pass


def tf_seen(transforms, depth, target_frame, source_frame=''):
    """Look up the pose of the camera in the fixed frame at the stamp of a depth image.

    Parameters
    ----------
    transforms
        Object with the methods `lookup` and `frames_as_yaml` of `BagTransforms`.
    depth : Observation
    target_frame, source_frame : str
        The fixed frame, and the frame of the camera if the frame_id of the image is wrong.

    Returns
    -------
    TfSeen or None
        None if there is no image.
    """
    if depth.middle_ns is None:
        return None
    source, stamp = source_frame or depth.newest.header.frame_id, genpy.Time(*divmod(depth.middle_ns, NS))
    try:
        transforms.lookup(target_frame, source, stamp)
        fault = ''
    except tf2_ros.TransformException as error:
        fault = str(error)
    return TfSeen(target_frame, source, stamp.to_sec(), links_in(transforms.frames_as_yaml()), fault)
