"""Run the pipeline on a bag without a ROS master. Equal input bags and parameters give identical output bags."""
import collections
import contextlib
import itertools
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, Deque, Dict, Iterator, List, NamedTuple, Optional, Set, Tuple, Union

import genpy
import numpy as np
import rosbag
from tf2_msgs.msg import TFMessage

from ros_3d_bb.bags.bag_reader import BagError, BagReader, Raw, message_in
from ros_3d_bb.bags.bag_tf_buffer import BagTransforms
from ros_3d_bb.bags.bag_writer import new_bag
from ros_3d_bb.camera.images import mounted_camera, turns_for
from ros_3d_bb.conversions.camera_msgs import (COLOR_TOPIC, DEPTH_TOPIC, IMAGE_KINDS, RAW, STATIC_TOPIC, TF_TOPIC,
                                               absolute, info_of_images)
from ros_3d_bb.conversions.perception_msgs import BOXES_TOPIC
from ros_3d_bb.core.event_counter import EventCounter
from ros_3d_bb.core.params import nearest_name
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.pipeline.camera_pose import POSE_FITTED, POSE_TEXT, CameraPoseStage
from ros_3d_bb.pipeline.detection_stage import CameraRotation, detect_in_color
from ros_3d_bb.pipeline.detectors import NONE, open_named
from ros_3d_bb.pipeline.people_pipeline import (DEPTH_INFO_TOPIC, INFO_TOPIC, INPUTS, OUTPUTS, OUTPUTS_OF_CAMERA,
                                                PeoplePipeline, Settings)

MAX_WAITING_BYTES = 2 ** 28  # messages that are read ahead
DRIVER_TF_NS = NS  # within this time from its start, a bag contains each frame of a camera driver
NOT_KEPT = 'topics to keep that are missing'  # event
UNUSED = None, ''  # topic and camera of messages that the nodes do not use


class Waiting(NamedTuple):
    """A message that was read ahead of its processing; for an image of the detector also deserialized, with the
    detection that was begun in it.
    """

    raw: Raw
    image: Any = None
    search: Optional[Future] = None


class BagRun(object):
    def __init__(self, reader: BagReader, settings: Settings, events: EventCounter) -> None:
        self._reader, self._settings, self._events = reader, settings, events
        needed = BOXES_TOPIC if settings.detector == NONE else COLOR_TOPIC
        self._ahead_ns = int(settings.tracker[0].tf_timeout * NS)
        self._topics = {settings.name(topic): (topic, '') for topic in (TF_TOPIC, STATIC_TOPIC)}
        for camera_name in settings.camera_names:
            for topic in settings.inputs - {TF_TOPIC, STATIC_TOPIC}:
                self._topics[settings.name(topic, camera_name)] = topic, camera_name
        # As in the nodes, the detector has a buffer of its own, because it is ahead of the other stages.
        self._transforms, self._detector_transforms = BagTransforms(), BagTransforms()
        self._unread_tf: Deque[Tuple[int, TFMessage]] = collections.deque()  # by time; not in the buffer yet
        self._pipeline = PeoplePipeline(settings, events, self._transforms)
        self._detector = None
        if settings.detector != NONE and not settings.uses_depth:
            params = settings.detector_params
            self._detector = open_named(events, *params)
            self._rotations = {name: CameraRotation(params[0], self._detector_transforms)
                               for name in settings.camera_names}
        for camera_name in settings.camera_names:
            reader.check_topic(settings.name(needed, camera_name), *INPUTS[needed])

    def outputs(self) -> Iterator[Tuple[genpy.Time, Optional[Raw], List[Tuple[str, Any]]]]:
        """Yield (time, Raw, [(topic, message), ...]): each message of the bag with the messages published by the nodes,
        and those at its end, with None instead of Raw."""
        static, time = self._settings.name(STATIC_TOPIC), None
        for raw in self._reader.messages([static]):
            self._add_static(raw)
        if self._settings.camera_pose is not None:
            self._set_camera_pose(self._settings.camera_pose)
        self._read_depth_cameras()
        with ThreadPoolExecutor(self._settings.searches) as pool:
            for waiting in self._ahead(pool):
                time = waiting.raw.time
                recorded_until_ns = time.to_nsec() + self._ahead_ns
                while self._unread_tf and self._unread_tf[0][0] <= recorded_until_ns:
                    self._transforms.add(self._unread_tf.popleft()[1])
                self._process(waiting)
                yield time, waiting.raw, self._pipeline.take_results()
        self._pipeline.end()
        yield time, None, self._pipeline.take_results()

    def _add_static(self, raw: Raw) -> None:
        with self._events.rejecting('transforms'):
            message = message_in(raw, TFMessage)
            self._transforms.add_static(message)
            self._detector_transforms.add_static(message)

    def _set_camera_pose(self, given: Union[str, Tuple[float, float, float]]) -> None:
        """Set the pose of the camera, which tf does not contain.

        The other frames of the bag are those of the driver, which do not move, even if it publishes them on tf.
        """
        tf_topic, ends_ns = self._settings.name(TF_TOPIC), self._reader.span_ns[0] + DRIVER_TF_NS
        for raw in itertools.takewhile(lambda raw: raw.time.to_nsec() < ends_ns, self._reader.messages([tf_topic])):
            self._add_static(raw)
        frame_id, pose = self._fitted_pose() if isinstance(given, str) else self._given_pose(given)
        for transforms in (self._transforms, self._detector_transforms) if frame_id else ():
            transforms.set_pose(self._settings.tracker[0].target_frame, frame_id, pose)

    def _given_pose(self, given: Tuple[float, float, float]) -> Tuple[str, np.ndarray]:
        """Return the frame of the 3D boxes, empty if no message has it, and its pose (4, 4) from the settings."""
        params, (height_m, tilt_rad, roll_rad) = self._settings.bbox3d[0], given
        pose = mounted_camera(height_m, tilt_rad, turns_for(params.image_rotation, None), roll_rad)
        topic = INFO_TOPIC if params.depth == RAW else DEPTH_TOPIC  # whose frame is that of the 3D boxes
        for raw in self._reader.messages([self._settings.name(topic)]):
            with contextlib.suppress(ValueError):  # reported when the message is processed
                return params.frame_id or message_in(raw, *INPUTS[topic]).header.frame_id, pose
        return '', pose

    def _fitted_pose(self) -> Tuple[str, np.ndarray]:
        """Return the frame of the depth images, and its pose (4, 4) from the floor in them. Raises ValueError."""
        params = self._settings.bbox3d[0]
        stage, depth = CameraPoseStage(params), self._settings.name(DEPTH_TOPIC)
        info_topic = DEPTH_INFO_TOPIC if params.depth == RAW else INFO_TOPIC
        info = self._settings.name(info_topic)
        for raw in self._reader.messages([info, depth]):
            with contextlib.suppress(ValueError):  # reported when the message is processed
                if raw.topic == info:
                    stage.add_camera_info(info_of_images(message_in(raw, *INPUTS[info_topic]), depth))
                else:
                    stage.add_depth(message_in(raw, *INPUTS[DEPTH_TOPIC]))
            if stage.is_complete:
                break
        floor_from_camera = stage.floor_from_camera
        if floor_from_camera is None:
            raise ValueError('no image on %s shows the floor, to which --camera-pose fits the pose of the camera; give '
                             'it with --camera-height, --camera-tilt and --camera-roll' % depth)
        self._events.note(POSE_FITTED, POSE_TEXT % stage.pose)
        return stage.frame_id, floor_from_camera

    def _read_depth_cameras(self) -> None:
        """Pass the first camera_info of raw depth to the pipeline, which needs it for the first image."""
        for name, (topic, camera_name) in self._topics.items():
            raw = next(self._reader.messages([name]), None) if topic == DEPTH_INFO_TOPIC else None
            if raw is not None:
                with self._events.rejecting('messages on %s' % name):
                    self._pipeline.take(topic, message_in(raw, *INPUTS[topic]), raw.time.to_nsec(), camera_name)

    def _ahead(self, pool: ThreadPoolExecutor) -> Iterator[Waiting]:
        """Yield the messages with a delay, to read transforms within ~tf_timeout and images for the detector ahead."""
        queue: Deque[Waiting] = collections.deque()
        size, searches = 0, 0
        for raw in self._reader.messages():
            queue.append(self._begun(raw, pool))
            size, searches = size + len(raw.data), searches + (queue[-1].search is not None)
            while queue and (size > MAX_WAITING_BYTES or (
                    raw.time.to_nsec() - queue[0].raw.time.to_nsec() > self._ahead_ns
                    and (self._detector is None or searches > 2 * self._settings.searches))):
                waiting = queue.popleft()
                size, searches = size - len(waiting.raw.data), searches - (waiting.search is not None)
                yield waiting
        while queue:
            yield queue.popleft()

    def _begun(self, raw: Raw, pool: ThreadPoolExecutor) -> Waiting:
        """Start the work that can be done ahead of a message's processing: read transforms, submit detections."""
        topic, camera_name = self._topics.get(raw.topic, UNUSED)
        if topic == TF_TOPIC:
            with self._events.rejecting('transforms'):
                message = message_in(raw, TFMessage)
                self._detector_transforms.add(message)
                self._unread_tf.append((raw.time.to_nsec(), message))
        elif topic == COLOR_TOPIC and self._detector is not None:
            with self._events.rejecting('images'):
                image = message_in(raw, *IMAGE_KINDS)
                turns = self._rotations[camera_name].turns(image.header.frame_id)
                return Waiting(raw, image, pool.submit(detect_in_color, self._detector, image, turns))
        return Waiting(raw)

    def _process(self, waiting: Waiting) -> None:
        raw, image, search = waiting
        topic, camera_name = self._topics.get(raw.topic, UNUSED)
        if topic in (None, STATIC_TOPIC):
            return
        now_ns = raw.time.to_nsec()
        self._events.count('messages on %s' % raw.topic)
        if search is not None and self._detector is not None:
            with self._pipeline.detecting():
                pixels, found = search.result()
                self._events.count('images processed')
                self._pipeline.add_detections(image.header, pixels, found, self._detector.names, now_ns, camera_name)
        elif topic != TF_TOPIC and (topic != COLOR_TOPIC or self._detector is None):
            with self._events.rejecting('messages on %s' % raw.topic):
                self._pipeline.take(topic, message_in(raw, *INPUTS[topic]), now_ns, camera_name)


def process_bag(source: str, target: str, settings: Settings = Settings()) -> EventCounter:
    """Write a bag with the messages of another bag and those that the nodes would publish. Returns an EventCounter.

    Raises BagError if the source cannot be read, ValueError if a parameter is invalid, and OSError if the target cannot
    be written; no target remains then.
    """
    events, made = EventCounter(), _outputs_of(settings)
    types: Dict[str, str] = {}
    with BagReader(source) as reader, new_bag(target, settings.compression) as bag:
        run = BagRun(reader, settings, events)
        for topic in settings.keep or ():
            if absolute(topic) not in made.union(reader.topics):
                events.note(NOT_KEPT, 'the bag has no topic /%s; did you mean %s?'
                            % (topic, nearest_name(topic, reader.topics)))
        for time, raw, outputs in run.outputs():
            if raw and raw.topic not in made and (settings.keep is None or raw.topic.lstrip('/') in settings.keep):
                if types.setdefault(raw.topic, raw.md5sum) != raw.md5sum:
                    raise BagError('%s has messages of two types' % raw.topic)
                _copy(raw, bag)
            for topic, message in outputs:
                bag.write(settings.name(topic), message, time)
    return events


def _outputs_of(settings: Settings) -> Set[str]:
    made = set(settings.name(topic) for topic in OUTPUTS)
    made.update(settings.name(topic, name) for topic in OUTPUTS_OF_CAMERA for name in settings.camera_names
                if topic != BOXES_TOPIC or settings.detector != NONE)
    return made


def _copy(raw: Raw, bag: rosbag.Bag) -> None:
    unused = type('Unused', (), {'_md5sum': raw.md5sum})  # rosbag requires a class, but uses the connection header
    bag.write(raw.topic, (raw.datatype, raw.data, raw.md5sum, unused), raw.time, raw=True,
              connection_header=raw.connection_header)
