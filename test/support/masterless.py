"""Nodes in this process without a master: what they subscribe, publish and ask of tf is taken by objects of ours.

Only rospy's and tf2's connections are replaced; the nodes and their callbacks are the real ones. What a node publishes
is serialized, as rospy would; what it is sent has been, too (see `on_the_wire`).
"""
import contextlib
import io
from unittest import mock

import genpy
import tf2_ros


def on_the_wire(message):
    """The message as a subscriber gets it. Raises what genpy raises where a field cannot be sent."""
    buffer = io.BytesIO()
    message.serialize(buffer)
    return type(message)().deserialize(buffer.getvalue())


class Publisher(object):
    """Keeps what was published last, and counts."""

    def __init__(self, topic, kind, **_options):
        self.topic, self.kind, self.count, self.newest = topic, kind, 0, None

    def publish(self, message):
        """Serialize a message, as rospy does where somebody subscribes."""
        self.newest = on_the_wire(message)
        self.count += 1

    def get_num_connections(self):
        """Somebody always looks, so that everything is made."""
        return 1


class Subscriber(object):
    """Keeps a callback."""

    def __init__(self, topic, kind, callback, **_options):
        self.topic, self.kind, self.callback = topic, kind, callback

    def unregister(self):
        """Nothing is connected."""


class Buffer(tf2_ros.BufferCore):
    """tf2's buffer with transforms that a test sets."""

    def __init__(self, **_options):
        super(Buffer, self).__init__()

    def lookup_transform(self, target_frame, source_frame, stamp):
        """Without a wait, which needs a clock."""
        return self.lookup_transform_core(target_frame, source_frame, stamp)


class Immediately(object):
    """In place of the worker thread: works at once. Errors, which a worker only counts, are kept."""

    def __init__(self, work, _on_error):
        self._work = work

    def offer(self, item):
        """Work on an item."""
        self._work(item)
        return False

    def stop(self):
        """There is no thread."""


class Connections(object):
    """What the nodes made in `masterless` have connected to.

    Attributes
    ----------
    publishers, subscribers : dict
        By topic.
    services : dict
        Types by name.
    buffers : list
        tf buffers.
    now : genpy.Time
        What rospy takes for the time.
    """

    def __init__(self):
        self.publishers, self.subscribers, self.services, self.buffers, self.timers = {}, {}, {}, [], []
        self.now = genpy.Time(1)

    def send(self, topic, message):
        """Call the callback of a topic."""
        message._connection_header = {'callerid': 'test'}  # which tf2's listener asks for
        self.subscribers[topic].callback(message)

    def _keeping(self, kept, kind):
        def made(topic, *arguments, **options):
            kept[topic] = kind(topic, *arguments, **options)
            return kept[topic]
        return made

    def _buffer(self, **options):
        self.buffers.append(Buffer(**options))
        return self.buffers[-1]

    def _service(self, name, kind, _handler):
        self.services[name] = kind

    def _timer(self, _period, callback, **_options):
        self.timers.append(callback)


@contextlib.contextmanager
def masterless(params=()):
    """Within the block nodes can be made, with these private parameters (a dict). Yields Connections."""
    connections = Connections()
    replaced = {
        'rospy.Publisher': connections._keeping(connections.publishers, Publisher),
        'rospy.Subscriber': connections._keeping(connections.subscribers, Subscriber),
        'rospy.Service': connections._service, 'rospy.Timer': connections._timer, 'rospy.on_shutdown': mock.Mock(),
        'rospy.set_param': mock.Mock(),
        'rospy.get_param': lambda name, default=None: dict(params) if name == '~' else default,
        'rospy.resolve_name': lambda name: '/' + name, 'rospy.is_shutdown': lambda: False,
        'rospy.get_rostime': lambda: connections.now, 'rospy.rostime.get_rostime': lambda: connections.now,
        'rospy.logwarn_throttle': lambda _period_s, text, *arguments: text % arguments,
        'tf2_ros.Buffer': connections._buffer,
        'diagnostic_updater.Updater': mock.Mock(),
        'ros_3d_bb.nodes.common.detector_output.NewestWorker': Immediately,
        'ros_3d_bb.nodes.common.persistent_track_ids.NewestWorker': Immediately,
        'ros_3d_bb.nodes.common.debug_images.NewestWorker': Immediately,
        'ros_3d_bb.nodes.common.debug_images.patient_master': mock.Mock()}
    for level in ('loginfo', 'logwarn', 'loginfo_once'):
        replaced['rospy.' + level] = lambda text, *arguments: text % arguments
    with contextlib.ExitStack() as stack:
        for name, ours in replaced.items():
            stack.enter_context(mock.patch(name, ours))
        yield connections
