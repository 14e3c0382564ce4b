"""Model of a measurement session that is being annotated. Every edit is saved immediately, and can be undone.

Positions are in the camera's optical frame, in metres. Only the edited fields of measurements are written, so a viewer
can add measurements to the same session concurrently.
"""
import copy
import json
import os

import numpy as np

from ros_3d_bb.camera.depth_image import FARTHEST_M
from ros_3d_bb.core.atomic_file import FILE_NAME, atomic_write, locked_update
from ros_3d_bb.estimation.box3d_estimator import check_rect, estimate_boxes, estimator_named
from ros_3d_bb.sessions.session_reader import (Session, SessionError, camera_of, boxes_of_others, read_color,
                                               read_depth, read_description, session_errors)
from ros_3d_bb_annotator import legacy
from ros_3d_bb_annotator.entries import (Edit, changed, changes_with_estimate, detections_with, entry_at, grid_of,
                                         millimetres)
from ros_3d_bb_annotator.measurement import ANNOTATED, NEW, FileNames, measurement_of

ESTIMATOR = 'foreground'  # the default of bbox3d_node
DRAFTS_NAME = '.annotator_draft.json'  # exists while there are drafts


class Document(object):
    """Session that is being annotated. Use `Document.open` to create one.

    `measurements` are EditedMeasurements in the order of the file; an index remains valid while the document is open.
    `grid` are the Marks on the floor. `is_old_format` is whether the session has the format of the thesis, without
    `camera` (None) and usable depth. `notes` are messages to the user on data that cannot be recovered.
    """

    def __init__(self, folder, content):
        self.folder, self.measurements = folder, ()
        self.is_old_format = content.get('form') == legacy.FORM
        self.notes = legacy.NOTES if self.is_old_format else ()
        self._session = Session(*(None, None, '') if self.is_old_format else camera_of(content), frames=())
        self.camera = self._session.camera
        self._content, self._signature = {'frames': []}, None
        self._undo, self._redo, self._annotated = [], [], []
        self._drafts_path = os.path.join(folder, DRAFTS_NAME)
        self._drafts = _read_drafts(self._drafts_path)
        self._update(content)

    @classmethod
    def open(cls, folder):
        """Open the session in a folder, without reading images. Raises SessionError if it cannot be opened."""
        folder = os.path.abspath(str(folder))
        content = legacy.read(folder) if legacy.is_old_format(folder) else read_description(folder)
        with session_errors(os.path.join(folder, FILE_NAME)):
            return cls(folder, content)

    @property
    def progress(self):
        """(number of annotated or rejected measurements, number of all measurements)."""
        return sum(measurement.state != NEW for measurement in self.measurements), len(self.measurements)

    def refresh(self):
        """Read changes by other programs. Returns whether there were any. Raises SessionError."""
        signature = _signature(self.folder)  # before reading, so that concurrent changes are detected next time
        if self._signature == signature:
            return False
        before = self._content
        content = read_description(self.folder)
        with session_errors(os.path.join(self.folder, FILE_NAME)):
            self._update(content)
        self._signature = signature
        return content != before

    def color(self, index):
        """Read the colour image of a measurement, see `read_color`."""
        return read_color(self._usable(index), self.camera)

    def depth(self, index):
        """Read the depth image of a measurement, see `read_depth`."""
        if self.is_old_format:
            raise SessionError(legacy.NOTES[0])
        return read_depth(self._usable(index), self._session)

    def stretched_depth(self, index):
        """Read the unitless depth image of a measurement in the old format, see `legacy.read_stretched`."""
        return legacy.read_stretched(self._usable(index).depth_path)

    def estimated(self, index, box_px):
        """Estimate the Box3D of a 2D box (x1, y1, x2, y2) in a measurement, considering the boxes of other people.

        Returns None if there is not enough depth. Raises ValueError if the depth cannot be read, or the box is empty.
        """
        box_px = tuple(int(edge) for edge in box_px)
        check_rect(box_px)
        detections = self.measurements[index].detections
        others_px = [detection.box_px for detection in detections if detection.box_px not in (None, box_px)]
        if not any(detection.box_px == box_px and not detection.by_hand for detection in detections):
            others_px = boxes_of_others(box_px, others_px)  # a box by hand replaces those of the same person
        boxes_px = [box_px] + list(others_px)
        return estimate_boxes(self.depth(index), boxes_px, self.camera, estimator_named(ESTIMATOR))[0]

    def errors(self, index):
        """Estimate minus truth (x, z, distance on the floor) in metres; None if either is missing."""
        measurement = self.measurements[index]
        if measurement.truth_m is None or measurement.estimate_m is None:
            return None
        dx_m, dz_m = (float(measurement.estimate_m[axis] - measurement.truth_m[axis]) for axis in (0, 2))
        return dx_m, dz_m, float(np.hypot(dx_m, dz_m))

    def set_truth(self, index, x_m, z_m, y_m=None):
        """Set the true position of the person, in front of the camera, and restore a rejected measurement.

        The person's box is estimated if no estimate is stored.
        """
        values_m = [value for value in (x_m, y_m, z_m) if value is not None]
        if not np.isfinite(values_m).all() or max(np.abs(values_m)) > FARTHEST_M:
            raise ValueError('truth %s is not a position within %g m' % (values_m, FARTHEST_M))
        if not z_m > 0:
            raise ValueError('truth z is %g m; more than 0 expected, as the camera looks along z' % z_m)
        truth_mm = {'x': millimetres(x_m), 'z': millimetres(z_m)}
        if y_m is not None:
            truth_mm['y'] = millimetres(y_m)
        estimate = self._missing_estimate(index, self._usable(index).person)
        self._edit(index, dict(estimate, truth_mm=truth_mm, rejected=None))
        self._annotated.append(index)
        self.set_draft(index, {})

    def set_same_as_last(self, index):
        """Set the truth of the last annotated measurement, or else of the nearest one before."""
        for last in self._annotated[::-1] + list(range(index - 1, -1, -1)):
            if last != index and self.measurements[last].state == ANNOTATED:
                x_m, y_m, z_m = self.measurements[last].truth_m
                return self.set_truth(index, x_m, z_m, y_m)
        raise ValueError('no other measurement is annotated whose truth could be copied to measurement %s'
                         % self.measurements[index].id)

    def choose_person(self, index, detection):
        """Select the detection that the truth belongs to, by its index. It is estimated if no estimate is stored."""
        count = len(self.measurements[index].detections)
        if not 0 <= detection < count:
            raise ValueError('detection %d does not exist; there are %d detections' % (detection, count))
        self._edit(index, dict(self._missing_estimate(index, detection), person=int(detection)))

    def add_box(self, index, box_px):
        """Add a box (x1, y1, x2, y2) drawn by hand, select it as the person, and return its estimate as `estimated`."""
        if self.camera is None:
            raise SessionError(legacy.NOTES[0])
        x1, y1, x2, y2 = (int(round(edge)) for edge in box_px)
        box_px = max(x1, 0), max(y1, 0), min(x2, self.camera.width), min(y2, self.camera.height)
        box = self.estimated(index, box_px)
        detections = detections_with(self._content['frames'][index], box_px, box)
        self._edit(index, {'detections': detections, 'person': len(detections) - 1,
                           'box': None, 'estimate_mm': None, 'original_mm': None})
        return box

    def reject(self, index, reason):
        if not reason.strip():
            raise ValueError('a reason is needed to reject a measurement')
        self._edit(index, {'rejected': reason.strip()})
        self.set_draft(index, {})

    def restore(self, index):
        self._edit(index, {'rejected': None})

    def set_grid(self, marks):
        self._edit(None, {'grid': [
            {'name': mark.name, 'x': millimetres(mark.x_m), 'z': millimetres(mark.z_m)} for mark in marks]})

    @property
    def can_undo(self):
        return bool(self._undo)

    @property
    def can_redo(self):
        return bool(self._redo)

    def undo(self):
        """Undo the last edit. Returns the changed index, or None for the grid or no edit."""
        return self._step(self._undo, self._redo)

    def redo(self):
        """Redo the last undone edit. Returns the same as `undo`."""
        return self._step(self._redo, self._undo)

    def draft(self, index):
        """Draft of a measurement, the text that was typed but not entered: {name of a field: text}."""
        return dict(self._drafts.get(self.measurements[index].id, {}))

    def set_draft(self, index, fields):
        """Save the draft of a measurement in a file, so that it survives a crash. Empty fields are removed."""
        fields = {key: text for key, text in fields.items() if text}
        if fields == self.draft(index):
            return
        self._drafts[self.measurements[index].id] = fields
        used = {name: texts for name, texts in self._drafts.items() if texts}
        try:
            if used:
                atomic_write(self._drafts_path, json.dumps(used).encode())
            elif os.path.exists(self._drafts_path):
                os.remove(self._drafts_path)
        except OSError as error:
            raise SessionError('%s: the typed text cannot be saved (%s)' % (self._drafts_path, error.strerror))

    def _missing_estimate(self, index, person):
        """Changes that add the estimate of a detection; {} if it has one, or it cannot be estimated."""
        detection = None if person is None else self.measurements[index].detections[person]
        if detection is None or detection.estimate_m is not None or detection.box_px is None:
            return {}
        try:
            box = self.estimated(index, detection.box_px)
        except ValueError:  # no depth, or a reversed box: the truth is valid nevertheless, and validation reports it
            return {}
        return {} if box is None else changes_with_estimate(self._content['frames'][index], person, box)

    def _usable(self, index):
        measurement = self.measurements[index]
        if not measurement.color_path:
            raise SessionError('measurement %s: %s' % (measurement.id or index, measurement.problem))
        return measurement

    def _edit(self, index, changes):
        name = None if index is None else self.measurements[index].id
        if name == '':
            raise SessionError('measurement %d has no id, so its annotation cannot be saved' % index)
        self._undo.append(self._save(Edit(index, name, changes)))
        del self._redo[:]

    def _step(self, source, target):
        if not source:
            return None
        target.append(self._save(source[-1]))
        return source.pop().index

    def _save(self, edit):
        """Write an edit. Returns its inverse."""
        try:
            with locked_update(self.folder) as content:
                if self.is_old_format and 'form' not in content:
                    content.update(copy.deepcopy(self._content))
                inverse = changed(content if edit.index is None else entry_at(content['frames'], edit), edit)
        except (OSError, ValueError) as error:
            raise SessionError('%s: cannot be saved (%s)' % (self.folder, getattr(error, 'strerror', error)))
        self._update(content)
        self._signature = None  # another program may write before the next refresh
        return inverse

    def _update(self, content):
        """Update from the content of frames.json. Unchanged measurements are not parsed again."""
        frames, old, files = content['frames'], self._content['frames'], FileNames()
        self.measurements = tuple(
            self.measurements[index] if index < len(old) and old[index] == entry
            else measurement_of(self.folder, entry, files) for index, entry in enumerate(frames))
        self.grid, self._content = grid_of(content), content


def _read_drafts(path):
    """Read the drafts in a file, {ID of a measurement: {name of a field: text}}; {} if it cannot be read."""
    try:
        with open(path, encoding='utf-8') as stream:
            content = json.load(stream)
        return {str(name): {str(key): str(text) for key, text in fields.items()} for name, fields in content.items()}
    except (OSError, ValueError, AttributeError, RecursionError):
        return {}


def _signature(folder):
    """File status that changes whenever a program writes the session."""
    try:
        status = os.stat(os.path.join(folder, FILE_NAME))
        return status.st_mtime_ns, status.st_size, status.st_ino
    except OSError:
        return None
