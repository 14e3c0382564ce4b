"""Run the pipeline on a bag without a ROS master. Equal input bags and parameters give identical output bags."""
import collections
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, NamedTuple, Optional

from sensor_msgs.msg import Image
from tf2_msgs.msg import TFMessage

from ros_3d_bb.bags.bag_reader import BagError, BagReader, Raw, message_in
from ros_3d_bb.bags.bag_tf_buffer import BagTransforms
from ros_3d_bb.bags.bag_writer import new_bag
from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, STATIC_TOPIC, TF_TOPIC
from ros_3d_bb.conversions.perception_msgs import BOXES_TOPIC
from ros_3d_bb.core.event_counter import EventCounter
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.pipeline.detection_stage import detect_in_color, opened_yolov5
from ros_3d_bb.pipeline.offline_pipeline import INPUTS, OUTPUTS, OUTPUTS_OF_CAMERA, Pipeline, Settings

MAX_WAITING_BYTES = 2 ** 28  # messages that are read ahead


class Waiting(NamedTuple):
    """A message that was read ahead of its processing.

    `topic` is the topic of the nodes (None: not used by them), `camera` the namespace, `message` the deserialized
    message if it was needed ahead, and `search` the detection that was started in it.
    """

    raw: Raw
    topic: Optional[str]
    camera: str
    message: Any
    search: Optional[Future]


class BagRun(object):
    """A run of the pipeline on one bag."""

    def __init__(self, reader, settings, events):
        self._reader, self._settings, self._events = reader, settings, events
        self._topics = {settings.name(topic): (topic, '') for topic in (TF_TOPIC, STATIC_TOPIC)}
        self._topics.update((settings.name(topic, camera), (topic, camera)) for camera in settings.cameras
                            for topic in _wanted(settings.detector))
        self._transforms = BagTransforms()
        self._pipeline = Pipeline(settings, events, self._transforms)
        self._detect = None
        if settings.detector == 'yolov5':
            params, detection, running = settings.yolov5
            self._detector = opened_yolov5(params.weights, detection, running,
                                           lambda line: events.note('remarks of the detector', line))
            self._detect = lambda message: detect_in_color(self._detector, message)[1]
        needed = BOXES_TOPIC if settings.detector == 'none' else COLOR_TOPIC
        for camera in settings.cameras:
            reader.check_topic(settings.name(needed, camera), INPUTS[needed])

    def outputs(self):
        """Yield (Raw, [(topic, message), ...]): each message of the bag with the messages published by the nodes."""
        static = self._settings.name(STATIC_TOPIC)
        for raw in self._reader.messages([static]):
            with self._events.rejecting('transforms'):
                self._transforms.set_static(message_in(raw, TFMessage))
        with ThreadPoolExecutor(self._settings.searches) as pool:
            for waiting in self._ahead(pool):
                yield waiting.raw, self._handled(waiting)
        self._pipeline.end()

    def _ahead(self, pool):
        """Yield the messages with a delay, so that transforms within ~tf_timeout and images for the detector are read
        ahead.
        """
        ahead_ns = int(self._settings.tracker[0].tf_timeout * NS)
        queue, size, searches = collections.deque(), 0, 0
        for raw in self._reader.messages():
            queue.append(self._begun(raw, pool))
            size, searches = size + len(raw.data), searches + (queue[-1].search is not None)
            while queue and (size > MAX_WAITING_BYTES or (
                    raw.time.to_nsec() - queue[0].raw.time.to_nsec() >= ahead_ns
                    and (self._detect is None or searches > 2 * self._settings.searches))):
                waiting = queue.popleft()
                size, searches = size - len(waiting.raw.data), searches - (waiting.search is not None)
                yield waiting
        while queue:
            yield queue.popleft()

    def _begun(self, raw, pool):
        """Start the work that can be done ahead of a message's processing: add transforms, submit detections."""
        (topic, camera), message, search = self._topics.get(raw.topic, (None, '')), None, None
        if topic == TF_TOPIC:
            with self._events.rejecting('transforms'):
                message = message_in(raw, TFMessage)
                self._transforms.ahead(message)
        elif topic == COLOR_TOPIC and self._detect is not None:
            with self._events.rejecting('images'):
                message = message_in(raw, Image)
                search = pool.submit(self._detect, message)
        return Waiting(raw, topic, camera, message, search)

    def _handled(self, waiting):
        """Process a message and return the messages that the nodes would publish, [(topic, message), ...]."""
        raw, topic, camera, message, search = waiting
        if topic is None or topic == STATIC_TOPIC:
            return []
        self._events.count('messages on %s' % raw.topic)
        if topic == TF_TOPIC:
            if message is not None:
                self._transforms.passed(message)
            return []
        with self._events.rejecting('messages on %s' % raw.topic):
            if topic == COLOR_TOPIC and self._detect is not None:
                return self._found(message, search, raw.time.to_nsec(), camera)
            return self._pipeline.take(topic, message_in(raw, INPUTS[topic]), raw.time.to_nsec(), camera)
        return []

    def _found(self, message, search, now_ns, camera):
        if search is None:
            return []
        with self._pipeline.searching():
            found = search.result()
            self._events.count('images processed')
            return self._pipeline.found(message.header, found, now_ns, camera)
        return []


def process_bag(source, target, settings=Settings(), progress=lambda share: None):
    """Write a bag with the messages of another bag and those that the nodes would publish.

    Parameters
    ----------
    source, target : str
        Paths of the input and output bags.
    settings : Settings
    progress : callable
        Called after each message with the processed fraction, 0..1.

    Returns
    -------
    event_counter.EventCounter

    Raises
    ------
    BagError
        If the source cannot be read; the target is then removed.
    ValueError
        If a parameter is invalid.
    OSError
        If the target cannot be written.
    """
    events = EventCounter()
    with BagReader(source) as reader, new_bag(target, settings.compression) as bag:
        run, copier = BagRun(reader, settings, events), Copier(bag, settings)
        start_ns, end_ns = reader.span_ns
        for raw, outputs in run.outputs():
            copier.copy(raw)
            for topic, message in outputs:
                bag.write(settings.name(topic), message, raw.time)
            progress((raw.time.to_nsec() - start_ns) / float(max(end_ns - start_ns, 1)))
    return events


class Copier(object):
    """Copy messages to another bag unchanged, except on topics that the pipeline writes."""

    def __init__(self, bag, settings):
        made = set(settings.name(topic, camera) for topic in OUTPUTS_OF_CAMERA for camera in settings.cameras
                   if topic != BOXES_TOPIC or settings.detector != 'none')
        self._bag, self._made = bag, made | set(settings.name(topic) for topic in OUTPUTS)
        self._keep, self._types = settings.keep, {}

    def copy(self, raw):
        """Write a message if it is to be kept. Raises BagError if its topic has messages of two types."""
        if raw.topic in self._made or self._keep is not None and raw.topic.lstrip('/') not in self._keep:
            return
        if self._types.setdefault(raw.topic, raw.md5sum) != raw.md5sum:
            raise BagError('%s has messages of two types' % raw.topic)
        unused = type('Unused', (), {'_md5sum': raw.md5sum})  # rosbag requires a class, but uses the connection header
        self._bag.write(raw.topic, (raw.datatype, raw.data, raw.md5sum, unused), raw.time, raw=True,
                        connection_header=raw.connection_header)


def _wanted(detector):
    """Return the input topics of a camera that are used with a detector."""
    return set(INPUTS) - {TF_TOPIC, STATIC_TOPIC} - ({COLOR_TOPIC} if detector == 'none' else {BOXES_TOPIC})
