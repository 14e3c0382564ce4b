"""Driver of RealSense cameras and their recordings, with `pyrealsense2`, which is imported when a camera is opened."""
import os
import time
from typing import NamedTuple

import numpy as np

from ros_3d_bb.camera.camera_model import OPTICAL_ROTATION, Camera, transform_from
from ros_3d_bb.camera.distortion import EQUIDISTANT, INVERSE_BROWN_CONRADY, PLUMB_BOB
from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.core.params import Param, parameters
from ros_3d_bb.core.time_sync import NS

POLL_MS = 100
LOST_S = 5.0  # a camera that sends no images for this time is considered lost
ENDED_S = 0.5  # a recording whose playback has stopped is over after this time without images: some may still be paired
BODY_FROM_OPTICAL = transform_from((0, 0, 0), OPTICAL_ROTATION)
EXPOSURE_UNIT_S = 1e-4  # unit of the colour sensor's exposure
# librealsense uses the same projection for the modified and the inverse Brown-Conrady model.
DISTORTIONS = {'none': ('', 0), 'brown_conrady': (PLUMB_BOB, 5), 'modified_brown_conrady': (INVERSE_BROWN_CONRADY, 5),
               'inverse_brown_conrady': (INVERSE_BROWN_CONRADY, 5), 'kannala_brandt4': (EQUIDISTANT, 4)}


class CameraLost(Exception):
    """The camera is not connected, or sends no images. It may become available again."""


@parameters()
class RealSenseParams(NamedTuple):
    """The camera or recording, and its images."""

    serial: str = Param('')
    width: int = Param(640, limits=(1, 10000))
    height: int = Param(480, limits=(1, 10000))
    fps: int = Param(30, limits=(1, 10000))
    exposure: float = Param(0.0)
    file: str = Param('')
    real_time: bool = Param(
        True, 'Whether a recording is played at the speed at which it was recorded, without the images for which the '
        'machine is too slow. Else it is played as fast as it can be read.')


class Stamps(object):
    """Conversion of librealsense's timestamps to nanoseconds since 1970.

    A camera without metadata uses its own clock, which has an arbitrary origin and overflows after 71 minutes. In this
    case the first image gets its time of arrival, and the camera's clock gives the intervals to the following images.
    """

    def __init__(self):
        self._offset_ns, self._last_ns = None, None

    def stamp_ns(self, timestamp_ms, is_camera_clock, now_ns):
        integer_ms = int(timestamp_ms)
        time_ns = integer_ms * (NS // 1000) + int(round((timestamp_ms - integer_ms) * NS / 1000))
        if not is_camera_clock:
            return time_ns
        if self._last_ns is None or time_ns < self._last_ns:
            self._offset_ns = now_ns - time_ns
        self._last_ns = time_ns
        return time_ns + self._offset_ns


class RealSense(object):
    """Open camera, or recording (`file`) of a camera, with depth aligned to colour. Call `close` after use.

    `camera` is the Camera of the colour stream and of the aligned depth; `link_from_color` (4, 4) transforms between
    the body frames, x forward and z up, of the colour and the depth camera (the `_link`); `is_over` is whether a
    recording has ended.

    Raises CameraLost if no such camera is connected, and ValueError if the recording cannot be played.
    """

    def __init__(self, params):
        self._rs = librealsense(params)
        self._stamps, self.is_over, self._last_image_s = Stamps(), False, time.monotonic()
        self._align, self._pipeline = self._rs.align(self._rs.stream.color), self._rs.pipeline()
        try:
            config = _config(self._rs, params)
            # Options are set before the start; otherwise a recording would lose its first images.
            device = config.resolve(self._rs.pipeline_wrapper(self._pipeline)).get_device()
            self._playback = device.as_playback() if params.file else None
            self._set_up(device, params)
            profile = self._pipeline.start(config)
            color, depth = (profile.get_stream(stream).as_video_stream_profile()
                            for stream in (self._rs.stream.color, self._rs.stream.depth))
            # librealsense stores 0.001 as the float 0.0010000000474974513.
            self._depth_scale_m = float('%.6g' % device.first_depth_sensor().get_depth_scale())
            self.link_from_color = link_from_color(color.get_extrinsics_to(depth))
        except RuntimeError as error:
            if params.file:
                raise ValueError('the recording %s cannot be played: %s' % (params.file, error))
            raise CameraLost('no images of a RealSense%s with %d x %d pixels at %d Hz: %s' % (
                params.serial and ' with the serial number ' + params.serial, params.width, params.height, params.fps,
                error))
        self.camera = camera_from_intrinsics(color.get_intrinsics())

    def read(self):
        """Return the stamp (nanoseconds), the RGB image and the DepthImage aligned to it of the next frame, or None if
        no images arrive within POLL_MS.

        Raises CameraLost if the camera is unplugged or has sent no images for `LOST_S`, and ValueError if the images
        are incomplete; later images may be complete.
        """
        try:
            has_frames, frames = self._pipeline.try_wait_for_frames(POLL_MS)
        except RuntimeError as error:
            raise CameraLost('the RealSense failed: %s' % error)
        now_s = time.monotonic()
        if has_frames:
            self._last_image_s = now_s
            return self._frame_from(frames)
        if self._playback is not None:
            self.is_over = (self._playback.current_status() == self._rs.playback_status.stopped
                            and now_s - self._last_image_s > ENDED_S)
        elif now_s - self._last_image_s > LOST_S:
            raise CameraLost('the RealSense has sent no images for %.0f s' % LOST_S)
        return None

    def close(self):
        """Stop the camera or the recording."""
        try:
            self._pipeline.stop()
            if self._playback is not None:
                # stop() returns while the playback's thread may still read an image, which accesses freed memory if
                # the device is deleted meanwhile. pause() waits for this thread.
                self._playback.pause()
        except RuntimeError:
            pass  # the camera is already disconnected

    def _frame_from(self, frames):
        try:
            if not (frames.get_depth_frame() and frames.get_color_frame()):
                raise ValueError('colour without depth, or depth without colour')
            frames = self._align.process(frames)
            color, depth = frames.get_color_frame(), frames.get_depth_frame()
            # Both images get the stamp of depth, because depth determines positions.
            own_clock = depth.get_frame_timestamp_domain() == self._rs.timestamp_domain.hardware_clock
            stamp_ns = self._stamps.stamp_ns(depth.get_timestamp(), own_clock, int(time.time() * NS))
            return (stamp_ns, rgb_of(np.array(color.get_data()), color.get_profile().format().name),
                    DepthImage(np.array(depth.get_data()), self._depth_scale_m))
        except RuntimeError as error:
            raise ValueError('librealsense could not align depth to colour: %s' % error)

    def _set_up(self, device, params):
        """Set the options of the sensors. Options that a camera does not have are skipped."""
        if self._playback is not None:
            self._playback.set_real_time(params.real_time)
            return
        option, color = self._rs.option, device.first_color_sensor()
        for sensor in device.query_sensors():
            _set(sensor, option.global_time_enabled, 1)
        _set(color, option.enable_auto_exposure, 0 if params.exposure else 1)
        _set(color, option.auto_exposure_priority, 0)  # keeps the rate constant in the dark
        if params.exposure:
            _set(color, option.exposure, round(params.exposure / EXPOSURE_UNIT_S))


def librealsense(params):
    """Import pyrealsense2. ValueError if it is not installed, or `file` is not the absolute path of a recording."""
    if params.file and not (os.path.isabs(params.file) and os.path.isfile(params.file)):
        raise ValueError('parameter ~file is %r; the absolute path of a recording expected' % params.file)
    try:
        import pyrealsense2
    except ImportError as error:
        raise ValueError('pyrealsense2 is not installed (%s); pip3 install pyrealsense2, or use realsense2_camera '
                         '(launch argument driver:=realsense2_camera)' % error)
    return pyrealsense2


def camera_from_intrinsics(intrinsics):
    """Convert librealsense's intrinsics to a Camera. Raises ValueError if the distortion model is unknown."""
    name = intrinsics.model.name
    if name not in DISTORTIONS:
        raise ValueError('distortion model of the RealSense is %s; one of %s expected' % (name, ', '.join(DISTORTIONS)))
    model, count = DISTORTIONS[name]
    return Camera(intrinsics.width, intrinsics.height, intrinsics.fx, intrinsics.fy, intrinsics.ppx, intrinsics.ppy,
                  model, intrinsics.coeffs[:count])


def link_from_color(extrinsics):
    """Transform (4, 4) between the body frames from librealsense's extrinsics between the optical frames."""
    depth_from_color = np.eye(4)
    depth_from_color[:3, :3] = np.reshape(extrinsics.rotation, (3, 3)).T  # librealsense's matrices are by columns
    depth_from_color[:3, 3] = extrinsics.translation
    return BODY_FROM_OPTICAL.dot(depth_from_color).dot(np.linalg.inv(BODY_FROM_OPTICAL))


def frame_links(prefix, link_from_color_body):
    """Frames of a camera with the names of realsense2_camera: [(parent, child, parent_from_child (4, 4)), ...]."""
    links = []
    for stream, link_from_body in (('depth', np.eye(4)), ('color', link_from_color_body)):
        body = '%s_%s_frame' % (prefix, stream)
        links += [('%s_link' % prefix, body, link_from_body), (body, optical_frame(prefix, stream), BODY_FROM_OPTICAL)]
    return links


def optical_frame(prefix, stream):
    return '%s_%s_optical_frame' % (prefix, stream)


def rgb_of(pixels, format_name):
    """Convert pixels (h, w, 3) to RGB. Raises ValueError if `format_name` is neither an RGB nor a BGR format."""
    if format_name == 'bgr8':
        return pixels[..., ::-1]
    if format_name != 'rgb8':
        raise ValueError('colour has the format %s; rgb8 or bgr8 expected' % format_name)
    return pixels


def _config(rs, params):
    config = rs.config()
    if params.file:
        # Enables all streams in the file. Not repeated: librealsense may crash if it is stopped while it restarts.
        config.enable_device_from_file(params.file, repeat_playback=False)
        return config
    if params.serial:
        config.enable_device(params.serial)
    config.enable_stream(rs.stream.depth, params.width, params.height, rs.format.z16, params.fps)
    config.enable_stream(rs.stream.color, params.width, params.height, rs.format.rgb8, params.fps)
    return config


def _set(sensor, option, value):
    if sensor.supports(option) and not sensor.is_option_read_only(option):
        sensor.set_option(option, value)
