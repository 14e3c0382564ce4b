"""Detection, estimation and tracking of the messages of a bag, as the nodes do it."""
import contextlib
import functools
from typing import NamedTuple, Optional, Tuple, Union

from sensor_msgs.msg import CameraInfo
from std_msgs.msg import Int32MultiArray
from tf2_msgs.msg import TFMessage

from ros_3d_bb.conversions.camera_msgs import (COLOR_INFO_IMAGES, COLOR_TOPIC, DEPTH_TOPIC, DEPTH_TOPICS, IMAGE_KINDS,
                                               INFO_TOPICS, RAW, STATIC_TOPIC, TF_TOPIC, absolute, info_of_images,
                                               topic_of)
from ros_3d_bb.conversions.perception_msgs import (BOXES3D_TOPIC, BOXES_TOPIC, TRACKS_TOPIC, detections2d_to_msg,
                                                   tracks_to_msg)
from ros_3d_bb.core.error_text import cause
from ros_3d_bb.detection.depth.person_clusters import DepthPeopleParams
from ros_3d_bb.detection.network_detector import DetectionParams
from ros_3d_bb.detection.yolov5.backends import RuntimeParams
from ros_3d_bb.pipeline.camera_pipeline import CameraPipeline
from ros_3d_bb.pipeline.detection_stage import DepthDetectionStage, DepthDetectorParams, Yolov5NodeParams
from ros_3d_bb.pipeline.estimation_stage import Bbox3dParams, EstimationStage
from ros_3d_bb.pipeline.rgbd_source import RgbdSource
from ros_3d_bb.pipeline.tracking_stage import TRACKING_PARAMS, TrackerNodeParams, TrackingStage
from ros_3d_bb.visualization.markers import MARKERS_TOPIC, MarkerParams, MarkerWriter

INFO_TOPIC, DEPTH_INFO_TOPIC = INFO_TOPICS
INPUTS = {COLOR_TOPIC: IMAGE_KINDS, DEPTH_TOPIC: IMAGE_KINDS, INFO_TOPIC: (CameraInfo,),
          DEPTH_INFO_TOPIC: (CameraInfo,), BOXES_TOPIC: (Int32MultiArray,), TF_TOPIC: (TFMessage,),
          STATIC_TOPIC: (TFMessage,)}
OUTPUTS_OF_CAMERA, OUTPUTS = (BOXES_TOPIC, BOXES3D_TOPIC), (TRACKS_TOPIC, MARKERS_TOPIC)
DETECTORS = 'yolov5', 'depth', 'none'
TRACKED = 'images with tracks'  # event


class Settings(NamedTuple):
    """Detector, parameters of each node, and topics; for bags also concurrent searches and compression.

    `names` maps topics of the nodes to those used; `keep` lists the topics to copy (None: all). `camera_pose` is the
    height, metres, tilt and roll, radians, of a camera without tf (see `images.mounted_camera`), or
    `camera_pose.FLOOR`, if they are fitted to the floor.
    """

    detector: str = 'yolov5'
    yolov5: tuple = (Yolov5NodeParams(), DetectionParams(), RuntimeParams(device='cpu', threads=1))
    depth: tuple = (DepthDetectorParams(), DepthPeopleParams())
    bbox3d: tuple = (Bbox3dParams(),)
    tracker: tuple = (TrackerNodeParams(), MarkerParams()) + tuple(kind() for kind in TRACKING_PARAMS)
    names: dict = {}
    keep: Optional[Tuple[str, ...]] = None
    searches: int = 1
    compression: str = 'lz4'
    camera_pose: Union[str, Tuple[float, float, float], None] = None

    @property
    def inputs(self):
        """The topics of `INPUTS` that are used."""
        unused = {COLOR_TOPIC if self.detector == 'none' else BOXES_TOPIC}
        if self.bbox3d[0].depth != RAW:
            unused.add(DEPTH_INFO_TOPIC)
        return set(INPUTS) - unused

    @property
    def camera_names(self):
        """Namespaces of the cameras; '' for a single camera."""
        return tuple(self.tracker[0].cameras) or ('',)

    def name(self, topic, camera_name=''):
        """Return the name that is used for a topic of a camera's nodes."""
        if topic in (DEPTH_TOPIC, DEPTH_INFO_TOPIC):
            topic = DEPTH_TOPICS[self.bbox3d[0].depth][topic == DEPTH_INFO_TOPIC]
        topic = topic_of(camera_name, topic)
        return absolute(self.names.get(topic, topic))

    def source(self, camera_name, events, on_match, transforms):
        """Return the RgbdSource of a camera for detection and estimation. ValueError if their parameters differ."""
        params = self.bbox3d[0]
        if self.detector == 'depth':
            check_equal(self.depth[0], params)
        topics = [self.name(topic, camera_name) for topic in (DEPTH_TOPIC, DEPTH_INFO_TOPIC, INFO_TOPIC)]
        return RgbdSource(params, events, on_match, transforms, topics, params.cache_length, params.assumed_delay)


def check_equal(detector_params, bbox3d_params):
    """Raise ValueError if parameters of depth_detector_node and bbox3d_node that both have differ."""
    for name in set(detector_params._fields).intersection(bbox3d_params._fields):
        values = getattr(detector_params, name), getattr(bbox3d_params, name)
        if values[0] != values[1]:
            raise ValueError('parameter ~%s is %r for depth_detector_node and %r for bbox3d_node; equal values '
                             'expected, because both use the same images' % ((name,) + values))


class PeoplePipeline(object):
    """The CameraPipeline of each camera, and tracking, on a bag. Collects what the nodes would publish.

    Networks detect without depth and are therefore outside: their detections are passed to `add_detections`.
    `transforms` is as for `tracking_stage.TrackingStage`. Raises ValueError if one of the Settings is invalid.
    """

    def __init__(self, settings, events, transforms):
        self._settings, self._events, self._results = settings, events, []
        self._publish_empty = (settings.depth if settings.detector == 'depth' else settings.yolov5)[0].publish_empty
        tracker_params, marker_params, *tracking = settings.tracker
        self._markers = MarkerWriter(marker_params)
        self._tracking_stage = TrackingStage(tracker_params, tracking, events, transforms, self._on_tracks)
        self._cameras = {}
        for camera_name in settings.camera_names:
            pipeline = self._cameras[camera_name] = CameraPipeline()
            pipeline.source = settings.source(camera_name, events, pipeline.on_match, transforms)
            pipeline.connect_estimator(EstimationStage(settings.bbox3d[0], events), events,
                                       functools.partial(self._on_boxes3d, camera_name))
            if settings.detector == 'depth':
                pipeline.connect_detector(DepthDetectionStage(*settings.depth, events),
                                          functools.partial(self._detect, camera_name))
        self._now_ns = 0  # time of the message that is being processed

    def take(self, topic, message, now_ns, camera_name=''):
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

    def add_detections(self, header, image, detections, names, now_ns, camera_name=''):
        """Process the Detections in a received colour image (height, width, 3) with the given header; `names` are those
        of the classes."""
        self._now_ns = now_ns
        message = self._boxes2d(camera_name, header, image, detections, names)
        if message is not None:
            self._cameras[camera_name].source.add_boxes(message, now_ns, image)

    def take_results(self):
        """Return the messages that the nodes would have published since the last call, [(topic, message), ...]."""
        results, self._results = self._results, []
        return results

    @contextlib.contextmanager
    def detecting(self):
        """Context manager for the detection in one image. Exceptions are reported and do not stop the pipeline."""
        try:
            with self._events.rejecting('images'):
                yield
        except Exception as error:  # as in the worker threads of the nodes
            self._events.warn('detections failed', 'the detector failed: %s; waiting for the next image' % cause(error))

    def end(self):
        """Report inputs that are still waiting for others. Call at the end of the input."""
        for pipeline in self._cameras.values():
            pipeline.source.end()

    def _detect(self, camera_name, color_msg, *matched):
        with self.detecting():
            detected = self._cameras[camera_name].detect(color_msg, *matched)
            if detected is None:
                return
            image, detections, *shown = detected
            message = self._boxes2d(camera_name, color_msg.header, image, detections, DepthDetectionStage.names)
            if message is not None:
                self._cameras[camera_name].estimate(message, *shown)

    def _boxes2d(self, camera_name, header, image, detections, names):
        """Return the message of Detections, None if it is not published."""
        if not len(detections.boxes) and not self._publish_empty:
            return None
        message = detections2d_to_msg(detections, names, header, image.shape[1::-1])
        self._results.append((topic_of(camera_name, BOXES_TOPIC), message))
        return message

    def _on_boxes3d(self, camera_name, message, _boxes3d, _frame, depth_msg):
        self._results.append((topic_of(camera_name, BOXES3D_TOPIC), message))
        if self._settings.tracker[0].use_depth:
            self._tracking_stage.views[camera_name].add_depth(depth_msg, self._now_ns)
        with self._events.rejecting('3D boxes'):
            self._tracking_stage.add_boxes(message, self._now_ns, camera_name)

    def _on_tracks(self, tracks, header):
        if tracks:
            self._events.count(TRACKED)
        self._markers.views_m = self._tracking_stage.views_m
        self._results += [(TRACKS_TOPIC, tracks_to_msg(tracks, header)),
                          (MARKERS_TOPIC, self._markers.write(tracks, header))]
