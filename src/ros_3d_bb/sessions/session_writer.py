"""Writer of measurement sessions. Measurements are appended atomically; `session_reader` reads them.

Images are written before frames.json, so that frames.json never refers to a missing image. Lengths are in millimetres
in the file and in metres here.
"""
import contextlib
import fcntl
import json
import os
import re

import cv2
import numpy as np

from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.core.atomic_file import atomic_write
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.sessions.session_reader import FILE_NAME, camera_of, read_description, session_errors

MILLIMETRE = 0.001
MAX_DEPTH_MM = 65535  # largest value in 16 bits
ID_FORMAT = re.compile(r'(\d+)_\d+_\d{9}$')


def append(folder, snapshot, label=''):
    """Append a `snapshots.Snapshot` to the session in a folder, which is created if it does not exist.

    Returns the ID of the measurement (the next free number and the stamp), and the number of measurements in the
    session. Raises ValueError if the folder is not a session, the session is of another camera, or the measurement
    cannot be stored, and OSError if the session cannot be written. The session is unchanged then.
    """
    depth = stored_depth(snapshot.depth)
    for name, pixels in (('colour', snapshot.color.pixels), ('depth', snapshot.depth.values)):
        if pixels.shape[:2] != (snapshot.camera.height, snapshot.camera.width):
            raise ValueError('the %s image has %d x %d pixels and the camera has %d x %d; depth aligned to colour '
                             'expected' % ((name,) + pixels.shape[1::-1] + snapshot.camera[:2]))
    for name in ('color', 'depth'):
        os.makedirs(os.path.join(folder, name), exist_ok=True)
    written = []
    try:
        with locked_update(folder) as content:
            _check_camera(folder, content, snapshot, depth.scale_m)
            content.setdefault('camera', _camera_entry(snapshot, depth.scale_m))
            name = _next_id(content['frames'], snapshot.stamp_ns)
            entry = {'id': name, 'color': 'color/%s.png' % name, 'depth': 'depth/%s.png' % name,
                     'stamp': '%d.%09d' % divmod(snapshot.stamp_ns, NS), 'detections': _detections(snapshot)}
            if label:
                entry['label'] = label
            if snapshot.up is not None:
                entry['up'] = snapshot.up.round(6).tolist()
            for kind, pixels in (('color', snapshot.color.pixels[..., ::-1]), ('depth', depth.values)):
                path = os.path.join(folder, entry[kind])
                atomic_write(path, _png(pixels))
                written.append(path)
            content['frames'].append(entry)
    except BaseException:
        for path in written:
            os.unlink(path)
        raise
    return entry['id'], len(content['frames'])


@contextlib.contextmanager
def locked_update(folder):
    """Lock the description of a session in an existing folder, and write it when the block ends without an error.

    Other programs wait for the lock, so that the viewer can add measurements to a session that is being annotated.
    Yields the content of frames.json, a dict to be modified in place; {'frames': []} if the file does not exist. Raises
    OSError if the folder cannot be read or written, and ValueError if frames.json is not the description of a session,
    or the new content has nan or inf.
    """
    path = os.path.join(str(folder), FILE_NAME)
    with open(os.path.join(str(folder), '.lock'), 'a') as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        content = read_description(folder) if os.path.exists(path) else {'frames': []}
        yield content
        atomic_write(path, _text_of(content).encode())


def stored_depth(depth):
    """Convert a depth image to the format of sessions: 16 bits, unscaled.

    Integer depth is kept as it is. Depth in metres (32FC1) is rounded to millimetres; values that are not finite, not
    positive or more than 65.535 m become 0, no depth.
    """
    if depth.values.dtype.kind == 'u' and depth.values.dtype.itemsize == 2:
        return DepthImage(depth.values.astype(np.uint16), depth.scale_m)
    with np.errstate(invalid='ignore', over='ignore'):
        depth_mm = np.rint(depth.values.astype(float) * (depth.scale_m / MILLIMETRE))
        valid = (depth_mm > 0) & (depth_mm <= MAX_DEPTH_MM)
    return DepthImage(np.where(valid, depth_mm, 0).astype(np.uint16), MILLIMETRE)


def _check_camera(folder, content, snapshot, scale_m):
    """Raise ValueError if the description of a folder is that of a session of another camera."""
    if content == {'frames': []}:
        return
    with session_errors(os.path.join(folder, FILE_NAME)):
        cameras = zip(('intrinsics', 'depth scale', 'frame'), camera_of(content),
                      (snapshot.camera, scale_m, snapshot.color.frame_id))
    for name, stored, actual in cameras:
        if stored != actual:
            raise ValueError('the session in %s was recorded by another camera: its %s is %s, but this camera\'s is '
                             '%s; choose another folder' % (folder, name, stored, actual))


def _next_id(entries, stamp_ns):
    matches = [ID_FORMAT.match(str(entry.get('id'))) for entry in entries if isinstance(entry, dict)]
    numbers = [int(match.group(1)) for match in matches if match]
    return '%05d_%d_%09d' % ((max([len(entries)] + numbers) + 1,) + divmod(stamp_ns, NS))


def _camera_entry(snapshot, scale_m):
    camera = dict(snapshot.camera._asdict())
    model, distortion = camera.pop('distortion_model'), list(camera.pop('distortion'))
    camera.update(distortion=distortion or [0.0] * 5, depth_scale=scale_m, frame=snapshot.color.frame_id)
    if model:
        camera['distortion_model'] = model
    return camera


def _detections(snapshot):
    """Entries of the 2D boxes with their 3D boxes, and of 3D boxes whose 2D box is missing."""
    boxes, entries = list(snapshot.boxes3d or ()), []
    width, height = snapshot.camera[:2]
    for rect_px in snapshot.boxes2d or ():
        inside_px = tuple(np.clip(rect_px, 0, [width, height] * 2).tolist())  # 3D boxes in messages are clipped
        match = next((box for box in boxes if tuple(box.rect_px) in (inside_px, tuple(rect_px))), None)
        entry = {'box': [int(edge) for edge in rect_px]}
        if match is not None:
            boxes = [box for box in boxes if box is not match]
            entry.update(box_entry(match))
        entries.append(entry)
    return entries + [dict(box_entry(box), box=[int(edge) for edge in box.rect_px]) for box in boxes]


def box_entry(box):
    """Fields of a detection that describe a Box3D, without its 2D box. Raises ValueError if one is not finite."""
    values_m = np.append(box.center_m, box.size_m[:2])
    if not np.isfinite(values_m).all():
        raise ValueError('a 3D box has centre %s and size %s; finite numbers expected' % (box.center_m, box.size_m))
    values_mm = [round(1000 * value, 3) for value in values_m.tolist()]
    return {'estimate_mm': values_mm[:3], 'size_mm': values_mm[3:], 'support': round(float(box.support), 6),
            'truncated': bool(box.truncated)}


def _png(pixels):
    is_encoded, data = cv2.imencode('.png', np.ascontiguousarray(pixels))
    if not is_encoded:
        raise ValueError('an image of type %s and shape %s cannot be written as PNG' % (pixels.dtype, pixels.shape))
    return data.tobytes()


def _text_of(content):
    """Format a description with one line per field and frame: readable, and faster than an indented dump."""
    frames = ',\n'.join(' ' + json.dumps(frame, allow_nan=False) for frame in content['frames'])
    fields = ['%s: %s' % (json.dumps(str(key)), json.dumps(value, allow_nan=False))
              for key, value in content.items() if key != 'frames']
    return '{\n%s\n}\n' % ',\n'.join(fields + ['"frames": [\n%s\n]' % frames])
