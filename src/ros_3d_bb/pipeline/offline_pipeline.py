"""Offline pipeline: detection, estimation and tracking in one object, driven message by message without ROS."""
import contextlib
import functools
from typing import NamedTuple, Optional, Tuple

from sensor_msgs.msg import CameraInfo
from std_msgs.msg import Int32MultiArray
from tf2_msgs.msg import TFMessage

from ros_3d_bb.conversions.camera_msgs import (COLOR_INFO_IMAGES, COLOR_TOPIC, DEPTH_TOPIC, DEPTH_TOPICS,
                                               IMAGE_KINDS, INFO_TOPICS,
                                               STATIC_TOPIC, TF_TOPIC, info_of_images, topic_of, uncompressed)
from ros_3d_bb.conversions.perception_msgs import (BOXES3D_TOPIC, BOXES_TOPIC, TRACKS_TOPIC, boxes3d_to_msg,
                                                   detections2d_to_msg, tracks_to_msg)
from ros_3d_bb.core.error_text import cause
from ros_3d_bb.detection.depth.person_clusters import DepthPeopleParams
from ros_3d_bb.detection.network_detector import DetectionParams
from ros_3d_bb.detection.yolov5.backends import RuntimeParams
from ros_3d_bb.pipeline.depth_registration import RAW
from ros_3d_bb.pipeline.detection_stage import DepthDetectorParams, RgbdDetectionStage, Yolov5NodeParams
from ros_3d_bb.pipeline.estimation_stage import Bbox3dParams, EstimationStage
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
    """Settings for processing bags: detector, parameters of each node, topics, concurrent searches, and compression.

    `names` maps topics of the nodes to topics of the bag; `keep` lists the topics to copy (None: all). `camera_pose` is
    the height, metres, tilt and roll, radians, of a camera without tf (see `image_rotation.mounted_camera`).
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
    camera_pose: Optional[Tuple[float, float, float]] = None

    @property
    def inputs(self):
        """The topics of `INPUTS` that are used."""
        unused = {COLOR_TOPIC if self.detector == 'none' else BOXES_TOPIC}
        if self.bbox3d[0].depth != RAW:
            unused.add(DEPTH_INFO_TOPIC)
        return set(INPUTS) - unused

    @property
    def cameras(self):
        """Namespaces of the cameras; '' for a single camera."""
        return tuple(self.tracker[0].cameras) or ('',)

    def name(self, topic, camera=''):
        """Return the name in the bag of a topic of a camera's nodes."""
        if topic in (DEPTH_TOPIC, DEPTH_INFO_TOPIC):
            topic = DEPTH_TOPICS[self.bbox3d[0].depth][topic == DEPTH_INFO_TOPIC]
        topic = topic_of(camera, topic)
        return '/' + self.names.get(topic, topic).lstrip('/')


class Pipeline(object):
    """Detection and estimation stages of each camera and one tracking stage.

    `take` accepts a message and returns the messages that the nodes would publish. Raises ValueError if a parameter is
    invalid.
    """

    def __init__(self, settings, events, transforms):
        self._settings, self._events = settings, events
        tracker_params, marker_params, *tracking = settings.tracker
        self._tracking_stage = TrackingStage(tracker_params, tracking, events, transforms, self._on_tracks)
        self._markers = MarkerWriter(marker_params)
        self._estimation_stages, self._detection_stages = {}, {}
        for camera in settings.cameras:
            self._estimation_stages[camera] = EstimationStage(
                settings.bbox3d[0], events, functools.partial(self._on_frame, camera),
                transforms, [settings.name(topic, camera) for topic in (DEPTH_TOPIC, DEPTH_INFO_TOPIC, INFO_TOPIC)])
        self._publish_empty = settings.yolov5[0].publish_empty
        if settings.detector == 'depth':
            params, people = settings.depth
            self._publish_empty = params.publish_empty
            for camera in settings.cameras:
                self._detection_stages[camera] = RgbdDetectionStage(
                    params, people, events, functools.partial(self._on_images, camera), transforms,
                    settings.name(DEPTH_INFO_TOPIC, camera))
        self._now_ns, self._outputs = 0, []  # time and outputs of the message that is being processed

    def take(self, topic, message, now_ns, camera=''):
        """Process a message recorded at `now_ns` on an input topic of the nodes. Returns [(topic, message), ...]."""
        self._now_ns, self._outputs = now_ns, []
        stages = [stages[camera] for stages in (self._detection_stages, self._estimation_stages) if camera in stages]
        if topic in INFO_TOPICS:
            images = COLOR_INFO_IMAGES[self._settings.bbox3d[0].depth] if topic == INFO_TOPIC else DEPTH_TOPIC
            message = info_of_images(message, self._settings.name(images, camera))
        if topic == INFO_TOPIC:
            if self._tracking_stage.uses_camera_info:
                self._tracking_stage.add_camera_info(message, camera)
            for stage in stages:
                stage.add_camera_info(message, now_ns)
        elif topic == DEPTH_INFO_TOPIC:
            if self._tracking_stage.uses_depth:
                self._tracking_stage.add_depth_camera_info(message, camera)
            for stage in stages:
                stage.add_depth_camera_info(message)
        elif topic == DEPTH_TOPIC:
            message = uncompressed(message)  # once for all stages
            if self._tracking_stage.uses_depth:
                self._tracking_stage.add_depth(message, now_ns, camera)
            for stage in stages:
                stage.add_depth(message, now_ns)
        elif topic == COLOR_TOPIC:
            self._detection_stages[camera].add_color(message, now_ns)
        else:
            self._estimation_stages[camera].add_boxes(message, now_ns)
        return self._outputs

    def found(self, header, found, names, now_ns, camera=''):
        """Process the detections of an image with the given header, given the class names. Returns as `take`."""
        self._now_ns, self._outputs = now_ns, []
        self._on_detections(camera, header, found, names)
        return self._outputs

    @contextlib.contextmanager
    def searching(self):
        """Context manager for the detection in one image. Exceptions are reported and do not stop the pipeline."""
        try:
            with self._events.rejecting('images'):
                yield
        except Exception as error:  # as in the worker threads of the nodes
            self._events.warn('detections failed', 'the detector failed: %s; waiting for the next image' % cause(error))

    def end(self):
        """Report inputs that are still waiting for others. Call at the end of the input."""
        for stage in [*self._detection_stages.values(), *self._estimation_stages.values()]:
            stage.end()

    def _on_images(self, camera, color_msg, depth_msg, camera_model):
        """Detect people in the images of one stamp, as depth_detector_node does."""
        with self.searching():
            found = self._detection_stages[camera].detect(color_msg, depth_msg, camera_model)
            if found is not None:
                _image, detections = found
                self._on_detections(camera, color_msg.header, detections, RgbdDetectionStage.names)

    def _on_detections(self, camera, header, detections, names):
        """Output 2D boxes, as the detector nodes do."""
        if not len(detections.boxes) and not self._publish_empty:
            return
        message = detections2d_to_msg(detections, names, header)
        self._outputs.append((topic_of(camera, BOXES_TOPIC), message))
        self._estimation_stages[camera].add_boxes(message, self._now_ns)

    def _on_frame(self, camera, boxes2d, depth_msg, camera_model):
        """Output the 3D boxes of one image, as bbox3d_node does, and track them."""
        with self._events.rejecting('2D boxes'):
            header, _depth, boxes3d = self._estimation_stages[camera].estimate(boxes2d, depth_msg, camera_model)
            message = boxes3d_to_msg(boxes3d, header, camera_model)
            self._outputs.append((topic_of(camera, BOXES3D_TOPIC), message))
            with self._events.rejecting('3D boxes'):
                self._tracking_stage.add_boxes(message, self._now_ns, camera)

    def _on_tracks(self, tracks, header):
        """Output tracks and markers, as tracker_node does."""
        self._events.count_all({TRACKED: 1} if tracks else {})
        self._outputs += [(TRACKS_TOPIC, tracks_to_msg(tracks, header)),
                          (MARKERS_TOPIC, self._markers.write(tracks, header))]
