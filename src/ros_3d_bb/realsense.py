"""A RealSense camera, or a recording of one, read with librealsense's own Python package.

`pyrealsense2` is imported where it is needed: only who reads a camera with this module must have it.
"""
import os
import time
from typing import NamedTuple

import numpy as np

from ros_3d_bb.distortion import EQUIDISTANT, INVERSE_BROWN_CONRADY, PLUMB_BOB
from ros_3d_bb.estimation import DepthImage
from ros_3d_bb.geometry import OPTICAL_ROTATION, Camera, transform_from
from ros_3d_bb.params import Param, parameters
from ros_3d_bb.stamped import NS

POLL_MS = 100
LOST_S = 5.0  # without images a camera that is plugged in is taken for lost
EXPOSURE_UNIT_S = 1e-4  # of the colour sensor's exposure
# librealsense projects with both of the Brown-Conrady models that have an adjective by the same formulas.
DISTORTIONS = {'none': ('', 0), 'brown_conrady': (PLUMB_BOB, 5), 'modified_brown_conrady': (INVERSE_BROWN_CONRADY, 5),
               'inverse_brown_conrady': (INVERSE_BROWN_CONRADY, 5), 'kannala_brandt4': (EQUIDISTANT, 4)}
# In the order in which librealsense recommends to use them.
FILTERS = ('decimation', 'disparity', 'spatial', 'temporal', 'hole_filling')


class CameraLost(Exception):
    """There is no such camera, or it sends nothing any more. It may come back."""


@parameters()
class RealSenseParams(NamedTuple):
    """The camera or recording, and its images."""

    serial: str = Param('')
    width: int = Param(640, limits=(1, 10000))
    height: int = Param(480, limits=(1, 10000))
    fps: int = Param(30, limits=(1, 10000))
    filters: list = Param((), choices=FILTERS)
    exposure: float = Param(0.0)
    file: str = Param('')
    real_time: bool = Param(
        True, 'Whether a recording is played at the speed at which it was recorded, without the images for which the '
        'machine is too slow. Else it is played as fast as it can be read.')
    repeat: bool = Param(False)


class Pair(NamedTuple):
    """What a camera saw at a time: `color` (h, w, 3) uint8 RGB, and `depth` with the same pixels."""

    stamp_ns: int
    color: np.ndarray
    depth: DepthImage


class Stamps(object):
    """From librealsense's timestamps to nanoseconds since 1970.

    They count from 1970 already where librealsense knows the time ("global time", or time of arrival). A camera without
    metadata gives its own clock instead, which starts anywhere, and starts again after 71 minutes: then the first image
    has the time at which it came, and the others are as much later as the camera says.
    """

    def __init__(self):
        self._offset_ns, self._last_ns = None, None

    def stamp_ns(self, timestamp_ms, is_camera_clock, now_ns):
        """The stamp of an image that came at `now_ns`."""
        whole_ms = int(timestamp_ms)
        time_ns = whole_ms * (NS // 1000) + int(round((timestamp_ms - whole_ms) * NS / 1000))
        if not is_camera_clock:
            return time_ns
        if self._last_ns is None or time_ns < self._last_ns:
            self._offset_ns = now_ns - time_ns
        self._last_ns = time_ns
        return time_ns + self._offset_ns


class RealSense(object):
    """An open camera, or a recording (`file`) of one; depth is aligned to colour. To be closed.

    Attributes
    ----------
    camera : Camera
        Intrinsics of the colour stream, and so of the aligned depth.
    link_from_color : numpy.ndarray, (4, 4)
        From the colour camera's body frame to that of the depth camera, which is the camera's `_link`: x ahead, z up.
    is_over : bool
        Whether a recording that is not repeated has ended.

    Raises
    ------
    CameraLost
        If no such camera is plugged in.
    ValueError
        If pyrealsense2 is missing, a parameter cannot be meant, or the recording cannot be played.
    """

    def __init__(self, params):
        check_params(params)
        self._rs = librealsense()
        self._stamps, self.is_over, self._heard_s = Stamps(), False, time.monotonic()
        self._align, self._filters = self._rs.align(self._rs.stream.color), _filters(self._rs, params.filters)
        self._pipeline = self._rs.pipeline()
        try:
            config = _config(self._rs, params)
            # Set up before it starts: a recording would lose its first images.
            device = config.resolve(self._rs.pipeline_wrapper(self._pipeline)).get_device()
            self._playback = device.as_playback() if params.file else None
            self._set_up(device, params)
            profile = self._pipeline.start(config)
            color, depth = (profile.get_stream(stream).as_video_stream_profile()
                            for stream in (self._rs.stream.color, self._rs.stream.depth))
            # A float of librealsense is 0.0010000000474974513 where 0.001 is meant.
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
        """The next pair of images, or None where none has come for a moment.

        Raises
        ------
        CameraLost
            If none have come for `LOST_S`: the camera is unplugged, or hangs.
        ValueError
            If there is no pair in what came; the next may be better.
        """
        try:
            came, frames = self._pipeline.try_wait_for_frames(POLL_MS)
        except RuntimeError as error:
            raise CameraLost('the RealSense failed: %s' % error)
        now_s = time.monotonic()
        if came:
            self._heard_s = now_s
            return self._pair(frames)
        if self._playback is not None:
            self.is_over = self._playback.current_status() == self._rs.playback_status.stopped
        elif now_s - self._heard_s > LOST_S:
            raise CameraLost('the RealSense has sent no images for %.0f s' % LOST_S)
        return None

    def close(self):
        """Stop the camera, or the recording."""
        try:
            self._pipeline.stop()
        except RuntimeError:
            pass  # it is gone already

    def _pair(self, frames):
        try:
            if not (frames.get_depth_frame() and frames.get_color_frame()):
                raise ValueError('colour came without depth, or depth without colour')
            for a_filter in self._filters:
                frames = a_filter.process(frames).as_frameset()
            frames = self._align.process(frames)
            color, depth = frames.get_color_frame(), frames.get_depth_frame()
            # One stamp for both, that of depth, of which positions are made.
            own_clock = depth.get_frame_timestamp_domain() == self._rs.timestamp_domain.hardware_clock
            stamp_ns = self._stamps.stamp_ns(depth.get_timestamp(), own_clock, int(time.time() * NS))
            return Pair(stamp_ns, rgb_of(np.array(color.get_data()), color.get_profile().format().name),
                        DepthImage(np.array(depth.get_data()), self._depth_scale_m))
        except RuntimeError as error:
            raise ValueError('librealsense could not align depth to colour: %s' % error)

    def _set_up(self, device, params):
        """Options of the sensors; what a camera does not have is left alone."""
        if self._playback is not None:
            self._playback.set_real_time(params.real_time)
            return
        option, color = self._rs.option, device.first_color_sensor()
        for sensor in device.query_sensors():
            _set(sensor, option.global_time_enabled, 1)
        _set(color, option.enable_auto_exposure, 0 if params.exposure else 1)
        _set(color, option.auto_exposure_priority, 0)  # the rate stays where it is dark
        if params.exposure:
            _set(color, option.exposure, round(params.exposure / EXPOSURE_UNIT_S))


def librealsense():
    """The package pyrealsense2. Raises ValueError where it is missing."""
    try:
        import pyrealsense2
    except ImportError as error:
        raise ValueError('pyrealsense2 is not installed (%s); pip3 install pyrealsense2, or use realsense2_camera '
                         '(launch argument driver:=realsense2_camera)' % error)
    return pyrealsense2


def check_params(params):
    """Raise ValueError where there is no such recording."""
    if params.file and not (os.path.isabs(params.file) and os.path.isfile(params.file)):
        raise ValueError('parameter ~file is %r; the absolute path of a recording expected' % params.file)


def camera_from_intrinsics(intrinsics):
    """The Camera of librealsense's intrinsics. Raises ValueError where its distortion model is not known."""
    name = intrinsics.model.name
    if name not in DISTORTIONS:
        raise ValueError('distortion model of the RealSense is %s; one of %s expected' % (name, ', '.join(DISTORTIONS)))
    model, count = DISTORTIONS[name]
    return Camera(intrinsics.width, intrinsics.height, intrinsics.fx, intrinsics.fy, intrinsics.ppx, intrinsics.ppy,
                  model, intrinsics.coeffs[:count])


def link_from_color(extrinsics):
    """The (4, 4) transform between the body frames, of librealsense's extrinsics between the optical ones.

    Parameters
    ----------
    extrinsics : pyrealsense2.extrinsics
        From colour to depth: `rotation` by columns, `translation` in metres.
    """
    depth_from_color = np.eye(4)
    depth_from_color[:3, :3] = np.reshape(extrinsics.rotation, (3, 3)).T
    depth_from_color[:3, 3] = extrinsics.translation
    body_from_optical = transform_from((0, 0, 0), OPTICAL_ROTATION)
    return body_from_optical.dot(depth_from_color).dot(np.linalg.inv(body_from_optical))


def frame_links(prefix, link_from_color_body):
    """The frames of a camera as realsense2_camera has them: (parent, child, parent_from_child), ...

    Parameters
    ----------
    prefix : str
        `camera` makes camera_link, camera_color_frame, camera_color_optical_frame, and the same for depth.
    link_from_color_body : numpy.ndarray, (4, 4)
    """
    links, body_from_optical = [], transform_from((0, 0, 0), OPTICAL_ROTATION)
    for stream, link_from_body in (('depth', np.eye(4)), ('color', link_from_color_body)):
        body = '%s_%s_frame' % (prefix, stream)
        links.append(('%s_link' % prefix, body, link_from_body))
        links.append((body, optical_frame(prefix, stream), body_from_optical))
    return tuple(links)


def optical_frame(prefix, stream):
    """The name of the optical frame of a stream: color or depth."""
    return '%s_%s_optical_frame' % (prefix, stream)


def rgb_of(pixels, format_name):
    """Pixels (h, w, 3) as RGB. Raises ValueError where a recording has others than librealsense can have made so."""
    if format_name == 'bgr8':
        return pixels[..., ::-1]
    if format_name != 'rgb8':
        raise ValueError('colour has the format %s; rgb8 or bgr8 expected' % format_name)
    return pixels


def _config(rs, params):
    config = rs.config()
    if params.file:
        config.enable_device_from_file(params.file, params.repeat)  # with all streams that are in it
        return config
    if params.serial:
        config.enable_device(params.serial)
    config.enable_stream(rs.stream.depth, params.width, params.height, rs.format.z16, params.fps)
    config.enable_stream(rs.stream.color, params.width, params.height, rs.format.rgb8, params.fps)
    return config


def _filters(rs, names):
    """Filters of depth in their order; between the two ends of `disparity` they work on disparity."""
    made = {'decimation': rs.decimation_filter, 'spatial': rs.spatial_filter, 'temporal': rs.temporal_filter,
            'hole_filling': rs.hole_filling_filter, 'disparity': lambda: rs.disparity_transform(True)}
    filters = [made[name]() for name in FILTERS if name in names]
    if 'disparity' in names:
        filters.insert(len(filters) - ('hole_filling' in names), rs.disparity_transform(False))
    return filters


def _set(sensor, option, value):
    if sensor.supports(option) and not sensor.is_option_read_only(option):
        sensor.set_option(option, value)
