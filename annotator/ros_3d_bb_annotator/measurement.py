"""One measurement in the annotator."""
import os
from typing import NamedTuple, Optional, Tuple

from ros_3d_bb.sessions.session_reader import RecordedDetection, SessionError, frame_of, session_errors

NEW, ANNOTATED, REJECTED = 'new', 'annotated', 'rejected'
# Field of the stretched depth of the old format. Its name differs from that of depth in metric units.
STRETCHED_DEPTH = 'stretched_depth'


class Mark(NamedTuple):
    """Marked position on the floor in the camera's optical frame: X to the right, Z forward, in metres."""

    name: str
    x_m: float
    z_m: float


class EditedMeasurement(NamedTuple):
    """One measurement. `person` is the index of the detection that the truth belongs to, or None without detections;
    `truth_m` is (x, y, z) in the optical frame, where y may be None; `rejected` is the reason for rejection or None;
    `problem` is the fault of an invalid measurement or None. `stamp_text` is '<secs>.<nsecs>' or empty.
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

    @property
    def state(self):
        """'new', 'annotated' or 'rejected'."""
        if self.rejected is not None:
            return REJECTED
        return NEW if self.truth_m is None else ANNOTATED

    @property
    def estimate_m(self):
        """Stored position (3,) of the person, or None."""
        return None if self.person is None else self.detections[self.person].estimate_m


class FileNames(object):
    """Set of existing files, which lists each folder once."""

    def __init__(self):
        self._names = {}

    def __contains__(self, path):
        folder, name = os.path.split(path)
        if folder not in self._names:
            try:
                self._names[folder] = set(os.listdir(folder))
            except OSError:
                self._names[folder] = set()
        return name in self._names[folder]


def measurement_of(folder, entry, files):
    """Measurement of an entry of frames.json. An invalid entry gives a measurement with a `problem`.

    Parameters
    ----------
    folder : str
        Folder of the session.
    entry : object
        Any entry of "frames".
    files : FileNames
    """
    if isinstance(entry, dict) and entry.get('unreadable'):
        return _broken(entry, str(entry['unreadable']))
    try:
        with session_errors('frames.json'):
            frame = frame_of(folder, _with_depth(entry))
    except SessionError as error:
        return _broken(entry, str(error))
    missing = [os.path.relpath(path, folder) for path in (frame.color_path, frame.depth_path) if path not in files]
    truth_m = None if frame.truth_m is None else (float(frame.truth_m[0]), frame.truth_y_m, float(frame.truth_m[1]))
    return EditedMeasurement(frame.id, frame.color_path, frame.depth_path, str(entry.get('stamp') or ''), frame.label,
                             frame.detections, frame.person if frame.detections else None, truth_m, frame.rejected,
                             'there is no file %s' % ' and no file '.join(missing) if missing else None)


def _with_depth(entry):
    if isinstance(entry, dict) and STRETCHED_DEPTH in entry:
        return dict(entry, depth=entry[STRETCHED_DEPTH])
    return entry


def _broken(entry, problem):
    known = entry if isinstance(entry, dict) else {}
    return EditedMeasurement(str(known.get('id', '')), '', '', problem=problem,
                             rejected=str(known['rejected']) if known.get('rejected') else None)
