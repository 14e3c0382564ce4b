"""Reader of measurement sessions: folders of colour and depth images with boxes, estimates and ground truth.

The folder contains `frames.json` with the camera (lens distortion as k1, k2, p1, p2, k3 of plumb_bob, unless it names
another model) and the frames, colour images as 8-bit PNG, and depth images as 16-bit PNG in units of the camera's
depth_scale. Lengths are in millimetres in the file and in metres here. doc/session.md describes the format.
"""
import contextlib
import json
import os
import re
from typing import NamedTuple, Optional, Tuple

import cv2
import numpy as np

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.camera.distortion import PLUMB_BOB
from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.detection.boxes import iou
from ros_3d_bb.estimation.body import truncated_edges
from ros_3d_bb.estimation.box3d import plausible
from ros_3d_bb.estimation.box3d_estimator import estimate_boxes, level_rotation

FILE_NAME = 'frames.json'
NEW, ANNOTATED, REJECTED, NOBODY = 'new', 'annotated', 'rejected', 'nobody found'  # states of a measurement
SAME_PERSON_IOU = 0.3  # low, because a detector may find half of a body; boxes of two people seldom overlap so much


class SessionError(ValueError):
    """Measurement session that cannot be read. The message names the file, the fault, and what was expected."""


class RecordedDetection(NamedTuple):
    """Detected person in an image. Values that are not stored are None.

    `box_px` is (x1, y1, x2, y2), `estimate_m` (x, y, z) in the optical frame, `size_m` (width, height). `support` and
    `truncated` are those of box3d.Box3D. `by_hand`: a user drew the box. `truth_m` is the ground truth of this person
    as of a Measurement, unless it is stored there.
    """

    box_px: Optional[Tuple[int, int, int, int]]
    estimate_m: Optional[np.ndarray]
    size_m: Optional[np.ndarray] = None
    support: Optional[float] = None
    truncated: Optional[bool] = None
    by_hand: bool = False
    truth_m: Optional[Tuple[float, Optional[float], float]] = None


class Measurement(NamedTuple):
    """One measurement.

    `person` is the index of the selected detection, None without detections, and `truth_m` its true position (x, y, z)
    in the optical frame, where y may be None; None if not annotated. `rejected` is the reason why the measurement is
    excluded, or None. `stamp_ns` is the stamp of the image, or None if not stored. `up` is the unit vector that points
    up, in the optical frame, or None if unknown. `problem` is the fault of an invalid entry, or None.
    """

    id: str
    color_path: str = ''
    depth_path: str = ''
    detections: Tuple[RecordedDetection, ...] = ()
    person: Optional[int] = None
    truth_m: Optional[Tuple[float, Optional[float], float]] = None
    rejected: Optional[str] = None
    stamp_ns: Optional[int] = None
    label: str = ''
    up: Optional[np.ndarray] = None
    problem: Optional[str] = None

    @property
    def level_from_camera(self):
        return level_rotation(self.up)

    @property
    def boxes_px(self):
        """2D boxes of the people, beginning with the selected person; empty if the box of that person is not stored.

        A box drawn by hand replaces detected boxes of the same person.
        """
        if not self.detections or self.detections[self.person].box_px is None:
            return ()
        person = self.detections[self.person]
        others_px = tuple(detection.box_px for number, detection in enumerate(self.detections)
                          if number != self.person and detection.box_px is not None)
        return (person.box_px,) + (boxes_of_others(person.box_px, others_px) if person.by_hand else others_px)

    @property
    def name(self):
        return '%s (%s)' % (self.id, self.label) if self.label else self.id

    @property
    def stamp_text(self):
        """Stamp as '<secs>.<nsecs>', or '' if it is not stored."""
        return '' if self.stamp_ns is None else '%d.%09d' % divmod(self.stamp_ns, NS)

    @property
    def estimate_m(self):
        """Stored position (3,) of the selected person, or None."""
        return self.detections[self.person].estimate_m if self.detections else None

    def truncated_edges(self, camera):
        """Whether the left, upper, right and lower image border truncates the box of the selected person."""
        return truncated_edges(self.boxes_px[0], (0, 0) + camera[:2]) if self.boxes_px else (False,) * 4

    def estimate(self, depth, camera, estimator):
        """Estimate the Box3D of the selected person, considering the boxes of other people; None if there is none."""
        boxes = estimate_boxes(depth, self.boxes_px, camera, estimator, self.level_from_camera)
        return plausible(boxes[0]) if boxes else None

    @property
    def state(self):
        if self.rejected is not None:
            return REJECTED
        if not self.detections and self.problem is None:
            return NOBODY
        return ANNOTATED if self.truths else NEW

    @property
    def is_done(self):
        return self.state in (ANNOTATED, REJECTED)

    @property
    def truths(self):
        """True positions (x, y, z) by the index of their detection."""
        return {one.person: one.truth_m for one in annotated_people([self]) if one.person is not None}


class Session(NamedTuple):
    """Measurement session: camera, metres per depth unit, camera frame, and measurements."""

    camera: Camera
    depth_scale_m: float
    frame_id: str
    frames: Tuple[Measurement, ...]


def read_session(folder, on_left_out=None):
    """Read the `frames.json` of a session, without rejected frames. `read_color` and `read_depth` read the images.

    Raises SessionError if the folder is not a session, or a field is missing or invalid. With `on_left_out`, invalid
    frames are left out as rejected ones are, and it is called with their names and reasons.
    """
    content, frames = read_description(folder), []
    with session_errors(os.path.join(str(folder), FILE_NAME)):
        session = Session(*camera_of(content), ())
    for number, entry in enumerate(content['frames'], 1):
        frame = measurement_of(str(folder), entry)
        if frame.rejected is None and frame.problem is None:
            frames.append(frame)
        elif on_left_out is not None:
            on_left_out(frame.name if frame.id else 'measurement number %d' % number,
                        frame.problem if frame.rejected is None else 'rejected: %s' % frame.rejected)
        elif frame.rejected is None:
            raise SessionError('%s, measurement number %d: %s' % (folder, number, frame.problem))
    return session._replace(frames=tuple(frames))


def annotated_people(frames):
    """One Measurement for each person with ground truth in frames, in which several people may stand on marks."""
    for frame in frames:
        if frame.truth_m is not None:
            yield frame
        for number, detection in enumerate(frame.detections):
            if number != frame.person and detection.truth_m is not None:
                yield frame._replace(person=number, truth_m=detection.truth_m)


def read_description(folder):
    """Content of the `frames.json` of a folder as a dictionary with a list of frames. Raises SessionError."""
    path = os.path.join(str(folder), FILE_NAME)
    try:
        with session_errors(path), open(path, encoding='utf-8') as stream:
            content = json.load(stream)
            if not isinstance(content, dict) or not isinstance(content.get('frames'), list):
                raise ValueError('an object with frames expected')
            return content
    except OSError as error:
        raise SessionError('%s: not a measurement session (%s); expected a folder with frames.json, color/ and depth/'
                           % (folder, error.strerror))


@contextlib.contextmanager
def session_errors(where):
    """Convert exceptions from reading an invalid description to a SessionError, whose text starts with `where`."""
    try:
        yield
    except SessionError:
        raise
    except KeyError as error:
        raise SessionError('%s: the field %s is missing' % (where, error))
    except (TypeError, ValueError, AttributeError, OverflowError, RecursionError) as error:
        raise SessionError('%s: not the description of a measurement session (%s)' % (where, error))


def camera_of(content):
    """(Camera, metres per depth unit, camera frame) of a description. For exceptions see `session_errors`."""
    camera = content['camera']
    if not 0 < float(camera['depth_scale']) < 1:
        raise ValueError('depth_scale is %s; metres per unit expected, such as 0.001' % camera['depth_scale'])
    intrinsics = (camera[name] for name in ('width', 'height', 'fx', 'fy', 'cx', 'cy'))
    return (Camera(*intrinsics, distortion_model=camera.get('distortion_model', PLUMB_BOB),
                   distortion=camera.get('distortion', ())), float(camera['depth_scale']), str(camera['frame']))


def measurement_of(folder, entry):
    """Measurement of an entry of a description; that of an invalid entry has a `problem`."""
    try:
        with session_errors(FILE_NAME):
            return _valid_measurement(folder, entry)
    except SessionError as error:
        known = entry if isinstance(entry, dict) else {}
        return Measurement(str(known.get('id', '')), rejected=str(known['rejected']) if known.get('rejected') else None,
                           label=str(known.get('label', '')), problem=str(error))


def _valid_measurement(folder, entry):
    if not isinstance(entry, dict):
        raise ValueError('a measurement is %.60r; an object expected' % (entry,))
    # sessions with one box per frame store the fields of the detection in the frame
    detections = entry.get('detections') or ([entry] if {'box', 'estimate_mm', 'original_mm'} & set(entry) else [])
    person, stamp = int(entry.get('person', 0)), entry.get('stamp')
    if not 0 <= person < max(1, len(detections)):
        raise ValueError('person is %d, but there are %d detections' % (person, len(detections)))
    return Measurement(
        str(entry['id']), os.path.join(folder, entry['color']), os.path.join(folder, entry['depth']),
        tuple(_detection_from(detection) for detection in detections), person if detections else None,
        _truth_from(entry.get('truth_mm')), str(entry['rejected']) if entry.get('rejected') else None,
        None if stamp is None else _stamp_ns_from(stamp), str(entry.get('label', '')), _up_from(entry.get('up')))


def read_color(frame, camera):
    """Read the colour image of a frame, RGB (h, w, 3), uint8, of any size if `camera` is None. Raises SessionError."""
    image = read_image(frame.color_path, camera)
    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
        raise SessionError('%s: 8-bit colour image expected' % frame.color_path)
    return image[..., ::-1]


def read_depth(frame, session):
    """Read the DepthImage of a frame. Raises SessionError."""
    image = read_image(frame.depth_path, session.camera)
    if image.dtype != np.uint16 or image.ndim != 2:
        raise SessionError('%s: 16-bit depth image with one channel expected; 8-bit images have no depth scale'
                           % frame.depth_path)
    return DepthImage(image, session.depth_scale_m)


def read_image(path, camera=None):
    """Read an image (height, width, ...) as it is stored. Raises SessionError, also if its size is not the camera's."""
    try:
        image = cv2.imread(path, cv2.IMREAD_UNCHANGED)
    except cv2.error:  # more pixels than OpenCV accepts
        image = None
    if image is None:
        raise SessionError('%s: missing, or not an image' % path)
    if camera is not None and image.shape[:2] != (camera.height, camera.width):
        raise SessionError('%s: %d x %d pixels, but the camera has %d x %d'
                           % (path, image.shape[1], image.shape[0], camera.width, camera.height))
    return image


def boxes_of_others(box_px, boxes_px):
    """Select the 2D boxes of other people, which overlap `box_px` by at most SAME_PERSON_IOU."""
    overlaps = iou(box_px, boxes_px)
    return tuple(other_px for other_px, overlap in zip(boxes_px, overlaps) if overlap <= SAME_PERSON_IOU)


def _detection_from(entry):
    estimate_m = _metres(entry.get('estimate_mm', entry.get('original_mm')), 3)
    support, truncated = entry.get('support'), entry.get('truncated')
    return RecordedDetection(tuple(int(edge) for edge in _numbers(entry['box'], 4)) if entry.get('box') else None,
                             estimate_m, _metres(entry.get('size_mm'), 2),
                             None if support is None else float(_numbers([support], 1)[0]),
                             None if truncated is None else bool(truncated), entry.get('by') == 'hand',
                             _truth_from(entry.get('truth_mm') if 'color' not in entry else None))


def _truth_from(truth_mm):
    """(x, y, z) in metres of a field truth_mm, where y may be None; None if it is missing."""
    if truth_mm is None:
        return None
    (x_m, z_m), y_mm = _metres([truth_mm['x'], truth_mm['z']], 2).tolist(), truth_mm.get('y')
    return x_m, None if y_mm is None else float(_metres([y_mm], 1)[0]), z_m


def _up_from(values):
    if values is None:
        return None
    up = _numbers(values, 3)
    if not up.any():
        raise ValueError('up is %s; a direction in the optical frame expected' % values)
    return up / np.linalg.norm(up)


def _stamp_ns_from(text):
    """Parse '<secs>.<nsecs, 9 digits>' to nanoseconds."""
    match = re.match(r'([0-9]{1,12})\.([0-9]{9})$', str(text))
    if match is None:
        raise ValueError('stamp is %.40r; seconds, a point and nine digits of nanoseconds expected' % (text,))
    return int(match.group(1)) * NS + int(match.group(2))


def _metres(values_mm, count):
    return None if values_mm is None else _numbers(values_mm, count) / 1000


def _numbers(values, count):
    numbers = np.array(values, float)
    if numbers.shape != (count,) or not np.isfinite(numbers).all():
        raise ValueError('%s are not %d finite numbers' % (str(values)[:100], count))
    return numbers
