"""Recordings as RealSense's own tools make them, of a camera that librealsense simulates (`software_device`)."""
import time

import numpy as np
import pyrealsense2 as rs

from ros_3d_bb.camera.camera_model import Camera, transform_from

# As of a D435i: depth has a wider field of view, and colour is 15 mm to its right, slightly rotated.
DEPTH_CAMERA = Camera(640, 480, 386.0, 386.0, 320.3, 238.9)
COLOR_CAMERA = Camera(640, 480, 614.0, 613.0, 322.1, 243.7, 'inverse_brown_conrady',
                      (0.02, -0.05, 0.001, -0.0005, 0.01))
DEPTH_FROM_COLOR = transform_from((0.0148, 0.0002, 0.0004), (0.002, -0.001, 0.0015, 1.0))
START_MS, STEP_MS = 1700000000000.25, 33.5
# pyrealsense2 2.58 and later write .db3 and read both; old releases have no version attribute.
SUFFIX = '.db3' if tuple(int(part) for part in getattr(rs, '__version__', '2.0').split('.')[:2]) >= (2, 58) else '.bag'
FRAMES = 6  # of the fixture `recording`
SKIPPED = 1  # first images that the library may not play, on a busy machine


def write_recording(path, colors, depths, depth_scale_m=0.001, clock=rs.timestamp_domain.global_time,
                    start_ms=START_MS):
    """Record colour (h, w, 3) uint8 and depth (h, w) uint16 images, `STEP_MS` apart. Returns `path`."""
    device = rs.software_device()
    for info, text in ((rs.camera_info.name, 'D435I'), (rs.camera_info.serial_number, '42')):
        device.register_info(info, text)
    sensors = device.add_sensor('Stereo Module'), device.add_sensor('RGB Camera')
    sensors[0].add_read_only_option(rs.option.depth_units, depth_scale_m)
    profiles = (sensors[0].add_video_stream(_stream(rs.stream.depth, 1, rs.format.z16, 2, DEPTH_CAMERA)),
                sensors[1].add_video_stream(_stream(rs.stream.color, 2, rs.format.rgb8, 3, COLOR_CAMERA)))
    profiles[1].register_extrinsics_to(profiles[0], _extrinsics_of(DEPTH_FROM_COLOR))
    profiles[0].register_extrinsics_to(profiles[1], _extrinsics_of(np.linalg.inv(DEPTH_FROM_COLOR)))
    recorder, queue = rs.recorder(path, device), rs.frame_queue(100)
    recorded = recorder.query_sensors()
    for sensor in recorded:
        sensor.open(sensor.get_stream_profiles())
        sensor.start(queue)
    for number, images in enumerate(zip(depths, colors)):
        for sensor, profile, pixels in zip(sensors, profiles, images):
            frame = rs.software_video_frame()
            frame.pixels, frame.bpp = np.ascontiguousarray(pixels), pixels[0, 0].nbytes
            frame.stride, frame.profile = pixels.shape[1] * frame.bpp, profile.as_video_stream_profile()
            frame.timestamp, frame.domain = start_ms + number * STEP_MS, clock
            frame.frame_number, frame.depth_units = number, depth_scale_m
            sensor.on_video_frame(frame)
        time.sleep(STEP_MS / 1000)  # the recording also contains arrival times
    for sensor in recorded:
        sensor.stop()
        sensor.close()
    return path


def _stream(kind, uid, pixel_format, bytes_per_pixel, camera):
    stream = rs.video_stream()
    stream.type, stream.index, stream.uid, stream.fmt, stream.bpp = kind, 0, uid, pixel_format, bytes_per_pixel
    stream.width, stream.height, stream.fps, stream.intrinsics = camera.width, camera.height, 30, intrinsics_of(camera)
    return stream


def intrinsics_of(camera, model=None):
    intrinsics = rs.intrinsics()
    intrinsics.width, intrinsics.height, intrinsics.fx, intrinsics.fy, intrinsics.ppx, intrinsics.ppy = camera[:6]
    intrinsics.model = model or (rs.distortion.inverse_brown_conrady if camera.distortion else rs.distortion.none)
    intrinsics.coeffs = (list(camera.distortion) + [0.0] * 5)[:5]
    return intrinsics


def _extrinsics_of(b_from_a):
    extrinsics = rs.extrinsics()  # the rotation by columns
    extrinsics.rotation, extrinsics.translation = b_from_a[:3, :3].T.ravel().tolist(), b_from_a[:3, 3].tolist()
    return extrinsics


def sloping_depth(scale_m=0.001):
    """Depth (h, w) uint16 of a wall that slopes away, 1.3 to 3 m ahead, with a board 0.8 m in front of the camera."""
    v, u = np.mgrid[:DEPTH_CAMERA.height, :DEPTH_CAMERA.width]
    rays = DEPTH_CAMERA.deproject(np.stack((u, v), axis=-1), 1.0)
    depth_m = 2.0 / (1 - 0.3 * rays[..., 0] + 0.2 * rays[..., 1])
    depth_m[200:280, 280:360] = 0.8
    return np.round(depth_m / scale_m).astype(np.uint16)


def colored(number):
    image = np.zeros((COLOR_CAMERA.height, COLOR_CAMERA.width, 3), np.uint8)
    image[..., 0], image[:, :100, 1], image[:50, :, 2] = number, 200, 90
    return image
