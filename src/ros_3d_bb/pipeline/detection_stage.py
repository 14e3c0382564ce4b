"""Detection stage: 2D bounding boxes from image messages, shared by the detector nodes and process_bag."""
from typing import NamedTuple

import tf2_ros

from ros_3d_bb.camera.camera_model import transform_from
from ros_3d_bb.camera.image_rotation import (AUTO, turned_camera, turned_depth, turned_image, turned_rotation,
                                             turns_for, unturned_boxes)
from ros_3d_bb.conversions.camera_msgs import DEPTH_TOPICS
from ros_3d_bb.conversions.image_msgs import imgmsg_to_depth, imgmsg_to_rgb
from ros_3d_bb.conversions.perception_msgs import NEWEST, camera_from_msg, stamp_if_any, stamp_of
from ros_3d_bb.core.params import (DEPTH, DEPTH_SCALE, ENABLED, IMAGE_ROTATION, PUBLISH_EMPTY, STAMP_TOLERANCE, Param,
                                   parameters)
from ros_3d_bb.core.time_sync import NS, StampSynchronizer
from ros_3d_bb.detection.depth.detector import DepthPeople
from ros_3d_bb.detection.depth.ground_plane import floor_from_transform
from ros_3d_bb.pipeline.depth_registration import RAW, DepthRegistration

CACHE_NS = NS  # how long images wait for each other


@parameters()
class Yolov5NodeParams(NamedTuple):
    """Parameters of yolov5_node, except those of the network and its runtime."""

    weights: str = Param('')
    floor_frame: str = Param('base_link')
    frame_id: str = Param('')
    image_rotation: str = IMAGE_ROTATION
    enabled: bool = ENABLED
    publish_empty: bool = PUBLISH_EMPTY


@parameters()
class DepthDetectorParams(NamedTuple):
    """Parameters of depth_detector_node, except those of the detector."""

    floor_frame: str = Param('base_link')
    floor_height: float = Param(
        -0.065, 'Height of the floor in floor_frame. The default fits base_link of a Jackal.', 'm',
        limits=(-10000, 10000), live=(-1, 1))
    depth_scale: float = DEPTH_SCALE
    frame_id: str = Param('')
    depth: str = DEPTH
    image_rotation: str = IMAGE_ROTATION
    stamp_tolerance: float = STAMP_TOLERANCE
    enabled: bool = ENABLED
    publish_empty: bool = PUBLISH_EMPTY


def detect_in_color(detector, message, turns=0):
    """Return a colour image as RGB, (height, width, 3), and the Detections of a `NetworkDetector` in it.

    The detector receives the image upright, after `turns` clockwise quarter turns. Raises ValueError if the image or
    its stamp cannot be used.
    """
    stamp_of(message)
    image = imgmsg_to_rgb(message)
    return image, _as_received(detector.detect(turned_image(image, turns)), turns, image)


def _as_received(detections, turns, image):
    height, width = image.shape[:2]
    return detections._replace(boxes=unturned_boxes(detections.boxes, turns, width, height))


class CameraRotation(object):
    """Quarter turns that make the images of one camera upright, from ~image_rotation or tf.

    The transform is looked up until it is available, and not again: the camera is fixed to the robot.

    Parameters
    ----------
    params : Yolov5NodeParams
    transforms
        As for `tracking_stage.TrackingStage`. It is not used if ~image_rotation is given, or no floor frame.
    on_known : callable
        Called once no further lookups are necessary.
    """

    def __init__(self, params, transforms, on_known=lambda: None):
        self._params, self._transforms, self._on_known = params, transforms, on_known
        self._turns = None
        if params.image_rotation != AUTO or not params.floor_frame:
            self._turns = turns_for(params.image_rotation, None)
            on_known()

    def turns(self, frame_id):
        """Clockwise quarter turns of the images, whose header has this frame; 0 while they are unknown."""
        if self._turns is None:
            try:
                camera_from_floor = self._transforms.lookup(self._params.frame_id or frame_id,
                                                            self._params.floor_frame, NEWEST)
            except tf2_ros.TransformException:  # reported by the estimation stage, which needs the same transform
                return 0
            self._turns = turns_for(AUTO, camera_from_floor[:3, 2])
            self._on_known()
        return self._turns


class RgbdDetectionStage(object):
    """Pair colour images with the depth image and camera model of the same stamp, and detect people in them.

    Each `add_` method adds a message with its arrival time (integer nanoseconds, see `time_sync.StampSynchronizer`), or
    raises ValueError if it cannot be used.

    Parameters
    ----------
    params : DepthDetectorParams
    people : DepthPeopleParams
    events : event_counter.EventCounter
    on_frame : callable
        Called with two sensor_msgs/Image, colour and depth, and a `camera_model.Camera` of one stamp, for `detect`.
    transforms
        As for `tracking_stage.TrackingStage`; None if no floor frame is given and depth is aligned.
    depth_info_topic : str, optional
        Topic of the camera_info of raw depth, for the error message if it is missing.
    """

    names = ('person',)

    def __init__(self, params, people, events, on_frame, transforms, depth_info_topic=DEPTH_TOPICS[RAW][1]):
        self._params, self._events = params, events
        self._transforms = transforms if params.floor_frame else None
        self._registration = DepthRegistration(transforms, depth_info_topic) if params.depth == RAW else None
        self._detector = DepthPeople(people)
        self._sync = StampSynchronizer(CACHE_NS, int(params.stamp_tolerance * NS), 0, on_frame, self._on_lost)

    def reconfigure(self, params, people):
        """Change the parameters. If they are invalid, raise ValueError and keep the old ones."""
        self._detector.reconfigure(people)
        self._params = params

    def add_camera_info(self, message, now_ns):
        """Add a sensor_msgs/CameraInfo."""
        camera = camera_from_msg(message)
        self._sync.add_camera(stamp_if_any(message), now_ns, camera)

    def add_depth_camera_info(self, message):
        """Add a sensor_msgs/CameraInfo of the depth camera, for raw depth."""
        self._registration.add_camera_info(message)

    def add_depth(self, message, now_ns):
        """Add a depth image."""
        self._sync.add_depth(stamp_of(message), now_ns, message)

    def add_color(self, message, now_ns):
        """Add a colour image."""
        self._sync.add_boxes(stamp_of(message), now_ns, message)

    def end(self):
        """Report the colour images that still wait for their depth image. Call at the end of the input."""
        self._sync.end()

    def _on_lost(self, color_msg, of_time_before):
        if of_time_before:
            self._events.count('colour images of a time before')
            return
        stamp_ns = stamp_of(color_msg)
        reasons = ['no depth image and camera_info with the stamp %.3f of the colour image arrived' % (stamp_ns / NS),
                   self._sync.gap_text(stamp_ns), 'waiting for the next']
        self._events.warn('colour images without depth', '; '.join(filter(None, reasons)))

    def detect(self, color_msg, depth_msg, camera):
        """Return the RGB image, (height, width, 3), and the Detections in it; None while the floor is unknown.

        Raises ValueError if the images cannot be used.
        """
        image = imgmsg_to_rgb(color_msg)
        camera_frame = self._params.frame_id or color_msg.header.frame_id
        depth = imgmsg_to_depth(depth_msg, self._params.depth_scale, check_unit=True)
        if self._registration is not None:
            depth = self._registration.register(depth, depth_msg.header.frame_id, camera, camera_frame)
        floor = self._floor(camera_frame)
        turns = turns_for(self._params.image_rotation, None if floor is None else floor.normal)
        if floor is not None:
            floor = floor._replace(normal=turned_rotation(turns).dot(floor.normal))
        detections = self._detector.detect(turned_image(image, turns), turned_depth(depth, turns),
                                           turned_camera(camera, turns), floor)
        if detections is None:
            self._events.warn('images without floor', 'tf gives no floor, and none is visible in the depth image; no '
                              'detection; waiting for the next image')
            return None
        self._events.count('images processed')
        return image, _as_received(detections, turns, image)

    def _floor(self, camera_frame):
        """Return the floor plane from tf, or None if it is unknown, so that the detector fits it.

        The latest transform is used: the camera is fixed to the robot, so no wait for the image stamp is necessary.
        """
        if self._transforms is None:
            return None
        try:
            camera_from_base = self._transforms.lookup(camera_frame, self._params.floor_frame, NEWEST)
        except tf2_ros.TransformException as error:
            self._events.warn('images without transform', 'no transform from %s to %s: %s; fitting the floor to the '
                              'depth image' % (self._params.floor_frame, camera_frame, error))
            return None
        base_from_floor = transform_from((0, 0, self._params.floor_height), (0, 0, 0, 1))
        return floor_from_transform(camera_from_base.dot(base_from_floor))
