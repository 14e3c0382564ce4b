"""Poses of cameras, and detections of people in front of one at the origin of the map, 1 m up, that looks along x."""
import numpy as np

from ros_3d_bb.camera.camera_model import OPTICAL_ROTATION, Camera, transform_from
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.types import CameraView, Detection


def mounted(height_m, pitch_deg=0.0, roll_deg=0.0, yaw_deg=0.0):
    """The transform of a camera above the origin, which looks along x, then turned left, pitched down and rolled."""
    transform = transform_from((0, 0, height_m), (0, 0, 0, 1))
    for axis, angle_deg in ((2, yaw_deg), (1, pitch_deg), (0, roll_deg)):
        half = np.radians(angle_deg) / 2
        quaternion = np.eye(4)[axis] * np.sin(half) + np.eye(4)[3] * np.cos(half)
        transform = transform.dot(transform_from((0, 0, 0), quaternion))
    return transform.dot(transform_from((0, 0, 0), OPTICAL_ROTATION))


CAMERA = Camera(640, 480, 533.0, 533.0, 319.5, 239.5)  # sees x from -0.6 to 0.6 of the depth
VIEW = CameraView(mounted(1.0), CAMERA)
START_NS = 1000 * NS


def view_from(x, y, height_m=1.0, camera='', **angles_deg):
    transform = mounted(height_m, **angles_deg)
    transform[:2, 3] = x, y
    return CameraView(transform, CAMERA, camera)


def at(x, y, height=1.7, cut='', width=0.5, sigma=0.04, **fields):
    """The detection of someone who stands at a place, truncated at the edges that `cut` names."""
    edges = tuple(edge in cut for edge in ('left', 'top', 'right', 'bottom'))
    return Detection(np.array([x, y, height / 2]), np.array([width, width, height]), np.eye(3) * sigma ** 2,
                     edges)._replace(**fields)


def noisy(random, places_m, sigma_m=0.02):
    """Detections of people at places (x, y) or (x, y, height), with errors of the position."""
    errors_m = random.normal(0, sigma_m, (len(places_m), 2))
    return [at(x + error_x, y + error_y, *height) for (x, y, *height), (error_x, error_y) in zip(places_m, errors_m)]


def play(tracker, seconds, detections_at, rate_hz=30, start_s=0.0, view=VIEW):
    """Update the tracker with `detections_at(seconds)`; returns the published tracks of each image. The view may be a
    function of the time, too."""
    times_s = [start_s + frame / rate_hz for frame in range(int(seconds * rate_hz))]
    return [tracker.update(START_NS + int(round(time_s * NS)), detections_at(time_s),
                           view(time_s) if callable(view) else view) for time_s in times_s]


def standing(*places):
    return lambda _time_s: [at(*place) for place in places]


def ids(objects):
    return [track.id for track in objects]


def all_ids(published):
    return {track.id for objects in published for track in objects}
