"""Edits of frames.json: what changes in an entry, and what takes the change back. Lengths there are millimetres."""
import copy
from typing import Any, Dict, NamedTuple, Optional

import numpy as np

from ros_3d_bb.measurements import SessionError
from ros_3d_bb.recording import box_entry
from ros_3d_bb_annotator.measurement import Mark

DIGITS = 3  # micrometres: no rounding that anybody sees, and no 1229.9999999999998


class Edit(NamedTuple):
    """New values of fields, None for those to be removed, in the entry number `index` with the id `id`; in the
    description itself where `index` is None.
    """

    index: Optional[int]
    id: Optional[str]
    changes: Dict[str, Any]


def entry_at(frames, edit):
    """The entry that an edit means, which another program may have moved. Raises SessionError where it is gone."""
    for entry in frames[edit.index:edit.index + 1] + frames:
        if isinstance(entry, dict) and str(entry.get('id', '')) == edit.id:
            return entry
    raise SessionError('measurement %s is no longer in the session' % edit.id)


def changed(entry, edit):
    """Change an entry in place; returns the edit that undoes it."""
    before = {key: copy.deepcopy(entry.get(key)) for key in edit.changes}
    for key, value in edit.changes.items():
        if value is None:
            entry.pop(key, None)
        else:
            entry[key] = copy.deepcopy(value)
    return edit._replace(changes=before)


def detections_with(entry, box_px, box):
    """The detections of an entry, and one more with a box drawn by hand and its estimate (Box3D or None)."""
    detections = [dict(detection) for detection in entry.get('detections') or ()]
    if not detections:
        recorded = {'box': entry.get('box'), 'estimate_mm': entry.get('estimate_mm', entry.get('original_mm'))}
        detections = [{key: value for key, value in recorded.items() if value}] if any(recorded.values()) else []
    drawn = {'box': [int(edge) for edge in box_px], 'by': 'hand'}
    return detections + [dict(drawn, **({} if box is None else box_entry(box)))]


def changes_with_estimate(entry, number, box):
    """The changes that give the detection of a number in an entry its estimate, a Box3D."""
    if not entry.get('detections'):  # its only box is in the entry itself
        return {'estimate_mm': box_entry(box)['estimate_mm']}
    detections = [dict(detection) for detection in entry['detections']]
    detections[number].update(box_entry(box))
    return {'detections': detections}


def grid_of(content):
    """The marks of a description. Raises KeyError, TypeError or ValueError."""
    marks = [Mark(str(entry['name']), float(entry['x']) / 1000, float(entry['z']) / 1000)
             for entry in content.get('grid', ())]
    for mark in marks:
        if not np.isfinite(mark[1:]).all():
            raise ValueError('mark %s of the grid has no finite position' % mark.name)
    return tuple(marks)


def grid_entry(mark):
    """A mark as it is stored."""
    return {'name': mark.name, 'x': millimetres(mark.x_m), 'z': millimetres(mark.z_m)}


def millimetres(value_m):
    """Metres as a number of millimetres for the file, an int where it is whole."""
    value_mm = round(1000 * float(value_m), DIGITS)
    return int(value_mm) if value_mm == int(value_mm) else value_mm
