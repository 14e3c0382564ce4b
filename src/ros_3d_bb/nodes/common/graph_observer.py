"""Observe the topics of a running ROS graph for some seconds, as input of the checks."""
import contextlib
import time

import rospy
from diagnostic_msgs.msg import DiagnosticArray
from genpy.message import get_message_class
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo

from ros_3d_bb.conversions.camera_msgs import DEPTH_TOPICS, RAW, info_topic_beside, topic_of
from ros_3d_bb.conversions.perception_msgs import TRACKS_TOPIC
from ros_3d_bb.core.params import params_from
from ros_3d_bb.diagnosis.message_observer import EdgeObserver, Observation, observations_of
from ros_3d_bb.diagnosis.roles import BOXES3D, COLOR, DEPTH, ROLES
from ros_3d_bb.diagnosis.tf_arrivals import TfArrivals
from ros_3d_bb.nodes.common.master import published_topics, publishers_of
from ros_3d_bb.nodes.common.subscribers import IMAGE_BUFFER
from ros_3d_bb.nodes.common.tf_lookup import TransformListener
from ros_3d_bb.pipeline.estimation_stage import Bbox3dParams
from ros_3d_bb.pipeline.tracking_stage import TrackerNodeParams
from ros_3d_bb.pipeline.transform_buffer import TransformBuffer

NAMES_S = 1.5  # nodes publish the names of their topics once per second
OURS = ': pipeline'  # suffix of the diagnostics of the nodes of this package


class ObservedTransforms(TransformBuffer):
    """tf2 buffer that also records when the transforms of /tf arrive: `arrivals`."""

    def __init__(self):
        TransformBuffer.__init__(self)
        self.arrivals = TfArrivals()

    def set_transform(self, transform, authority):
        self.arrivals.add(transform, rospy.get_rostime().to_nsec())
        TransformBuffer.set_transform(self, transform, authority)


class GraphObserver(object):
    """Subscribe to the topics of the graph; `observations` returns what was received.

    Topic names are taken from the remappings of doctor, or else from the diagnostics of the running nodes.
    `camera_name` is the namespace of the observed camera if there are several.
    """

    def __init__(self, target_frame='', camera_name=''):
        self._target_frame, self._camera_name = target_frame, camera_name
        self._statuses, self._clocks = {}, []
        self._transforms = ObservedTransforms()
        self._listener = TransformListener(self._transforms)
        self._subscribers = [rospy.Subscriber('/diagnostics', DiagnosticArray, self._on_diagnostics),
                             rospy.Subscriber('/clock', Clock, self._clocks.append, queue_size=10)]
        time.sleep(NAMES_S)
        self._topics = published_topics()
        names = {key: role.name for key, role in ROLES.items()}
        names[DEPTH] = DEPTH_TOPICS[self._bbox3d_param('depth')][0]
        self._observed = {key: Observation(role, self._topic_of(names[key])) for key, role in ROLES.items()}
        self._depth_info = Observation(None, info_topic_beside(self._observed[DEPTH].topic))
        self._edges = EdgeObserver(self._observed[COLOR], self._observed[DEPTH])
        self._began_s = time.monotonic()
        for one in self._observed.values():
            if self._topics.get(one.topic) in one.role.kinds:
                self._subscribe(one, get_message_class(self._topics[one.topic]))
        self._subscribe(self._depth_info, CameraInfo)

    def close(self):
        self._listener.unregister()
        for subscriber in self._subscribers:
            subscriber.unregister()

    def observations(self):
        self._topics.update(published_topics())
        boxes3d, frame_id = self._observed[BOXES3D].newest, self._bbox3d_param('frame_id')
        target_frame = self._target_frame or tracker_param('target_frame')
        camera_frame = tracker_param('camera_frame') or (boxes3d.header.frame_id if boxes3d is not None else frame_id)
        timeout_s = tracker_param('tf_timeout')
        return observations_of(
            self._observed, self._depth_info, self._topics, time.monotonic() - self._began_s, publishers_of,
            self._bbox3d_param('depth_scale'), frame_id=frame_id,
            tf=self._observed[DEPTH].tf_seen(self._transforms, target_frame, camera_frame, self._transforms.arrivals,
                                             timeout_s),
            tf_timeout_s=timeout_s, use_sim_time=bool(rospy.get_param('/use_sim_time', False)),
            clock_count=len(self._clocks),
            tf_senders=self._transforms.senders(),
            nodes={name: status[:2] for name, status in list(self._statuses.items())},
            depth_is_raw=self._bbox3d_param('depth') == RAW, floor_frame=self._bbox3d_param('floor_frame'),
            stamp_tolerance_s=self._bbox3d_param('stamp_tolerance'),
            cache_length_s=self._bbox3d_param('cache_length'), **self._edges.faults())

    def _bbox3d_param(self, name):
        return _param(topic_of(self._camera_name, 'bbox3d_node'), name, Bbox3dParams)

    def _topic_of(self, name):
        wanted = name_for(self._camera_name, name)
        resolved = rospy.resolve_name(wanted)
        if resolved != rospy.get_namespace() + wanted:
            return resolved
        prefix = (rospy.get_namespace() + self._camera_name).strip('/') + '/'  # of the nodes of this camera
        reported = [values.get('input ' + (name if node.startswith(prefix) else wanted), '')
                    for node, (_level, _sentence, values) in list(self._statuses.items())]
        return next((text.split()[0] for text in reported if text), resolved)

    def _subscribe(self, one, kind):
        def take(message):
            one.take(message, rospy.get_rostime().to_nsec(), time.time())
        self._subscribers.append(rospy.Subscriber(one.topic, kind, take, queue_size=10, buff_size=IMAGE_BUFFER))

    def _on_diagnostics(self, message):
        prefix = rospy.get_namespace()[1:]  # ends in a slash, so that robot1 does not match robot10
        for status in message.status:
            if status.name.endswith(OURS) and status.name.startswith(prefix):
                values = {entry.key: entry.value for entry in status.values}
                self._statuses[status.name[:-len(OURS)]] = status.level, status.message, values


def name_for(camera_name, topic):
    """Return the name of a pipeline topic for one of several cameras; the tracks are common to all cameras."""
    return topic if topic == TRACKS_TOPIC else topic_of(camera_name, topic)


def tracker_param(name):
    return _param('tracker_node', name, TrackerNodeParams)


def _param(node, name, kind):
    """Return a parameter of a node, or its default if it is not set, or invalid, which the node itself reports."""
    params = kind()
    value = rospy.get_param(rospy.resolve_name('%s/%s' % (node, name)), getattr(params, name))
    with contextlib.suppress(ValueError):
        params, = params_from({name: value}, kind)
    return getattr(params, name)
