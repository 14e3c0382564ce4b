"""Model of a measurement session that is being annotated. Every edit is saved immediately, and can be undone.

Positions are in the camera's optical frame, in metres. Only the edited fields of measurements are written, so a viewer
can add measurements to the same session concurrently.
"""
import os

import numpy as np

from ros_3d_bb.camera.images import FARTHEST_M
from ros_3d_bb.estimation.box3d_estimator import estimator_named
from ros_3d_bb.sessions.session_reader import (ANNOTATED, FILE_NAME, RecordedDetection, Session, SessionError,
                                               boxes_of_others, camera_of, measurement_of, read_color, read_depth,
                                               read_description, session_errors)
from ros_3d_bb.sessions.session_writer import locked_update
from ros_3d_bb_annotator.entries import (Edit, changed, changes_of, drawn, entry_at, grid_of, mark_entry, people_of,
                                         truth_entry)
from ros_3d_bb_annotator.estimates import ESTIMATOR, Estimates


class Document(object):
    """Session in a folder that is being annotated, opened without reading images. Raises SessionError.

    `measurements` are the Measurements in the order of the file; an index remains valid while the document is open.
    `undo_steps` and `redo_steps` are the edits that can be undone and redone. `progress` is (number of annotated or
    rejected measurements, number of all). `grid` are the Marks on the floor. `estimates` are the positions that the
    noise analysis uses; those stored in the session are the recorded ones.
    """

    def __init__(self, folder):
        self.folder, self.measurements = os.path.abspath(str(folder)), ()
        self._content, self.undo_steps, self.redo_steps, self._annotated = {'frames': []}, [], [], []
        self.estimates = Estimates(self)
        content = read_description(self.folder)
        with session_errors(os.path.join(self.folder, FILE_NAME)):
            self._session = Session(*camera_of(content), frames=())
            self._update(content)
        self.camera = self._session.camera

    def refresh(self):
        """Read changes by other programs. Returns whether there were any. Raises SessionError."""
        content = read_description(self.folder)
        if content == self._content:
            return False
        with session_errors(os.path.join(self.folder, FILE_NAME)):
            self._update(content)
        return True

    def color(self, index):
        return read_color(self._usable(index), self.camera)

    def depth(self, index):
        return read_depth(self._usable(index), self._session)

    def known_errors(self, index):
        """Estimate minus truth (x, z, distance) of the selected person, metres; None if missing or not yet computed."""
        measurement, positions = self.measurements[index], self.estimates.known(index)
        if measurement.truth_m is None or not positions or positions[measurement.person] is None:
            return None
        dx_m, dz_m = (float(positions[measurement.person][axis] - measurement.truth_m[axis]) for axis in (0, 2))
        return dx_m, dz_m, float(np.hypot(dx_m, dz_m))

    def person_at(self, index, x_m, z_m):
        """Detection that a true position belongs to: the one that the user selected, or the nearest one; None without.
        """
        positions = self.estimates.of(index)
        if not any(position is not None for position in positions) or 'person' in self._content['frames'][index]:
            return self.measurements[index].person
        return min((number for number, position in enumerate(positions) if position is not None),
                   key=lambda number: np.hypot(positions[number][0] - x_m, positions[number][2] - z_m))

    def mark_of(self, index):
        """Mark whose name is the label of a measurement, or None."""
        label = self.measurements[index].label.strip().casefold()
        return next((mark for mark in self.grid if label and mark.name.strip().casefold() == label), None)

    def set_truths(self, indices, x_m, z_m, y_m=None):
        """Set the same true position, see `person_at`, in several measurements, which is undone in one step.

        It is in front of the camera. Rejected measurements are restored.
        """
        values_m = [value for value in (x_m, y_m, z_m) if value is not None]
        if not np.isfinite(values_m).all() or max(np.abs(values_m)) > FARTHEST_M:
            raise ValueError('truth %s is not a position within %g m' % (values_m, FARTHEST_M))
        if not z_m > 0:
            raise ValueError('truth z is %g m; more than 0 expected, as the camera looks along z' % z_m)
        truth_mm = truth_entry(x_m, z_m, y_m)
        self._edit(*((index, self._changes_with_truth(index, truth_mm)) for index in indices))
        self._annotated.extend(indices)

    def clear_truth(self, index):
        self._edit((index, {'truth_mm': None}))

    def last_truth(self, index):
        """Truth (x, y, z) of the last annotated measurement, or else of the nearest one before `index`."""
        for last in self._annotated[::-1] + list(range(index - 1, -1, -1)):
            if last != index and self.measurements[last].state == ANNOTATED:
                return self.measurements[last].truth_m or next(iter(self.measurements[last].truths.values()))
        raise ValueError('no other measurement is annotated whose truth could be copied to measurement %s'
                         % self.measurements[index].id)

    def choose_person(self, index, person):
        """Select a detection by its index. Each detection has its own truth."""
        count = len(self.measurements[index].detections)
        if not 0 <= person < count:
            raise ValueError('detection %d does not exist; there are %d detections' % (person, count))
        entry = self._content['frames'][index]
        self._edit((index, changes_of(entry, people_of(entry), int(person))))

    def draw_box(self, index, box_px):
        """Add a box (x1, y1, x2, y2) drawn by hand, and select it. The truth of the selected person becomes that of the
        box, unless it is that of another person.
        """
        measurement, entry = self.measurements[index], self._content['frames'][index]
        x1, y1, x2, y2 = (int(round(edge)) for edge in box_px)
        box_px = max(x1, 0), max(y1, 0), min(x2, self.camera.width), min(y2, self.camera.height)
        others = measurement.detections
        box = measurement._replace(
            detections=others + (RecordedDetection(box_px, None, by_hand=True),), person=len(others)
        ).estimate(self.depth(index), self.camera, estimator_named(ESTIMATOR))
        people, detection, selected_px = people_of(entry), drawn(box_px, box), measurement.boxes_px[:1]
        if not (selected_px and boxes_of_others(box_px, selected_px)):
            truth_mm = people[measurement.person].pop('truth_mm', None) if people else entry.get('truth_mm')
            detection.update({} if truth_mm is None else {'truth_mm': truth_mm})
        self._edit((index, changes_of(entry, people + [detection], len(people))))

    def delete_box(self, index):
        measurement, entry = self.measurements[index], self._content['frames'][index]
        if measurement.person is None:
            raise ValueError('measurement %s has no box' % measurement.id)
        people = people_of(entry)
        del people[measurement.person]
        self._edit((index, changes_of(entry, people, None)))

    def reject(self, indices, reason):
        if not reason.strip():
            raise ValueError('a reason is needed to reject a measurement')
        self._edit(*((index, {'rejected': reason.strip()}) for index in indices))

    def restore(self, index):
        self._edit((index, {'rejected': None}))

    def set_grid(self, marks):
        self._edit((None, {'grid': [mark_entry(mark) for mark in marks]}))

    def undo(self):
        """Undo the last edit. Returns the changed index, or None for the grid or no edit."""
        return self._step(self.undo_steps, self.redo_steps)

    def redo(self):
        return self._step(self.redo_steps, self.undo_steps)

    def _changes_with_truth(self, index, truth_mm):
        """Changes that set the truth of the person at a position. It moves from a person who cannot be there, too."""
        self._usable(index)
        entry = self._content['frames'][index]
        person, people = self.person_at(index, truth_mm['x'] / 1000, truth_mm['z'] / 1000), people_of(entry)
        if person is None:
            return {'truth_mm': truth_mm, 'rejected': None}
        for other in people:
            if other.get('truth_mm') == truth_mm:
                del other['truth_mm']
        people[person]['truth_mm'] = truth_mm
        return dict(changes_of(entry, people, person), rejected=None)

    def _usable(self, index):
        measurement = self.measurements[index]
        if not measurement.color_path:
            raise SessionError('measurement %s: %s' % (measurement.id or index, measurement.problem))
        return measurement

    def _edit(self, *changes):
        """Save changes of measurements, pairs (index, changes), where the index is None for the description."""
        edits = []
        for index, changed_fields in changes:
            name = None if index is None else self.measurements[index].id
            if name == '':
                raise SessionError('measurement %d has no id, so its annotation cannot be saved' % index)
            edits.append(Edit(index, name, changed_fields))
        self.undo_steps.append(self._save(edits))
        del self.redo_steps[:]

    def _step(self, source, target):
        if not source:
            return None
        target.append(self._save(source[-1]))
        return source.pop()[0].index

    def _save(self, edits):
        """Write edits together. Returns their inverses."""
        try:
            with locked_update(self.folder) as content:
                inverses = [changed(content if edit.index is None else entry_at(content['frames'], edit), edit)
                            for edit in edits]
        except (OSError, ValueError) as error:
            raise SessionError('%s: cannot be saved (%s)' % (self.folder, getattr(error, 'strerror', error)))
        self._update(content)
        return inverses

    def _update(self, content):
        """Update from the content of frames.json. Unchanged measurements are not parsed again."""
        frames, old = content['frames'], self._content['frames']
        self.measurements = tuple(
            self.measurements[index] if index < len(old) and old[index] == entry
            else _existing(measurement_of(self.folder, entry), self.folder) for index, entry in enumerate(frames))
        self.grid, self._content = grid_of(content), content
        self.progress = sum(measurement.is_done for measurement in self.measurements), len(self.measurements)
        self.estimates.update()


def _existing(measurement, folder):
    """The measurement, with a problem if one of its files does not exist, or is a PNG whose end is missing."""
    missing = [os.path.relpath(path, folder) for path in (measurement.color_path, measurement.depth_path)
               if path and not os.path.exists(path)]
    if missing:
        return measurement._replace(problem='there is no file %s' % ' and no file '.join(missing))
    truncated = [os.path.relpath(path, folder) for path in (measurement.color_path, measurement.depth_path)
                 if path and path.endswith('.png') and not _has_end_of_png(path)]
    return measurement._replace(problem='the end of %s is missing' % ' and of '.join(truncated)) if truncated else (
        measurement)


def _has_end_of_png(path):
    with open(path, 'rb') as stream:
        stream.seek(-min(os.path.getsize(path), 8), os.SEEK_END)
        return stream.read(4) == b'IEND'
