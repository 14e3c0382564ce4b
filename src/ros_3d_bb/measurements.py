"""Read a measurement session: a folder of colour and depth images with boxes, estimates and ground truth.

The folder holds `frames.json` with the camera (its lens distortion as k1, k2, p1, p2, k3 of plumb_bob) and the frames,
colour as 8-bit PNG and depth as 16-bit PNG in units of the camera's depth_scale, never normalised. Lengths in the file
are millimetres, here metres.
"""
import json
import os
from typing import NamedTuple, Optional, Tuple

import cv2
import numpy as np

from ros_3d_bb.distortion import PLUMB_BOB
from ros_3d_bb.estimation import DepthImage
from ros_3d_bb.geometry import Camera


class SessionError(ValueError):
    """A measurement session that cannot be read: says which file, what is wrong and what was expected."""


class Frame(NamedTuple):
    """One measurement. `boxes_px` are (x1, y1, x2, y2); `estimate_m` is (x, y, z) in the optical frame, `truth_m`
    (x, z); None where not annotated."""

    id: str
    color_path: str
    depth_path: str
    boxes_px: Tuple[Tuple[int, int, int, int], ...]
    estimate_m: Optional[np.ndarray]
    truth_m: Optional[np.ndarray]


class Session(NamedTuple):
    """A measurement session: camera, metres per depth unit, camera frame."""

    camera: Camera
    depth_scale_m: float
    frame_id: str
    frames: Tuple[Frame, ...]


def read_session(folder):
    """Read the `frames.json` of a session; images are read by `read_color` and `read_depth`.

    Raises
    ------
    SessionError
        If the folder holds no session, or a field is missing or wrong.
    """
    path = os.path.join(str(folder), 'frames.json')
    try:
        with open(path, encoding='utf-8') as stream:
            content = json.load(stream)
        camera = content['camera']
        if not 0 < float(camera['depth_scale']) < 1:
            raise ValueError('depth_scale is %s; metres per unit expected, such as 0.001' % camera['depth_scale'])
        intrinsics = (camera[name] for name in ('width', 'height', 'fx', 'fy', 'cx', 'cy'))
        return Session(Camera(*intrinsics, distortion_model=PLUMB_BOB, distortion=camera.get('distortion', ())),
                       float(camera['depth_scale']), str(camera['frame']),
                       tuple(_frame_from(str(folder), entry) for entry in content['frames']))
    except OSError as error:
        raise SessionError('%s: not a measurement session (%s); expected a folder with frames.json, color/ and depth/'
                           % (folder, error.strerror))
    except KeyError as error:
        raise SessionError('%s: the field %s is missing' % (path, error))
    except (TypeError, ValueError, AttributeError, OverflowError, RecursionError) as error:
        raise SessionError('%s: not the description of a measurement session (%s)' % (path, error))


def read_color(frame, camera):
    """The colour image of a frame, (height, width, 3), uint8, RGB. Raises SessionError."""
    image = _read_image(frame.color_path, camera)
    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
        raise SessionError('%s: an 8-bit colour image was expected' % frame.color_path)
    return image[..., ::-1]


def read_depth(frame, session):
    """The depth image of a frame. Raises SessionError."""
    image = _read_image(frame.depth_path, session.camera)
    if image.dtype != np.uint16 or image.ndim != 2:
        raise SessionError('%s: a 16-bit depth image with one channel was expected; depth stored with 8 bits has lost '
                           'its scale' % frame.depth_path)
    return DepthImage(image, session.depth_scale_m)


def _read_image(path, camera):
    try:
        image = cv2.imread(path, cv2.IMREAD_UNCHANGED)
    except cv2.error:  # more pixels than OpenCV reads
        image = None
    if image is None:
        raise SessionError('%s: missing, or not an image' % path)
    if image.shape[:2] != (camera.height, camera.width):
        raise SessionError('%s: %d x %d pixels, where the camera has %d x %d'
                           % (path, image.shape[1], image.shape[0], camera.width, camera.height))
    return image


def _frame_from(folder, entry):
    detections = entry.get('detections') or [entry]
    estimate_mm = detections[0].get('estimate_mm', detections[0].get('original_mm'))
    truth_mm = entry.get('truth_mm')
    return Frame(
        str(entry['id']), os.path.join(folder, entry['color']), os.path.join(folder, entry['depth']),
        tuple(tuple(int(edge) for edge in _numbers(detection['box'], 4))
              for detection in detections if detection.get('box')),
        None if estimate_mm is None else _numbers(estimate_mm, 3) / 1000,
        None if truth_mm is None else _numbers([truth_mm['x'], truth_mm['z']], 2) / 1000)


def _numbers(values, count):
    """`count` numbers as an array. Raises ValueError."""
    numbers = np.array(values, float)
    if numbers.shape != (count,) or not np.isfinite(numbers).all():
        raise ValueError('%s is not %d numbers' % (str(values)[:100], count))
    return numbers
