"""Detection, estimation and tracking of the messages of a bag, as the nodes do it."""
import contextlib
import functools
from typing import Any, Dict, Iterator, List, NamedTuple, Optional, Sequence, Set, Tuple, Union

import numpy as np
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header, Int32MultiArray
from tf2_msgs.msg import TFMessage

from ros_3d_bb.camera.images import RgbdFrame
from ros_3d_bb.conversions.camera_msgs import (COLOR_INFO_IMAGES, COLOR_TOPIC, DEPTH_TOPIC, DEPTH_TOPICS, IMAGE_KINDS,
                                               INFO_TOPICS, RAW, STATIC_TOPIC, TF_TOPIC, absolute, info_of_images,
                                               topic_of)
from ros_3d_bb.conversions.perception_msgs import (BOXES3D_TOPIC, BOXES_TOPIC, TRACKS_TOPIC, detections2d_to_msg,
                                                   tracks_to_msg)
from ros_3d_bb.core.error_text import cause
from ros_3d_bb.core.event_counter import EventCounter
from ros_3d_bb.detection.boxes import Detections
from ros_3d_bb.detection.detector import DetectorParams
from ros_3d_bb.estimation.box3d import Box3D
from ros_3d_bb.pipeline.camera_pipeline import CameraPipeline
from ros_3d_bb.pipeline.detectors import NONE, open_named, row_named
from ros_3d_bb.pipeline.estimation_stage import Bbox3dParams, EstimationStage
from ros_3d_bb.pipeline.rgbd_source import OnMatch, RgbdSource
from ros_3d_bb.pipeline.tracking_stage import TrackerNodeParams, TrackingStage
from ros_3d_bb.pipeline.transform_buffer import TransformBuffer
from ros_3d_bb.tracking.measurement_model import NoiseParams
from ros_3d_bb.tracking.prediction import PredictionParams
from ros_3d_bb.tracking.tracker import TrackerParams
from ros_3d_bb.tracking.types import TrackedObject
from ros_3d_bb.visualization.markers import MARKERS_TOPIC, MarkerParams, MarkerWriter

INFO_TOPIC, DEPTH_INFO_TOPIC = INFO_TOPICS
INPUTS = {COLOR_TOPIC: IMAGE_KINDS, DEPTH_TOPIC: IMAGE_KINDS, INFO_TOPIC: (CameraInfo,),
          DEPTH_INFO_TOPIC: (CameraInfo,), BOXES_TOPIC: (Int32MultiArray,), TF_TOPIC: (TFMessage,),
          STATIC_TOPIC: (TFMessage,)}
OUTPUTS_OF_CAMERA, OUTPUTS = (BOXES_TOPIC, BOXES3D_TOPIC), (TRACKS_TOPIC, MARKERS_TOPIC)
TRACKED = 'images with tracks'  # event


class Settings(NamedTuple):
    """Detector, parameters of each node, and topics; for bags also concurrent searches and compression.

    `detection` has the DetectorParams and those of the detector; the defaults if it is empty.
    `names` maps topics of the nodes to those used; `keep` lists the topics to copy (None: all). `camera_pose` is the
    height, metres, tilt and roll, radians, of a camera without tf (see `images.mounted_camera`), or
    `camera_pose.FLOOR`, if they are fitted to the floor.
    """

    detector: str = 'yolov5'
    detection: Tuple[Any, ...] = ()
    bbox3d: Tuple[Bbox3dParams] = (Bbox3dParams(),)
    tracker: Tuple[TrackerNodeParams, MarkerParams, TrackerParams, NoiseParams, PredictionParams] = (
        TrackerNodeParams(), MarkerParams(), TrackerParams(), NoiseParams(), PredictionParams())
    names: Dict[str, str] = {}
    keep: Optional[Tuple[str, ...]] = None
    searches: int = 1
    compression: str = 'lz4'
    camera_pose: Union[str, Tuple[float, float, float], None] = None

    @property
    def inputs(self) -> Set[str]:
        unused = {COLOR_TOPIC if self.detector == NONE else BOXES_TOPIC}
        if self.bbox3d[0].depth != RAW:
            unused.add(DEPTH_INFO_TOPIC)
        return set(INPUTS) - unused

    @property
    def detector_params(self) -> Tuple[Any, ...]:
        """The parameters of the detector. Raises ValueError if it is unknown."""
        if self.detection or self.detector == NONE:
            return self.detection or (DetectorParams(NONE),)
        return row_named(self.detector).defaults(self.detector)

    @property
    def uses_depth(self) -> bool:
        return self.detector != NONE and row_named(self.detector).uses_depth

    @property
    def camera_names(self) -> Tuple[str, ...]:
        """Namespaces of the cameras; '' for a single camera."""
        return tuple(self.tracker[0].cameras) or ('',)

    def name(self, topic: str, camera_name: str = '') -> str:
        """Return the name that is used for a topic of a camera's nodes."""
        if topic in (DEPTH_TOPIC, DEPTH_INFO_TOPIC):
            topic = DEPTH_TOPICS[self.bbox3d[0].depth][topic == DEPTH_INFO_TOPIC]
        topic = topic_of(camera_name, topic)
        return absolute(self.names.get(topic, topic))

    def source(self, camera_name: str, events: EventCounter, transforms: TransformBuffer,
               on_match: OnMatch) -> RgbdSource:
        """Return the RgbdSource of a camera for detection and estimation. ValueError if their parameters differ."""
        params = self.bbox3d[0]
        if self.uses_depth:
            check_equal(self.detector_params[0], params)
        topics = [self.name(topic, camera_name) for topic in (DEPTH_TOPIC, DEPTH_INFO_TOPIC, INFO_TOPIC)]
        return RgbdSource(params, events, on_match, transforms, topics, params.cache_length, params.assumed_delay)


def check_equal(detector_params: Any, bbox3d_params: Bbox3dParams) -> None:
    """Raise ValueError if parameters of detector_node and bbox3d_node that both have differ."""
    for name in set(detector_params._fields).intersection(bbox3d_params._fields):
        values = getattr(detector_params, name), getattr(bbox3d_params, name)
        if values[0] != values[1]:
            raise ValueError('parameter ~%s is %r for detector_node and %r for bbox3d_node; equal values expected, '
                             'because both use the same images' % ((name,) + values))


class PeoplePipeline(object):
    """The CameraPipeline of each camera, and tracking, on a bag. Collects what the nodes would publish.

    Detectors of colour images are outside: their detections are passed to `add_detections`.
    Raises ValueError if one of the Settings is invalid.
    """

    def __init__(self, settings: Settings, events: EventCounter, transforms: TransformBuffer) -> None:
        self._settings, self._events = settings, events
        self._results: List[Tuple[str, Any]] = []
        self._publish_empty = settings.detector_params[0].publish_empty
        tracker_params, marker_params = settings.tracker[:2]
        self._markers = MarkerWriter(marker_params)
        self._tracking_stage = TrackingStage(tracker_params, settings.tracker[2:], events, transforms, self._on_tracks)
        self._cameras = {}
        for camera_name in settings.camera_names:
            source_for = functools.partial(settings.source, camera_name, events, transforms)
            pipeline = self._cameras[camera_name] = CameraPipeline(source_for)
            pipeline.connect_estimator(EstimationStage(settings.bbox3d[0], events).estimate, events,
                                       functools.partial(self._on_boxes3d, camera_name))
            if settings.uses_depth:
                detector = open_named(events, *settings.detector_params)
                pipeline.connect_detector(detector.detect, functools.partial(self._detect, camera_name, detector.names))
        self._now_ns = 0  # time of the message that is being processed

    def take(self, topic: str, message: Any, now_ns: int, camera_name: str = '') -> None:
        """Process a message on one of the `INPUTS` except tf, which arrived at `now_ns`. Raises ValueError."""
        self._now_ns = now_ns
        source, views = self._cameras[camera_name].source, self._tracking_stage.views[camera_name]
        if topic in INFO_TOPICS:
            images = COLOR_INFO_IMAGES[self._settings.bbox3d[0].depth] if topic == INFO_TOPIC else DEPTH_TOPIC
            message = info_of_images(message, self._settings.name(images, camera_name))
        if topic == INFO_TOPIC:
            views.add_camera_info(message)
            source.add_camera_info(message, now_ns)
        elif topic == DEPTH_INFO_TOPIC:
            if self._settings.tracker[0].use_depth:
                views.add_depth_camera_info(message)
            source.add_depth_camera_info(message, now_ns)
        elif topic == DEPTH_TOPIC:
            source.add_depth(message, now_ns)
        elif topic == COLOR_TOPIC:
            source.add_color(message, now_ns)
        else:
            source.add_boxes(message, now_ns)

    def add_detections(self, header: Header, image: np.ndarray, detections: Detections, names: Sequence[str],
                       now_ns: int, camera_name: str = '') -> None:
        """Process the Detections in a received colour image (height, width, 3) with the given header; `names` are those
        of the classes."""
        self._now_ns = now_ns
        message = self._boxes2d(camera_name, header, image, detections, names)
        if message is not None:
            self._cameras[camera_name].source.add_boxes(message, now_ns, image)

    def take_results(self) -> List[Tuple[str, Any]]:
        """Return the messages that the nodes would have published since the last call, [(topic, message), ...]."""
        results, self._results = self._results, []
        return results

    @contextlib.contextmanager
    def detecting(self) -> Iterator[None]:
        """Context manager for the detection in one image. Exceptions are reported and do not stop the pipeline."""
        try:
            with self._events.rejecting('images'):
                yield
        except Exception as error:  # as in the worker threads of the nodes
            self._events.warn('detections failed', 'the detector failed: %s; waiting for the next image' % cause(error))

    def end(self) -> None:
        """Report inputs that are still waiting for others. Call at the end of the input."""
        for pipeline in self._cameras.values():
            pipeline.source.end()

    def _detect(self, camera_name: str, names: Sequence[str], color_msg: Image, *matched: Any) -> None:
        with self.detecting():
            detected = self._cameras[camera_name].detect(color_msg, *matched)
            if detected is None:
                return
            self._events.count('images processed')
            image, detections, *shown = detected
            message = self._boxes2d(camera_name, color_msg.header, image, detections, names)
            if message is not None:
                self._cameras[camera_name].estimate(message, *shown)

    def _boxes2d(self, camera_name: str, header: Header, image: np.ndarray, detections: Detections,
                 names: Sequence[str]) -> Optional[Int32MultiArray]:
        if not len(detections.boxes) and not self._publish_empty:
            return None
        message = detections2d_to_msg(detections, names, header, image.shape[1::-1])
        self._results.append((topic_of(camera_name, BOXES_TOPIC), message))
        return message

    def _on_boxes3d(self, camera_name: str, message: Any, _boxes3d: List[Box3D], _frame: RgbdFrame,
                    depth_msg: Image) -> None:
        self._results.append((topic_of(camera_name, BOXES3D_TOPIC), message))
        if self._settings.tracker[0].use_depth:
            self._tracking_stage.views[camera_name].add_depth(depth_msg, self._now_ns)
        with self._events.rejecting('3D boxes'):
            self._tracking_stage.add_boxes(message, self._now_ns, camera_name)

    def _on_tracks(self, tracks: List[TrackedObject], header: Header) -> None:
        if tracks:
            self._events.count(TRACKED)
        self._markers.views_m = self._tracking_stage.views_m
        self._results += [(TRACKS_TOPIC, tracks_to_msg(tracks, header)),
                          (MARKERS_TOPIC, self._markers.write(tracks, header))]
