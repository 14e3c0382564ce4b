"""Source of the frames of one RGB-D camera: pairs its messages by stamp, and registers and turns the images."""
from typing import Any, Callable, List, Optional, Sequence, Tuple, Union

import numpy as np
import tf2_ros
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Int32MultiArray

from ros_3d_bb.camera.alignment import ALIGN, info_size_fault, size_fault
from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.camera.images import DepthImage, RgbdFrame, turns_for
from ros_3d_bb.camera.registration import RegisteredDepth
from ros_3d_bb.conversions.camera_msgs import DEPTH_TOPICS, INFO_TOPICS, RAW
from ros_3d_bb.conversions.image_msgs import imgmsg_to_depth, imgmsg_to_rgb
from ros_3d_bb.conversions.perception_msgs import boxes2d_from_msg, camera_from_msg, stamp_if_any, stamp_of
from ros_3d_bb.core.boxes2d import Boxes2D
from ros_3d_bb.core.event_counter import EventCounter
from ros_3d_bb.core.time_sync import NS, RECENT, StampSynchronizer, Stamped, half_period_of
from ros_3d_bb.pipeline.depth_registration import DepthRegistration
from ros_3d_bb.pipeline.transform_buffer import TransformBuffer, upright_transform

Trigger = Union[Boxes2D, Image]  # what is paired with depth
OnMatch = Callable[[Trigger, Image, Camera], Any]
UNSTAMPED = '2D boxes without a stamp'  # event, reported once
USED = 'images with a used depth image'  # counter
TILT_UNKNOWN = 'tilt of the camera unknown'  # event, reported once
TILT_FROM_ROOT = 'tilt of the camera from the root of tf'  # event, reported once


class RgbdSource(object):
    """Pairs colour images or 2D boxes with the depth image and camera_info of their stamp, and makes frames of them.

    Each `add_` method validates a message, raising ValueError, and adds it with its arrival time (integer nanoseconds,
    see `time_sync.StampSynchronizer`). `on_match` is called with the arguments of `frame` when the messages of one
    stamp are complete.

    `params` has ~depth, ~depth_scale, ~stamp_tolerance, ~frame_id, ~floor_frame and ~image_rotation. `transforms` are
    for the floor and raw depth. `topics` are those of the depth images, their camera_info and that of colour, for error
    messages about missing ones. `cache_s` and `assumed_delay_s` are for the StampSynchronizer.
    """

    def __init__(self, params: Any, events: EventCounter, on_match: OnMatch,
                 transforms: Optional[TransformBuffer] = None,
                 topics: Sequence[str] = DEPTH_TOPICS['aligned'] + INFO_TOPICS[:1], cache_s: float = 1.0,
                 assumed_delay_s: float = 0.0) -> None:
        self._params, self._events, self._transforms = params, events, transforms or TransformBuffer()
        self._depth_topic, depth_info_topic, self._info_topic = topics
        self._registration = DepthRegistration(self._transforms, depth_info_topic)
        self._color_frame, self._cache_s = '', cache_s
        self._sync = StampSynchronizer(int(cache_s * NS), int(params.stamp_tolerance * NS), int(assumed_delay_s * NS),
                                       self._on_frame, self._on_lost)
        self._on_match, self._used_ns = on_match, 0
        self._recent_ns: List[int] = []
        self._held: Optional[Tuple[Stamped, Stamped, Camera]] = None

    def set_assumed_delay(self, delay_s: float) -> None:
        self._sync.assumed_delay_ns = int(delay_s * NS)

    def add_camera_info(self, message: CameraInfo, now_ns: int) -> None:
        camera = camera_from_msg(message)
        self._color_frame = message.header.frame_id
        self._sync.add_camera(stamp_if_any(message), now_ns, camera)

    def add_depth_camera_info(self, message: CameraInfo, _now_ns: int) -> None:
        self._registration.add_camera_info(message)

    def add_depth(self, message: Image, now_ns: int) -> None:
        self._sync.add_depth(stamp_of(message), now_ns, message)

    def add_color(self, message: Image, now_ns: int) -> None:
        self._sync.add_boxes(stamp_of(message), now_ns, message)

    def add_boxes(self, message: Int32MultiArray, now_ns: int, color: Optional[np.ndarray] = None) -> None:
        """Add 2D boxes, a std_msgs/Int32MultiArray, with their image, RGB (height, width, 3), if it is known."""
        boxes2d = boxes2d_from_msg(message)._replace(color=color)
        if boxes2d.stamp_ns is None:
            self._note_once(UNSTAMPED, 'the 2D boxes have no stamp: each array is paired with the depth image that '
                            'arrived nearest to %.3f s before it (~assumed_delay)' % (self._sync.assumed_delay_ns / NS))
        self._events.count('arrays of 2D boxes')
        self._sync.add_boxes(boxes2d.stamp_ns, now_ns, boxes2d)

    def end(self) -> None:
        """Report what still waits for its depth image. Call at the end of the input."""
        self._sync.end()
        if self._held is not None:
            self._pass_on(*self._held)
            self._held = None

    def frame(self, trigger: Trigger, depth_msg: Image, camera: Camera) -> RgbdFrame:
        """Return the RgbdFrame of matched messages: the colour image, or the Boxes2D in it (the frame then has
        its colour only if they do); the depth image; and the Camera.

        Raises ValueError if an image cannot be read, the colour image has another size than its camera_info, or the
        depth image has another size than the camera or cannot be registered.
        """
        depth_stamp_ns = depth_msg.header.stamp.to_nsec()
        if isinstance(trigger, Boxes2D):
            color, size, stamp_ns = trigger.color, trigger.image_size, trigger.stamp_ns or depth_stamp_ns
        else:
            color = imgmsg_to_rgb(trigger)
            size, stamp_ns = (color.shape[1], color.shape[0]), trigger.header.stamp.to_nsec()
        fault = '' if size is None else info_size_fault(camera, *size, self._info_topic)
        if fault:  # before depth is compared with the camera, too
            raise ValueError(fault)
        received = imgmsg_to_depth(depth_msg, self._params.depth_scale, check_unit=True)
        depth, frame_id = self._aligned(received, depth_msg.header.frame_id, camera)
        camera_from_floor, is_floor_known = self._camera_from_floor(frame_id)
        frame = RgbdFrame(stamp_ns, depth_stamp_ns, frame_id, camera, depth, received.scale_m, color,
                          camera_from_floor=camera_from_floor, is_floor_known=is_floor_known)
        return frame.turned(turns_for(self._params.image_rotation, frame.up))

    def _aligned(self, depth: DepthImage, depth_frame: str, camera: Camera) -> Tuple[Any, str]:
        if self._params.depth == RAW:
            frame_id = self._params.frame_id or self._color_frame
            registration = self._registration.geometry(depth, depth_frame, camera, frame_id)
            return RegisteredDepth(depth, registration), frame_id
        height, width = depth.values.shape
        if (width, height) != (camera.width, camera.height):
            raise ValueError('%s; depth must be aligned to colour: %s' % (size_fault(camera, width, height), ALIGN))
        return depth, self._params.frame_id or depth_frame

    def _camera_from_floor(self, frame_id: str) -> Tuple[Optional[np.ndarray], bool]:
        """Return the transform (4, 4) to the optical frame from ~floor_frame, or from the root of tf without it, and
        whether it is that from ~floor_frame; None and False if it is unknown.

        The latest transform is used: the camera is fixed to the robot, so no wait for the image stamp is necessary.
        """
        wanted = self._params.floor_frame
        if not wanted:
            return None, False
        try:
            floor_frame, camera_from_floor = upright_transform(self._transforms, wanted, frame_id)
        except tf2_ros.TransformException as error:
            self._note_once(TILT_UNKNOWN, 'the tilt of the camera is unknown, as there is no transform from %s to %s: '
                            '%s; positions are those of a level camera, and the detector depth fits the floor to '
                            'the depth image; set ~floor_frame to a frame of tf whose z axis points up, such as map'
                            % (wanted, frame_id, error))
            return None, False
        if floor_frame != wanted:
            self._note_once(TILT_FROM_ROOT, 'there is no transform from %s (~floor_frame) to %s: the tilt of the '
                            'camera is that in %s, the root of its tree, whose z axis must point up, and the detector '
                            'depth fits the floor to the depth image' % (wanted, frame_id, floor_frame))
        return camera_from_floor, floor_frame == wanted

    def _note_once(self, event: str, sentence: str) -> None:
        if event not in self._events.counts:
            self._events.note(event, sentence)

    def _on_frame(self, trigger: Stamped, depth: Stamped, camera: Camera) -> None:
        """Pass matched messages on, but only once if a depth image is nearest to several colour images: positions have
        its stamp. A colour image before it is held back if the next one should be nearer to it."""
        gap_ns, held, self._held = depth.stamp_ns - trigger.stamp_ns, self._held, None
        self._recent_ns = self._recent_ns[1 - RECENT:] + [trigger.stamp_ns]
        if held is not None:
            held_trigger, held_depth, _camera = held
            if held_depth.stamp_ns == depth.stamp_ns and abs(gap_ns) < depth.stamp_ns - held_trigger.stamp_ns:
                self._events.count(USED)
            else:
                self._pass_on(*held)
        if gap_ns and depth.stamp_ns == self._used_ns:
            self._events.count(USED)
        elif gap_ns > 0 and gap_ns > half_period_of(self._recent_ns):  # no median where stamps are equal
            self._held = trigger, depth, camera
        else:
            self._pass_on(trigger, depth, camera)

    def _pass_on(self, trigger: Stamped, depth: Stamped, camera: Camera) -> None:
        self._used_ns = depth.stamp_ns
        self._on_match(trigger.value, depth.value, camera)

    def _on_lost(self, trigger: Trigger, stamp_ns: Optional[int], before_jump: bool) -> None:
        inputs = '2D boxes' if isinstance(trigger, Boxes2D) else 'colour images'
        if before_jump:
            self._events.count('%s from before a time jump' % inputs)
            return
        with self._events.rejecting(inputs):
            raise ValueError(self._why_lost(stamp_ns))

    def _why_lost(self, stamp_ns: Optional[int]) -> str:
        """Return an error message that names the missing input and its topic."""
        newest_ns = self._sync.newest_ns
        if newest_ns is None:
            return 'no depth image received on %s' % self._depth_topic
        if not self._sync.has_camera:
            return 'no camera_info received on %s' % self._info_topic
        if stamp_ns is None:
            return 'no depth image received on %s within %.1f s' % (self._depth_topic, self._cache_s)
        too_old_s = (newest_ns - stamp_ns) / NS - self._cache_s
        if too_old_s > 0:
            return ('no depth image with their stamp %.3f received on %s; the newest has %.3f, and %.1f s are kept '
                    '(~cache_length): the detector is %.1f s slower than that'
                    % (stamp_ns / NS, self._depth_topic, newest_ns / NS, self._cache_s, too_old_s))
        return ('no depth image with their stamp %.3f received on %s: %s'
                % (stamp_ns / NS, self._depth_topic, self._sync.gap_text(stamp_ns)))
