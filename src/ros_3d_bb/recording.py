"""Append measurements to a measurement session, as `measurements` reads them; each as a whole or not at all.

The images come first, so that frames.json never names one that is not there. Lengths in the file are millimetres, here
metres.
"""
import os
import re
from typing import NamedTuple, Tuple

import cv2
import numpy as np

from ros_3d_bb.estimation import Box3D, DepthImage
from ros_3d_bb.geometry import Camera
from ros_3d_bb.measurements import read_session
from ros_3d_bb.session_file import FILE_NAME, changing, write_whole
from ros_3d_bb.stamped import NS

MILLIMETRE = 0.001
FARTHEST_MM = 65535  # that 16 bits hold
OWN_ID = re.compile(r'(\d+)_\d+_\d{9}$')


class Measurement(NamedTuple):
    """What is stored of one image.

    `color` (height, width, 3), uint8, RGB; `depth` in pixels of the colour image; `frame_id` of the camera; `stamp_ns`
    integer nanoseconds; `rects_px` the 2D boxes (x1, y1, x2, y2); `boxes` the 3D boxes made of them, of which some may
    be missing; `label` of whoever takes the measurement, may be empty.
    """

    color: np.ndarray
    depth: DepthImage
    camera: Camera
    frame_id: str
    stamp_ns: int
    rects_px: Tuple[Tuple[int, int, int, int], ...]
    boxes: Tuple[Box3D, ...]
    label: str = ''


class Appended(NamedTuple):
    """The id of a new measurement, and how many there are now in its session."""

    id: str
    count: int


def append(folder, measurement):
    """Append a measurement to the session in a folder, which is made where there is none.

    Its id is a number one above the largest there, and the stamp; nothing is ever overwritten.

    Returns
    -------
    Appended

    Raises
    ------
    ValueError
        If the folder holds something else than a session, or one of another camera, or the measurement cannot be
        stored. The session is then as it was.
    OSError
        If it cannot be written. The session is then as it was.
    """
    depth = stored_depth(measurement.depth)
    _check_sizes(measurement)
    for name in ('color', 'depth'):
        os.makedirs(os.path.join(folder, name), exist_ok=True)
    written = []
    try:
        with changing(folder) as content:
            _check_camera(folder, measurement, depth.scale_m)
            content.setdefault('camera', _camera_entry(measurement, depth.scale_m))
            entry = _frame_entry(measurement, _next_id(content['frames'], measurement.stamp_ns))
            for name, pixels in (('color', measurement.color[..., ::-1]), ('depth', depth.values)):
                path = os.path.join(folder, entry[name])
                write_whole(path, _png(pixels))
                written.append(path)
            content['frames'].append(entry)
    except BaseException:
        for path in written:
            os.unlink(path)
        raise
    return Appended(entry['id'], len(content['frames']))


def stored_depth(depth):
    """A depth image as a session holds it: 16 bits, unscaled; metres (32FC1) are rounded to millimetres.

    What a camera that counts in whole units measured is kept as it is. Depth in metres that is not finite, not
    positive or beyond 65.535 m becomes 0, not measured.
    """
    if depth.values.dtype.kind == 'u' and depth.values.dtype.itemsize == 2:
        return DepthImage(depth.values.astype(np.uint16), depth.scale_m)
    with np.errstate(invalid='ignore', over='ignore'):
        depth_mm = np.rint(depth.values.astype(float) * (depth.scale_m / MILLIMETRE))
        measured = (depth_mm > 0) & (depth_mm <= FARTHEST_MM)
    return DepthImage(np.where(measured, depth_mm, 0).astype(np.uint16), MILLIMETRE)


def _check_sizes(measurement):
    expected = (measurement.camera.height, measurement.camera.width)
    for name, pixels in (('colour', measurement.color), ('depth', measurement.depth.values)):
        if pixels.shape[:2] != expected:
            raise ValueError('the %s image has %d x %d pixels, where the camera has %d x %d; depth must be aligned to '
                             'colour' % ((name,) + pixels.shape[1::-1] + measurement.camera[:2]))


def _check_camera(folder, measurement, scale_m):
    """Raise ValueError where the session in the folder, if there is one, is of another camera."""
    if not os.path.exists(os.path.join(folder, FILE_NAME)):
        return
    session = read_session(folder)
    for name, stored, own in (('intrinsics', tuple(session.camera), tuple(measurement.camera)),
                              ('depth scale', session.depth_scale_m, scale_m),
                              ('frame', session.frame_id, measurement.frame_id)):
        if stored != own:
            raise ValueError('the session in %s is of another camera: its %s is %s, here it is %s; choose another '
                             'folder' % (folder, name, stored, own))


def _next_id(entries, stamp_ns):
    numbers = [int(match.group(1)) for match in (OWN_ID.match(str(entry['id'])) for entry in entries) if match]
    return '%05d_%d_%09d' % ((max([len(entries)] + numbers) + 1,) + divmod(stamp_ns, NS))


def _camera_entry(measurement, scale_m):
    camera = measurement.camera._asdict()
    model, distortion = camera.pop('distortion_model'), list(camera.pop('distortion'))
    camera.update(distortion=distortion or [0.0] * 5, depth_scale=scale_m, frame=measurement.frame_id)
    if model:
        camera['distortion_model'] = model
    return dict(camera)


def _frame_entry(measurement, name):
    entry = {'id': name, 'color': 'color/%s.png' % name, 'depth': 'depth/%s.png' % name,
             'stamp': '%d.%09d' % divmod(measurement.stamp_ns, NS), 'detections': _detections(measurement)}
    if measurement.label:
        entry['label'] = measurement.label
    return entry


def _detections(measurement):
    """One entry for each 2D box, with what is known of its 3D box, and for 3D boxes whose 2D box is not there."""
    boxes, entries = list(measurement.boxes), []
    width, height = measurement.camera[:2]
    for rect_px in measurement.rects_px:
        inside_px = tuple(np.clip(rect_px, 0, [width, height] * 2).tolist())  # as far as a message tells
        found = next((box for box in boxes if tuple(box.rect_px) in (inside_px, tuple(rect_px))), None)
        entry = {'box': [int(edge) for edge in rect_px]}
        if found is not None:
            boxes = [box for box in boxes if box is not found]
            entry.update(box_entry(found))
        entries.append(entry)
    return entries + [dict(box_entry(box), box=[int(edge) for edge in box.rect_px]) for box in boxes]


def box_entry(box):
    """What a detection has of a Box3D, its 2D box aside. Raises ValueError where that is not finite."""
    values_m = np.append(box.center_m, box.size_m[:2])
    if not np.isfinite(values_m).all():
        raise ValueError('a 3D box has centre %s and size %s; finite expected' % (box.center_m, box.size_m))
    values_mm = [round(1000 * value, 3) for value in values_m.tolist()]
    return {'estimate_mm': values_mm[:3], 'size_mm': values_mm[3:], 'support': round(float(box.support), 6),
            'truncated': bool(box.truncated)}


def _png(pixels):
    done, data = cv2.imencode('.png', np.ascontiguousarray(pixels))
    if not done:
        raise ValueError('an image of type %s and shape %s cannot be written as PNG' % (pixels.dtype, pixels.shape))
    return data.tobytes()
