"""ROS node that displays images and boxes, and stores measurements in a session."""
import contextlib
import os
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import rospy
import tf2_ros
from sensor_msgs.msg import Image
from std_msgs.msg import Empty, Int32MultiArray
from std_srvs.srv import Trigger, TriggerResponse

from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, DEPTH_TOPIC, INFO_TOPICS
from ros_3d_bb.conversions.image_msgs import imgmsg_to_depth, imgmsg_to_rgb
from ros_3d_bb.conversions.perception_msgs import (BOXES3D_TOPIC, BOXES_TOPIC, boxes2d_from_msg,
                                                   camera_from_msg, stamp_if_any, stamp_of, time_from, usable_boxes3d)
from ros_3d_bb.core.params import DEPTH_SCALE, STAMP_TOLERANCE, Param, parameters
from ros_3d_bb.core.time_sync import NS, arrival_clock_ns
from ros_3d_bb.msg import BoundingBox3DArray
from ros_3d_bb.nodes.common.diagnostics import Diagnostics
from ros_3d_bb.nodes.common.master import NO_ANSWER
from ros_3d_bb.nodes.common.startup import read_params
from ros_3d_bb.nodes.common.subscribers import KEPT_AT_ONCE, subscribe, subscribe_camera_info
from ros_3d_bb.nodes.common.tf_lookup import Transforms
from ros_3d_bb.pipeline.transform_buffer import upright_transform
from ros_3d_bb.sessions.burst import Burst
from ros_3d_bb.sessions.snapshots import ColorImage, Snapshots
from ros_3d_bb.sessions.session_writer import append
from ros_3d_bb.visualization.cv_window import Window
from ros_3d_bb.visualization.image_overlay import DEPTH_RANGE_M
from ros_3d_bb.visualization.viewer_layout import FrameRate, compose, draw_countdown, text_image

CAMERA_INFO_TOPIC = INFO_TOPICS[0]
KEYS = 'keys: s save    t timer    q quit'
TIMER_PERIOD_S = 0.1


@parameters()
class ViewerParams(NamedTuple):
    session: str = Param('')
    label: str = Param('')
    window: bool = Param(True)
    frame_id: str = Param('')
    floor_frame: str = Param('base_link')
    depth_scale: float = DEPTH_SCALE
    cache_length: float = Param(
        1.0, 'How long images wait for their boxes. If boxes take longer, the images are shown and stored without.',
        's')
    stamp_tolerance: float = STAMP_TOLERANCE
    window_rate: float = Param(
        15.0, 'Maximum rate of drawing the window, which is drawn for new images only.', 'Hz', limits=(0.1, 10000))
    panel_width: int = Param(
        320, 'Width of each of the three images in the window; 320 fits a screen of 1024 pixels.', 'pixels',
        limits=(80, 10000))
    depth_image_range: float = Param(DEPTH_RANGE_M, 'Depth at the far end of the colours.', 'm', limits=(0.1, 10000))
    timer_delay: float = Param(5.0, 'Countdown of the timer before its first measurement.', 's')
    timer_count: int = Param(3, 'Number of measurements of the timer.', limits=(1, 1000))
    timer_interval: float = Param(1.0, 'Time between the measurements of the timer.', 's')


class ViewerNode(object):
    """Show the colour image, depth image and boxes of one stamp, and append them to a measurement session.

    Parameters: config/viewer.yaml; ~label is read for each measurement.

    Subscribes
    ----------
    camera/color/image_raw : sensor_msgs/Image
        Colour image.
    camera/aligned_depth_to_color/image_raw : sensor_msgs/Image
        Depth image, aligned to the colour image.
    camera/color/camera_info : sensor_msgs/CameraInfo
        Calibration of the colour camera.
    yolo_bounding_box : std_msgs/Int32MultiArray
        2D boxes.
    ros_3d_bb/bb_3d : ros_3d_bb/BoundingBox3DArray
        3D boxes.
    ~timer : std_msgs/Empty
        Starts the timer, as the key `t` does: a countdown and a burst of measurements. A second message cancels it.
    /tf,/tf_static : tf2_msgs/TFMessage
        Transform from ~floor_frame to the camera, whose tilt is stored; not used if ~floor_frame is empty.

    Services
    --------
    ~capture : std_srvs/Trigger
        Appends the newest image and its boxes to the session, as the key `s` does. The response names the stored
        measurement or the reason for the failure.
    """

    def __init__(self):
        self._params, = read_params(ViewerParams)
        if self._params.session and not os.path.isabs(self._params.session):
            raise ValueError('parameter ~session is %r; an absolute path expected' % self._params.session)
        self._window = Window('ros_3d_bb viewer') if self._params.window else None
        self._snapshots = Snapshots(int(self._params.cache_length * NS), int(self._params.stamp_tolerance * NS),
                                    self._on_lost)
        self._transforms = Transforms(wait_s=0) if self._params.floor_frame else None
        self._lock, self._capture_lock = threading.Lock(), threading.Lock()
        self._rate, self._received_topics, self._answer = FrameRate(), set(), ''
        self._captured_ns, self._is_warned = None, False
        self._label, self._diagnostics = self._params.label, Diagnostics()
        self._burst = Burst(self._params.timer_delay, self._params.timer_count, self._params.timer_interval)
        rospy.Service('~capture', Trigger, lambda _request: TriggerResponse(*self.capture()))
        rospy.Timer(rospy.Duration(TIMER_PERIOD_S), self._on_timer, reset=True)
        # not recorded as an input, whose silence would be reported
        rospy.Subscriber('~timer', Empty, lambda _message: self._burst.toggle(time.monotonic()), queue_size=1)
        for topic, kind, callback in ((BOXES3D_TOPIC, BoundingBox3DArray, self._on_boxes3d),
                                      (BOXES_TOPIC, Int32MultiArray, self._on_boxes2d),
                                      (DEPTH_TOPIC, Image, self._on_depth), (COLOR_TOPIC, Image, self._on_color)):
            subscribe(topic, kind, callback, KEPT_AT_ONCE)
        subscribe_camera_info(CAMERA_INFO_TOPIC, DEPTH_TOPIC, self._on_camera_info)

    def _on_color(self, message):
        with self._receiving('colour images', COLOR_TOPIC):
            color = ColorImage(imgmsg_to_rgb(message), self._params.frame_id or message.header.frame_id)
            now_ns = arrival_clock_ns()
            self._rate.add(now_ns)
            self._snapshots.add_color(stamp_of(message), now_ns, color)

    def _on_depth(self, message):
        with self._receiving('depth images', DEPTH_TOPIC):
            depth = imgmsg_to_depth(message, self._params.depth_scale)
            self._snapshots.add_depth(stamp_of(message), arrival_clock_ns(), depth)

    def _on_camera_info(self, message):
        with self._receiving('camera_info', CAMERA_INFO_TOPIC):
            camera = camera_from_msg(message)
            self._snapshots.add_camera(stamp_if_any(message), arrival_clock_ns(), camera)

    @contextlib.contextmanager
    def _receiving(self, inputs, topic):
        """Context manager for a message of the camera, which is recorded unless it is rejected."""
        with self._diagnostics.receiving(inputs), self._lock:
            yield
            self._received_topics.add(topic)
            self._diagnostics.count('messages of the camera')

    def _on_boxes2d(self, message):
        with self._diagnostics.receiving('2D boxes'), self._lock:
            boxes = boxes2d_from_msg(message)
            if boxes.stamp_ns is None:
                rospy.loginfo_once('the 2D boxes have no stamp; only those with a 3D box are stored')
                return
            self._snapshots.add_boxes2d(boxes.stamp_ns, arrival_clock_ns(),
                                        tuple(tuple(rect_px) for rect_px in boxes.boxes.tolist()))

    def _on_boxes3d(self, message):
        with self._diagnostics.receiving('3D boxes'), self._lock:
            boxes, faults = usable_boxes3d(message)
            self._diagnostics.count_dropped('3D boxes', faults)
            self._snapshots.add_boxes3d(stamp_of(message), arrival_clock_ns(), tuple(boxes.values()))
            self._is_warned = False

    def _on_timer(self, _event):
        if self._burst.is_due(time.monotonic()):
            is_stored, _answer = self.capture()
            self._burst.report(time.monotonic(), is_stored)

    def _on_lost(self, stamp_ns):
        self._diagnostics.warn('colour images without depth', 'no depth image and camera_info with the stamp %.3f '
                               'of the colour image received; waiting for the next' % (stamp_ns / NS))

    def capture(self):
        """Append the newest image and its boxes to the session. Returns whether it was stored, and a message."""
        with self._capture_lock:
            try:
                done, self._answer = True, self._stored()
                rospy.loginfo('%s', self._answer)
                self._diagnostics.count('measurements saved')
            except (ValueError, OSError) as error:
                done, self._answer = False, 'not saved: %s' % error
                self._diagnostics.warn('measurements not saved', self._answer)
            return done, self._answer

    def _stored(self):
        if not self._params.session:
            raise ValueError('no session is given; start the viewer with session:=FOLDER')
        snapshot = self._snapshot_to_store()
        snapshot = snapshot._replace(up=self._up_in(snapshot.color.frame_id))
        label = self._read_label()
        name, count = append(self._params.session, snapshot, label)
        self._captured_ns = snapshot.stamp_ns
        found = ('without 3D boxes' if snapshot.boxes3d is None else
                 'with %d 3D box%s' % (len(snapshot.boxes3d), '' if len(snapshot.boxes3d) == 1 else 'es'))
        return 'saved %s %s%s: number %d in %s' % (name, found, label and ', label %s' % label, count,
                                                   self._params.session)

    def _read_label(self):
        """Return the parameter ~label, as it was last known without a master."""
        with contextlib.suppress(*NO_ANSWER):
            self._label = str(rospy.get_param_cached('~label', self._params.label))
        return self._label

    def _up_in(self, frame_id):
        """Return the unit vector (3,) that points up, in a frame; None if it is unknown."""
        if self._transforms is None:
            return None
        try:
            return upright_transform(self._transforms, self._params.floor_frame, frame_id)[1][:3, 2]
        except tf2_ros.TransformException:  # bbox3d_node reports it
            return None

    def _snapshot_to_store(self):
        """Return the newest snapshot. Raises ValueError without one, or without boxes before the user was warned."""
        with self._lock:
            snapshot, is_early = self._snapshots.newest, self._snapshots.is_early
        if snapshot is None:
            raise ValueError(self._why_nothing())
        if snapshot.stamp_ns == self._captured_ns:
            raise ValueError('no new image received since the last measurement')
        if snapshot.boxes3d is None and is_early:
            raise ValueError('the 3D boxes of the first images are not available yet; try again')
        if snapshot.boxes3d is None and not self._is_warned:
            self._is_warned = True
            raise ValueError('no 3D boxes received on %s for the images of the last %.1f s; try again to save the '
                             'images without boxes' % (rospy.resolve_name(BOXES3D_TOPIC), self._params.cache_length))
        return snapshot

    def _why_nothing(self):
        missing = [rospy.resolve_name(topic) for topic in (COLOR_TOPIC, DEPTH_TOPIC, CAMERA_INFO_TOPIC)
                   if topic not in self._received_topics]
        if missing:
            return 'no messages received on %s' % ', '.join(missing)
        return 'no depth image with the stamp of a colour image received on %s' % rospy.resolve_name(DEPTH_TOPIC)

    def run(self):
        """Show the window until it is closed or ROS shuts down. Runs in the main thread, which must not publish."""
        if self._window is None:
            rospy.spin()
            return
        with ThreadPoolExecutor(1) as others:  # on exit, waits for measurements that are being stored
            actions = {'s': self.capture, 't': lambda: self._burst.toggle(time.monotonic())}
            shown, key = None, ''
            while not (rospy.is_shutdown() or key == 'q' or self._window.is_closed):
                due_s = time.monotonic() + 1 / self._params.window_rate
                shown = self._show(shown)
                key = self._window.key(max(1, int(1000 * (due_s - time.monotonic())))).lower()  # with Caps Lock, too
                if key in actions:
                    others.submit(actions[key]).add_done_callback(_complain)
        self._window.close()
        if not rospy.is_shutdown():
            rospy.signal_shutdown('the window was closed')

    def _show(self, shown):
        """Redraw the window if its content differs from `shown`, the previous return value."""
        with self._lock:
            snapshot, is_early = self._snapshots.newest, self._snapshots.is_early
            rate_hz = self._rate.at(arrival_clock_ns())
        if snapshot is None:
            self._window.show(text_image((KEYS,), (self._why_nothing(),), 3 * self._params.panel_width))
            return None
        label, countdown = self._read_label(), self._burst.text(time.monotonic())
        content = (snapshot.stamp_ns, snapshot.boxes2d, snapshot.boxes3d is None, rate_hz == 0, self._answer,
                   label, countdown)
        if content == shown:
            return shown
        lines = ('%.1f images/s    stamp %d.%09d    %s' % ((rate_hz,) + divmod(snapshot.stamp_ns, NS) + (
                     'no 3D boxes' if snapshot.boxes3d is None else '3D boxes: %d' % len(snapshot.boxes3d),)),
                 'session: %s    label: %s' % (self._params.session or 'none', label or 'none'), KEYS, self._answer)
        warnings = list(self._warnings(snapshot, is_early, rate_hz))
        picture = compose(snapshot, self._params.panel_width, self._params.depth_image_range, lines, warnings)
        self._window.show(draw_countdown(picture, countdown))
        self._diagnostics.record_latency(time_from(snapshot.stamp_ns))
        return content

    def _warnings(self, snapshot, is_early, rate_hz):
        if snapshot.boxes3d is None and not is_early:
            yield 'no 3D boxes on %s' % rospy.resolve_name(BOXES3D_TOPIC)
        if rate_hz == 0:
            yield 'no new images on %s' % rospy.resolve_name(COLOR_TOPIC)


def _complain(future):
    if future.exception() is not None:
        rospy.logerr('the action of the key failed: %r', future.exception())
