"""Edits of entries of frames.json, and their inverses. Lengths in the file are in millimetres."""
import copy
from typing import Any, Dict, NamedTuple, Optional

import numpy as np

from ros_3d_bb.sessions.session_reader import SessionError
from ros_3d_bb.sessions.session_writer import box_entry
from ros_3d_bb_annotator.marks import Mark

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


def detections_of(entry):
    """Copies of the detections of an entry. If the fields of the only detection are in the entry, they are moved."""
    if entry.get('detections'):
        return [dict(detection) for detection in entry['detections']]
    recorded = {'box': entry.get('box'), 'estimate_mm': entry.get('estimate_mm', entry.get('original_mm'))}
    recorded = {key: value for key, value in recorded.items() if value}
    return [recorded] if recorded else []


def people_of(entry):
    people = detections_of(entry)
    if people and entry.get('truth_mm'):
        people[int(entry.get('person', 0))]['truth_mm'] = entry['truth_mm']
    return people


def changes_of(entry, people, person):
    """Changes of an entry that store people, and select one by the index; None: by default the first one."""
    detections = [dict(one) for one in people]
    truth_mm = detections[person or 0].pop('truth_mm', None) if detections else None
    changes = {'person': person, 'truth_mm': truth_mm}
    if detections != detections_of(entry):
        changes.update(detections=detections, box=None, estimate_mm=None, original_mm=None)
    return {key: value for key, value in changes.items() if value != entry.get(key)}


def drawn(box_px, box):
    """Detection of a box drawn by hand, and its estimate (Box3D or None)."""
    return dict({'box': [int(edge) for edge in box_px], 'by': 'hand'}, **({} if box is None else box_entry(box)))


def truth_entry(x_m, z_m, y_m):
    """Field truth_mm of a true position in metres, whose y may be None."""
    truth_mm = {'x': millimetres(x_m), 'z': millimetres(z_m)}
    return truth_mm if y_m is None else dict(truth_mm, y=millimetres(y_m))


def grid_of(content):
    """Marks of a description. Raises KeyError, TypeError or ValueError."""
    marks = tuple(Mark(str(entry['name']), float(entry['x']) / 1000, float(entry['z']) / 1000)
                  for entry in content.get('grid', ()))
    for mark in marks:
        if not np.isfinite(mark[1:]).all():
            raise ValueError('mark %s of the grid is at (%g, %g) m; finite numbers expected' % mark)
    return marks


def mark_entry(mark):
    return {'name': mark.name, 'x': millimetres(mark.x_m), 'z': millimetres(mark.z_m)}


def millimetres(value_m):
    """Convert metres to millimetres for the file; int if the value is an integer."""
    value_mm = round(1000 * float(value_m), DIGITS)
    return int(value_mm) if value_mm == int(value_mm) else value_mm
