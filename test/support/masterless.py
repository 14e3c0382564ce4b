"""Nodes in this process without a master: their subscribers and publishers are replaced by recording ones.

Only the connections of rospy and tf2 are replaced; the nodes and their callbacks are the real ones. Published messages
are serialized, as by rospy; so are the messages that are sent to them (see `on_the_wire`).
"""
import contextlib
import io
from unittest import mock

import genpy
import rosbag


def on_the_wire(message):
    """The message as a subscriber receives it. Raises the error of genpy if a field cannot be sent."""
    buffer = io.BytesIO()
    message.serialize(buffer)
    return type(message)().deserialize(buffer.getvalue())


class Publisher(object):
    """Keeps and counts the published messages. It has a subscriber, so that every output is computed."""

    def __init__(self, topic, kind):
        self.topic, self.kind, self.count, self.newest, self.connections = topic, kind, 0, None, 1

    def publish(self, message):
        self.newest = on_the_wire(message)
        self.count += 1

    def get_num_connections(self):
        return self.connections


def immediate_worker(work, _on_error, _most=1):
    """Replaces NewestWorker: works at once, and raises errors, which a worker would only count."""
    def offer(item):
        work(item)
        return False
    return mock.Mock(offer=offer)


class Connections(object):
    """Connections of the nodes that were created in `masterless`, and ROS time."""

    def __init__(self):
        self.publishers, self.subscribers = {}, {}  # by topic
        self.services = {}  # types by name
        self.timers = []  # (period in seconds, callback)
        self.now = genpy.Time(1)

    def send(self, topic, message):
        message._connection_header = {'callerid': 'test'}  # required by tf2's listener
        self.subscribers[topic].callback(message)

    def _publisher(self, topic, kind, **_options):
        self.publishers[topic] = Publisher(topic, kind)
        return self.publishers[topic]

    def _subscriber(self, topic, kind, callback, **_options):
        self.subscribers[topic] = mock.Mock(topic=topic, kind=kind, callback=callback, resolved_name='/' + topic)
        return self.subscribers[topic]


@contextlib.contextmanager
def masterless(params=()):
    """Within the block, nodes can be created, with these private parameters (a dict). Yields Connections."""
    connections = Connections()
    replaced = {
        'rospy.Publisher': connections._publisher, 'rospy.Subscriber': connections._subscriber,
        'rospy.Service': lambda name, kind, _handler: connections.services.update({name: kind}),
        'rospy.Timer': lambda period, callback, **_options: connections.timers.append((period.to_sec(), callback)),
        'rospy.on_shutdown': mock.Mock(), 'rospy.set_param': mock.Mock(),
        'rospy.get_param': lambda name, default=None: (
            dict(params) if name == '~' else dict(params).get(name.lstrip('~'), default)),
        'rospy.resolve_name': lambda name: '/' + name, 'rospy.is_shutdown': lambda: False,
        'rospy.get_param_cached': lambda name, default: dict(params).get(name.lstrip('~'), default),
        'rospy.get_rostime': lambda: connections.now, 'rospy.rostime.get_rostime': lambda: connections.now,
        'rospy.logwarn_throttle': lambda _period_s, text, *arguments: text % arguments,
        'ros_3d_bb.nodes.common.subscribers._inputs': [],
        'ros_3d_bb.nodes.common.diagnostics.Diagnostics._run': mock.Mock(),
        'ros_3d_bb.nodes.common.detector_output.NewestWorker': immediate_worker,
        # Detections take no time: on a slow machine, images would be left out.
        'ros_3d_bb.nodes.common.detector_output.time': mock.Mock(monotonic=lambda: 0.0),
        'ros_3d_bb.nodes.people_node.NewestWorker': immediate_worker,
        'ros_3d_bb.nodes.tracker_node.NewestWorker': immediate_worker,
        'ros_3d_bb.nodes.bbox3d_node.NewestWorker': immediate_worker,
        'ros_3d_bb.nodes.bbox3d_node.patient_master': mock.Mock()}
    for level in ('loginfo', 'logwarn', 'loginfo_once'):
        replaced['rospy.' + level] = lambda text, *arguments: text % arguments
    with contextlib.ExitStack() as stack:
        for name, ours in replaced.items():
            stack.enter_context(mock.patch(name, ours))
        yield connections


def published(node_class, bag_path, params, topics):
    """{topic: messages} that a node publishes for the messages of a bag."""
    kept = {topic: [] for topic in topics}
    with masterless(params) as connections, rosbag.Bag(bag_path) as bag:
        node_class()
        for topic, message, _time in bag.read_messages():
            before = {name: connections.publishers[name].count for name in topics}
            topic = topic.replace('/compressedDepth', '').replace('/compressed', '')
            for name in {topic, topic[1:]} & set(connections.subscribers):
                connections.send(name, on_the_wire(message))
            for name in topics:
                if connections.publishers[name].count > before[name]:
                    kept[name].append(connections.publishers[name].newest)
    return kept
