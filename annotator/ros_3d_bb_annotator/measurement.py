"""One measurement in the annotator."""
import os
from typing import NamedTuple, Optional, Tuple

import numpy as np

from ros_3d_bb.sessions.session_reader import RecordedDetection, SessionError, frame_of, session_errors

NEW, ANNOTATED, REJECTED, NOBODY = 'new', 'annotated', 'rejected', 'nobody found'


class Mark(NamedTuple):
    """Marked position on the floor in the camera's optical frame: X to the right, Z forward, in metres."""

    name: str
    x_m: float
    z_m: float


class EditedMeasurement(NamedTuple):
    """One measurement, with the fields of `session_reader.Measurement`.

    `person` is the selected detection, or None without detections, and `truth_m` its true position (x, y, z), where y
    may be None; `stamp_text` is '<secs>.<nsecs>' or empty; `problem` is the fault of an invalid measurement or None.
    """

    id: str
    color_path: str
    depth_path: str
    stamp_text: str = ''
    label: str = ''
    detections: Tuple[RecordedDetection, ...] = ()
    person: Optional[int] = None
    truth_m: Optional[Tuple[float, Optional[float], float]] = None
    rejected: Optional[str] = None
    problem: Optional[str] = None
    up: Optional[np.ndarray] = None

    @property
    def state(self):
        """NEW, ANNOTATED, REJECTED or NOBODY."""
        if self.rejected is not None:
            return REJECTED
        if not self.detections and self.problem is None:
            return NOBODY
        return ANNOTATED if self.truths else NEW

    @property
    def is_done(self):
        return self.state in (ANNOTATED, REJECTED)

    @property
    def name(self):
        """ID and label."""
        return '%s (%s)' % (self.id, self.label) if self.label else self.id

    @property
    def truths(self):
        """True positions (x, y, z) by the index of their detection; y may be None."""
        truths = {number: truth_of(detection) for number, detection in enumerate(self.detections)
                  if detection.truth_m is not None and number != self.person}
        if self.truth_m is not None and self.person is not None:
            truths[self.person] = self.truth_m
        return truths


def truth_of(annotated):
    """True position (x, y, z) of a measurement or detection of `session_reader`; None if not annotated."""
    if annotated.truth_m is None:
        return None
    return float(annotated.truth_m[0]), annotated.truth_y_m, float(annotated.truth_m[1])


def measurement_of(folder, entry):
    """Measurement of an entry of the session in a folder; that of an invalid entry has a `problem`."""
    known = entry if isinstance(entry, dict) else {}
    try:
        with session_errors('frames.json'):
            frame = frame_of(folder, entry)
    except SessionError as error:
        return EditedMeasurement(str(known.get('id', '')), '', '', problem=str(error),
                                 rejected=str(known['rejected']) if known.get('rejected') else None)
    missing = [os.path.relpath(path, folder) for path in (frame.color_path, frame.depth_path)
               if not os.path.exists(path)]
    return EditedMeasurement(
        frame.id, frame.color_path, frame.depth_path, str(entry.get('stamp') or ''), frame.label, frame.detections,
        frame.person if frame.detections else None, truth_of(frame), frame.rejected,
        'there is no file %s' % ' and no file '.join(missing) if missing else None, frame.up)
