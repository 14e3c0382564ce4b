"""Edits of the document by the window."""
from ros_3d_bb.sessions.session_reader import SessionError
from ros_3d_bb_annotator import dialogs
from ros_3d_bb_annotator.document import Document
from ros_3d_bb_annotator.truth_panel import error_text
from ros_3d_bb_annotator.validation import truth_problems


class Edits(object):
    """Edits of the current measurement of an AnnotatorWindow, or of all selected ones.

    Invalid input is reported next to the fields, errors while saving in a dialog.
    """

    def __init__(self, window):
        self._window = window

    def enter_truth(self, truth_m):
        """Set the truth (x, y, z) of the selected measurements, and go to the next measurement."""
        self._enter_truth(self._window.selection, truth_m)

    def enter_for_label(self):
        """Set the typed or offered truth of all measurements with the current label that are not done."""
        window = self._window
        if not window.measurement.label:
            window.pane.truth.show_problem('The measurement has no label')
            return
        try:
            truth_m = window.pane.truth.read()
        except ValueError as error:
            window.pane.truth.show_problem(str(error))
            return
        self._enter_truth([index for index, other in enumerate(window.document.measurements)
                           if index == window.current or (other.label == window.measurement.label and not other.is_done
                                                          and other.detections)], truth_m)

    def same_as_last(self):
        """Set the truth of the last annotated measurement, and go to the next measurement."""
        try:
            truth_m = self._window.document.last_truth(self._window.current)
        except ValueError as error:
            self._window.pane.truth.show_problem(str(error))
            return
        self._enter_truth(self._window.selection, truth_m)

    def clear_truth(self):
        self._window.pane.truth.forget_typed()
        self._edit(Document.clear_truth)
        self._window.pane.truth.begin()

    def ask_reject(self):
        """Ask for a reason, reject the selected measurements, and go to the next one."""
        indices = self._window.selection
        reason = dialogs.ask_reason(self._window, [self._window.document.measurements[index].id for index in indices])
        if reason:
            self._enter(lambda document: document.reject(indices, reason), '%d rejected' % len(indices))

    def restore(self):
        self._edit(Document.restore)

    def choose_person(self, person):
        """Select the box of the person by its index."""
        measurement = self._window.measurement
        if measurement is None:
            return
        if person >= len(measurement.detections):
            self._window.statusBar().showMessage('There is no box %d' % (person + 1))
        else:
            self._edit(Document.choose_person, person)
            if self._window.pane.truth.has_keyboard():
                self._window.pane.truth.begin()

    def draw_box(self, box_px, is_new):
        """Add a box that was drawn by hand, or replace the selected one, and select it. The truth has the keyboard then.
        """
        window = self._window
        if self._edit(Document.draw_box, box_px, None if is_new else window.measurement.person):
            position_m = window.document.estimates.of(window.current)[window.measurement.person]
            window.statusBar().showMessage('The box is selected' if position_m is not None else
                                           'The box has not enough depth for an estimate')
            window.pane.truth.begin()

    def delete_box(self):
        self._edit(Document.delete_box)

    def undo(self):
        self._step(Document.undo)

    def redo(self):
        self._step(Document.redo)

    def edit_marks(self):
        document = self._window.document
        marks = dialogs.ask_marks(self._window, document.grid)
        if marks != document.grid and self._succeeds(lambda: document.set_grid(marks)):
            self._show(self._window.current)

    def _enter_truth(self, indices, truth_m):
        """Set a truth (x, y, z) of measurements. The user is asked about those where it is implausible."""
        document = self._window.document
        problems = {index: found for index in indices for found in [truth_problems(document, index, truth_m)] if found}
        if problems:
            answer = dialogs.ask_implausible(self._window, problems, len(indices))
            if answer is None:
                self._window.pane.truth.begin()
                return
            if isinstance(answer, tuple):
                truth_m = answer
        self._window.pane.truth.forget_typed()
        x_m, y_m, z_m = truth_m
        self._enter(lambda document: document.set_truths(indices, x_m, z_m, y_m),
                    '%d measurements' % len(indices) if len(indices) > 1 else '')

    def _enter(self, edit, text):
        """Apply an edit of the document that completes measurements. `text` describes it; empty: the error does."""
        window, index = self._window, self._window.current
        if self._edit(lambda document, _index: edit(document)):
            window.last_entry.setText('<b>%s</b>: %s' % (
                window.measurement.id, text or error_text(window.document.known_errors(index))))
            window.next_new()

    def _edit(self, edit, *values):
        """Apply a method of Document to the current measurement, and show it. Returns whether it succeeded."""
        window = self._window
        done = window.current is not None and self._succeeds(lambda: edit(window.document, window.current, *values))
        if done:
            self._show(window.current)
        return done

    def _step(self, step):
        indices = []
        if self._succeeds(lambda: indices.append(step(self._window.document))):
            self._show(self._window.current if indices[0] is None else indices[0])

    def _show(self, index):
        """Show the result of an edit instead of that of the previous one."""
        self._window.statusBar().clearMessage()
        self._window.last_entry.clear()
        self._window.after_edit()
        if index is not None:
            self._window.show_measurement(index)

    def _succeeds(self, edit):
        """Apply an edit. Returns whether it succeeded."""
        try:
            edit()
            return True
        except (SessionError, OSError) as error:
            dialogs.show_error(self._window, 'The edit was not saved', error)
        except ValueError as error:
            self._window.pane.truth.show_problem(str(error))
        return False
