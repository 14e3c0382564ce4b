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
        self._enter_truth(self._window.selection, truth_m)

    def enter_for_label(self):
        """Set the typed or offered truth of all measurements with the current label that are not done."""
        window = self._window
        self._enter_read(window.pane.truth.read, [
            index for index, other in enumerate(window.document.measurements)
            if index == window.current or (other.label == window.measurement.label and not other.is_done
                                           and other.detections)])

    def same_as_last(self):
        self._enter_read(lambda: self._window.document.last_truth(self._window.current), self._window.selection)

    def clear_truth(self):
        self._window.pane.truth.forget_typed()
        self._edit(lambda document: document.clear_truth(self._window.current))
        self._window.pane.truth.begin()

    def ask_reject(self):
        indices = self._window.selection
        reason = dialogs.ask_reason(self._window, [self._window.document.measurements[index].id for index in indices])
        if reason:
            self._enter(lambda document: document.reject(indices, reason), '%d rejected' % len(indices))

    def restore(self):
        self._edit(lambda document: document.restore(self._window.current))

    def choose_person(self, person):
        """Select the box of the person by its index."""
        measurement = self._window.measurement
        if measurement is None:
            return
        if person >= len(measurement.detections):
            self._window.statusBar().showMessage('There is no box %d' % (person + 1))
        else:
            self._edit(lambda document: document.choose_person(self._window.current, person))
            if self._window.pane.truth.has_keyboard():
                self._window.pane.truth.begin()

    def draw_box(self, box_px):
        """Add a box drawn by hand, and select it. The truth has the keyboard then."""
        window = self._window
        if self._edit(lambda document: document.draw_box(window.current, box_px)):
            position_m = window.document.estimates.of(window.current)[window.measurement.person]
            window.statusBar().showMessage('The box is selected' if position_m is not None else
                                           'The box has not enough depth for an estimate')
            window.pane.truth.begin()

    def delete_box(self):
        self._edit(lambda document: document.delete_box(self._window.current))

    def undo(self):
        self._edit(Document.undo)

    def redo(self):
        self._edit(Document.redo)

    def edit_marks(self):
        document = self._window.document
        marks = dialogs.ask_marks(self._window, document.grid)
        if marks != document.grid:
            self._edit(lambda document: document.set_grid(marks))

    def _enter_read(self, read, indices):
        """Set the truth that `read()` returns, or show why it raises ValueError."""
        try:
            truth_m = read()
        except ValueError as error:
            self._window.pane.truth.show_problem(str(error))
        else:
            self._enter_truth(indices, truth_m)

    def _enter_truth(self, indices, truth_m):
        """Set a truth (x, y, z) of measurements. The user is asked about those where it is implausible."""
        document = self._window.document
        problems = {index: found for index in indices for found in [truth_problems(document, index, truth_m)] if found}
        if problems and not dialogs.ask_implausible(self._window, problems, len(indices)):
            self._window.pane.truth.begin()
            return
        self._window.pane.truth.forget_typed()
        x_m, y_m, z_m = truth_m
        self._enter(lambda document: document.set_truths(indices, x_m, z_m, y_m),
                    '%d measurements' % len(indices) if len(indices) > 1 else '')

    def _enter(self, edit, text):
        """Apply an edit of the document that completes measurements. `text` describes it; empty: the error does."""
        window, index = self._window, self._window.current
        if self._edit(edit):
            window.last_entry.setText('<b>%s</b>: %s' % (
                window.measurement.id, text or error_text(window.document.known_errors(index))))
            window.next_new()

    def _edit(self, edit):
        """Apply `edit(document)`, and show the measurement whose index it returns, or the current one.

        Returns whether it succeeded.
        """
        window = self._window
        try:
            index = edit(window.document)
        except (SessionError, OSError) as error:
            dialogs.show_error(window, 'The edit was not saved', error)
            return False
        except ValueError as error:
            window.pane.truth.show_problem(str(error))
            return False
        window.statusBar().clearMessage()
        window.last_entry.clear()
        window.after_edit()
        index = window.current if index is None else index
        if index is not None:
            window.show_measurement(index)
        return True
