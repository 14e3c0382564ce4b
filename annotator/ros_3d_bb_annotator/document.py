"""A measurement session while it is annotated: every edit is saved at once, and can be undone.

Positions are in the camera's optical frame, metres. The program writes only the fields of the measurements that it
edits, so a viewer may add measurements to the same session meanwhile.
"""
import copy
import os

import numpy as np

from ros_3d_bb.estimation import FARTHEST_M, check_rect, estimate_boxes, estimator_named
from ros_3d_bb.measurements import (Session, SessionError, camera_of, others_than, read_color, read_depth,
                                    read_description, refusing)
from ros_3d_bb.session_file import FILE_NAME, changing
from ros_3d_bb_annotator import legacy
from ros_3d_bb_annotator.drafts import Drafts
from ros_3d_bb_annotator.entries import (Edit, changed, changes_with_estimate, detections_with, entry_at, grid_of,
                                         grid_entry, millimetres)
from ros_3d_bb_annotator.measurement import ANNOTATED, NEW, FileNames, measurement_of

ESTIMATOR = 'foreground'  # the default of bbox3d_node


class Document(object):
    """A session that is being annotated. `Document.open` makes one.

    Attributes
    ----------
    folder : str
    measurements : tuple of Measurement
        In the order of the file; an index into it stays the same for as long as the document is open.
    camera : geometry.Camera or None
        None in the old form, which does not say.
    depth_scale_m : float or None
        Metres per unit of depth.
    grid : tuple of Mark
    is_old_form : bool
        Whether it is of the thesis' own form: depth is stretched, so that nothing can be estimated anew.
    notes : tuple of str
        What cannot be recovered of it, for people.
    """

    def __init__(self, folder, content):
        self.folder, self.measurements = folder, ()
        self.is_old_form = content.get('form') == legacy.FORM
        self.notes = legacy.NOTES if self.is_old_form else ()
        camera, self.depth_scale_m, frame_id = (None, None, '') if self.is_old_form else camera_of(content)
        self.camera, self._session = camera, Session(camera, self.depth_scale_m, frame_id, ())
        self._content, self._signature = {'frames': []}, None
        self._undo, self._redo, self._annotated = [], [], []
        self._drafts = Drafts(folder)
        self._take(content)

    @classmethod
    def open(cls, folder):
        """Open the session in a folder; no image is read. Raises SessionError where there is nothing to open."""
        folder = os.path.abspath(str(folder))
        content = legacy.read(folder) if legacy.is_old_form(folder) else read_description(folder)
        with refusing(os.path.join(folder, FILE_NAME)):
            return cls(folder, content)

    @property
    def progress(self):
        """(how many measurements are annotated or rejected, how many there are)."""
        return sum(measurement.state != NEW for measurement in self.measurements), len(self.measurements)

    def refresh(self):
        """Take in what other programs wrote. Returns whether there was anything new. Raises SessionError."""
        signature = _signature(self.folder)  # before it is read: what is written meanwhile is seen next time
        if self._signature == signature:
            return False
        before, grid = self.measurements, self.grid
        content = read_description(self.folder)
        with refusing(os.path.join(self.folder, FILE_NAME)):
            self._take(content)
        self._signature = signature
        return (len(before) != len(self.measurements) or grid != self.grid
                or any(old is not new for old, new in zip(before, self.measurements)))

    def color(self, index):
        """The colour image of a measurement, (height, width, 3), uint8, RGB. Raises SessionError."""
        return read_color(self._usable(index), self.camera)

    def depth(self, index):
        """The depth of a measurement, an estimation.DepthImage. Raises SessionError."""
        if self.is_old_form:
            raise SessionError(legacy.NOTES[0])
        return read_depth(self._usable(index), self._session)

    def stretched_depth(self, index):
        """The depth of a measurement of the old form as a picture (height, width), in no unit. Raises SessionError."""
        return legacy.read_stretched(self._usable(index).depth_path)

    def estimated(self, index, box_px):
        """The 3D box of a 2D box (x1, y1, x2, y2) in a measurement, detected or drawn, knowing the other people in it.

        Returns
        -------
        estimation.Box3D or None
            None where there is not enough depth.

        Raises
        ------
        SessionError
            If the depth cannot be read.
        ValueError
            If the box is empty or reversed.
        """
        box_px = tuple(int(edge) for edge in box_px)
        check_rect(box_px)
        detections = self.measurements[index].detections
        others_px = [detection.box_px for detection in detections if detection.box_px not in (None, box_px)]
        if not any(detection.box_px == box_px and not detection.by_hand for detection in detections):
            others_px = others_than(box_px, others_px)  # one drawn by hand replaces those of the same person
        boxes_px = [box_px] + list(others_px)
        return estimate_boxes(self.depth(index), boxes_px, self.camera, estimator_named(ESTIMATOR))[0]

    def errors(self, index):
        """(x, z, distance on the floor), metres, of estimate minus truth; None where one of both is missing."""
        measurement = self.measurements[index]
        if measurement.truth_m is None or measurement.estimate_m is None:
            return None
        dx_m, dz_m = (float(measurement.estimate_m[axis] - measurement.truth_m[axis]) for axis in (0, 2))
        return dx_m, dz_m, float(np.hypot(dx_m, dz_m))

    def set_truth(self, index, x_m, z_m, y_m=None):
        """Enter where the person really was; a rejected measurement is taken back. The person's box is estimated where
        no estimate is stored.

        Raises
        ------
        ValueError
            If that is no place in front of the camera.
        SessionError
            If the measurement cannot be understood, or the truth not be saved.
        """
        given_m = [value for value in (x_m, y_m, z_m) if value is not None]
        if not np.isfinite(given_m).all() or max(np.abs(given_m)) > FARTHEST_M:
            raise ValueError('truth %s is not a position within %g m' % (given_m, FARTHEST_M))
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
        """Enter the truth of the measurement annotated last, or else of the nearest one before. Raises as set_truth."""
        candidates = self._annotated[::-1] + list(range(index - 1, -1, -1))
        for last in candidates:
            if last != index and self.measurements[last].state == ANNOTATED:
                x_m, y_m, z_m = self.measurements[last].truth_m
                return self.set_truth(index, x_m, z_m, y_m)
        raise ValueError('nothing is annotated yet that measurement %s could be the same as'
                         % self.measurements[index].id)

    def choose_person(self, index, detection):
        """Say which detection, by its number, is the person whose truth is given; it is estimated where no estimate is
        stored. Raises ValueError, SessionError.
        """
        count = len(self.measurements[index].detections)
        if not 0 <= detection < count:
            raise ValueError('detection %d of %d' % (detection, count))
        self._edit(index, dict(self._missing_estimate(index, detection), person=int(detection)))

    def add_box(self, index, box_px):
        """Add a box (x1, y1, x2, y2) drawn by hand, estimate it and choose it as the person.

        Returns
        -------
        estimation.Box3D or None
            None where there is not enough depth; the box is added nevertheless.

        Raises
        ------
        ValueError
            If the part of the box inside the image is empty.
        SessionError
            If the depth cannot be read, or the edit not be saved.
        """
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
        """Say that and why a measurement is not to be used. Raises ValueError without a reason, SessionError."""
        if not reason.strip():
            raise ValueError('a reason is needed to reject a measurement')
        self._edit(index, {'rejected': reason.strip()})
        self.set_draft(index, {})

    def restore(self, index):
        """Take back that a measurement is rejected; its truth is as before. Raises SessionError."""
        self._edit(index, {'rejected': None})

    def set_grid(self, marks):
        """Replace the marked positions of the session by others (Mark). Raises SessionError."""
        self._edit(None, {'grid': [grid_entry(mark) for mark in marks]})

    @property
    def can_undo(self):
        """Whether there is an edit to undo."""
        return bool(self._undo)

    @property
    def can_redo(self):
        """Whether there is an undone edit to do again."""
        return bool(self._redo)

    def undo(self):
        """Undo the last edit. Returns the index that it changed, None for the grid or nothing. Raises SessionError."""
        return self._step(self._undo, self._redo)

    def redo(self):
        """Do the last undone edit again. Returns as `undo`. Raises SessionError."""
        return self._step(self._redo, self._undo)

    def draft(self, index):
        """What was typed for a measurement and not entered: {name of a field: text}."""
        return self._drafts.of(self.measurements[index].id)

    def set_draft(self, index, fields):
        """Keep what is typed for a measurement, {name of a field: text}; empty removes it. Raises SessionError."""
        try:
            self._drafts.set(self.measurements[index].id, fields)
        except OSError as error:
            raise SessionError('%s: what is typed cannot be kept (%s)' % (self.folder, error.strerror))

    def _missing_estimate(self, index, person):
        """The changes that give a detection its estimate; none where it has one, or none can be made."""
        detection = None if person is None else self.measurements[index].detections[person]
        if detection is None or detection.estimate_m is not None or detection.box_px is None:
            return {}
        try:
            box = self.estimated(index, detection.box_px)
        except ValueError:  # no depth, or a reversed box: the truth is good nevertheless, and validation says it
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
            raise SessionError('measurement %d has no id, so that nothing can be saved for it' % index)
        self._undo.append(self._save(Edit(index, name, changes)))
        del self._redo[:]

    def _step(self, source, target):
        if not source:
            return None
        target.append(self._save(source[-1]))
        return source.pop().index

    def _save(self, edit):
        """Write an edit; returns the one that undoes it."""
        try:
            with changing(self.folder) as content:
                if self.is_old_form and 'form' not in content:
                    content.update(copy.deepcopy(self._content))
                inverse = changed(content if edit.index is None else entry_at(content['frames'], edit), edit)
        except OSError as error:
            raise SessionError('%s: cannot be saved (%s)' % (self.folder, error.strerror))
        except ValueError as error:
            raise SessionError('%s: cannot be saved (%s)' % (self.folder, error))
        self._take(content)
        self._signature = None  # another program may write before anybody looks
        return inverse

    def _take(self, content):
        """Show the content of frames.json; what did not change is not parsed again."""
        frames, old = content['frames'], self._content['frames']
        files = FileNames()
        self.measurements = tuple(
            self.measurements[index] if index < len(old) and old[index] == entry
            else measurement_of(self.folder, entry, files) for index, entry in enumerate(frames))
        self.grid, self._content = grid_of(content), content


def _signature(folder):
    """What changes whenever another program writes the session."""
    try:
        status = os.stat(os.path.join(folder, FILE_NAME))
        return status.st_mtime_ns, status.st_size, status.st_ino
    except OSError:
        return None
