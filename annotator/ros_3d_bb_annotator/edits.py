"""Edits of the document by the window."""
from ros_3d_bb.sessions.session_reader import SessionError
from ros_3d_bb_annotator import dialogs
from ros_3d_bb_annotator.document import Document
from ros_3d_bb_annotator.truth_panel import error_text


class Edits(object):
    """Edits of the current measurement of an AnnotatorWindow.

    Invalid input is reported next to the fields, errors while saving in a dialog.
    """

    def __init__(self, window):
        self._window = window

    def enter_truth(self, x_m, z_m, y_m=None):
        """Set the truth, and go to the next measurement."""
        self._enter(Document.set_truth, x_m, z_m, y_m)

    def same_as_last(self):
        """Set the truth of the last annotated measurement, and go to the next measurement."""
        self._enter(Document.set_same_as_last)

    def ask_reject(self):
        """Ask for a reason, reject the measurement, and go to the next one."""
        reason = dialogs.ask_reason(self._window, self._window.measurement.id)
        if reason:
            self._enter(Document.reject, reason)

    def restore(self):
        self._edit(Document.restore)

    def choose_person(self, person):
        """Select the box of the person by its index."""
        measurement = self._window.measurement
        if measurement is None:
            return
        if person >= len(measurement.detections):
            self._window.statusBar().showMessage('There is no box %d' % (person + 1))
        elif person != measurement.person:
            self._edit(Document.choose_person, person)

    def add_box(self, box_px):
        """Add a box that was drawn by hand, and select it as the person."""
        if self._edit(Document.add_box, box_px):
            has_estimate = self._window.measurement.estimate_m is not None
            self._window.statusBar().showMessage('The box is selected as the person' if has_estimate else
                                                 'The box has not enough depth for an estimate')

    def undo(self):
        self._step(Document.undo)

    def redo(self):
        self._step(Document.redo)

    def edit_marks(self):
        document = self._window.document
        marks = dialogs.ask_marks(self._window, document.grid)
        if marks != document.grid and self._succeeds(lambda: document.set_grid(marks)):
            self._show(self._window.current)

    def _enter(self, edit, *values):
        """Apply an edit that completes the current measurement."""
        window, number = self._window, self._window.current
        if self._edit(edit, *values):
            rejected = window.measurement.rejected is not None
            window.last_entry.setText('<b>%s</b>: %s' % (window.measurement.id, 'rejected' if rejected else error_text(
                window.document.errors(number))))
            if window.actions['go_on'].isChecked():
                window.next_new()

    def _edit(self, edit, *values):
        """Apply a method of Document to the current measurement, and show it. Returns whether it succeeded."""
        window = self._window
        done = window.current is not None and self._succeeds(lambda: edit(window.document, window.current, *values))
        if done:
            self._show(window.current)
        return done

    def _step(self, step):
        numbers = []
        if self._succeeds(lambda: numbers.append(step(self._window.document))):
            self._show(self._window.current if numbers[0] is None else numbers[0])

    def _show(self, number):
        """Show the result of an edit instead of that of the previous one."""
        self._window.statusBar().clearMessage()
        self._window.last_entry.clear()
        self._window.after_edit()
        if number is not None:
            self._window.show_measurement(number)

    def _succeeds(self, edit):
        """Save the typed text, and apply an edit. Returns whether it succeeded."""
        self._window.keep_typed()
        try:
            edit()
            return True
        except (SessionError, OSError) as error:
            dialogs.show_error(self._window, 'The edit was not saved', error)
        except ValueError as error:
            self._window.pane.truth.show_problem(str(error))
        return False
