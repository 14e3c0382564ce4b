"""Edits of entries of frames.json, and their inverses. Lengths in the file are in millimetres."""
import copy
from typing import Any, Dict, NamedTuple, Optional

import numpy as np

from ros_3d_bb.sessions.session_reader import SessionError
from ros_3d_bb.sessions.session_writer import box_entry
from ros_3d_bb_annotator.measurement import Mark

DIGITS = 3  # micrometres: negligible rounding that avoids values such as 1229.9999999999998


class Edit(NamedTuple):
    """New values of fields (None: remove) of the entry `index` with an ID, or of the description if `index` is None."""

    index: Optional[int]
    id: Optional[str]
    changes: Dict[str, Any]


def entry_at(frames, edit):
    """Entry of an edit, which another program may have moved. Raises SessionError if it was removed."""
    for entry in frames[edit.index:edit.index + 1] + frames:
        if isinstance(entry, dict) and str(entry.get('id', '')) == edit.id:
            return entry
    raise SessionError('measurement %s is no longer in the session' % edit.id)


def changed(entry, edit):
    """Apply an edit to an entry in place. Returns the inverse edit."""
    before = {key: copy.deepcopy(entry.get(key)) for key in edit.changes}
    for key, value in edit.changes.items():
        if value is None:
            entry.pop(key, None)
        else:
            entry[key] = copy.deepcopy(value)
    return edit._replace(changes=before)


def detections_with(entry, box_px, box):
    """Detections of an entry, with an additional box drawn by hand and its estimate (Box3D or None)."""
    detections = [dict(detection) for detection in entry.get('detections') or ()]
    if not detections:
        recorded = {'box': entry.get('box'), 'estimate_mm': entry.get('estimate_mm', entry.get('original_mm'))}
        recorded = {key: value for key, value in recorded.items() if value}
        detections = [recorded] if recorded else []
    drawn = {'box': [int(edge) for edge in box_px], 'by': 'hand'}
    return detections + [dict(drawn, **({} if box is None else box_entry(box)))]


def changes_with_estimate(entry, number, box):
    """Changes that add the estimate, a Box3D, to a detection of an entry."""
    if not entry.get('detections'):  # the fields of the only detection are in the entry
        return {'estimate_mm': box_entry(box)['estimate_mm']}
    detections = [dict(detection) for detection in entry['detections']]
    detections[number].update(box_entry(box))
    return {'detections': detections}


def grid_of(content):
    """Marks of a description. Raises KeyError, TypeError or ValueError."""
    marks = tuple(Mark(str(entry['name']), float(entry['x']) / 1000, float(entry['z']) / 1000)
                  for entry in content.get('grid', ()))
    for mark in marks:
        if not np.isfinite(mark[1:]).all():
            raise ValueError('mark %s of the grid is at (%g, %g) m; finite numbers expected' % mark)
    return marks


def millimetres(value_m):
    """Convert metres to millimetres for the file; int if the value is an integer."""
    value_mm = round(1000 * float(value_m), DIGITS)
    return int(value_mm) if value_mm == int(value_mm) else value_mm
