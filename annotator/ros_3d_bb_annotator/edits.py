"""Edits of the document by the window."""
from ros_3d_bb.sessions.session_reader import SessionError
from ros_3d_bb_annotator import dialogs
from ros_3d_bb_annotator.truth_panel import error_text


class Edits(object):
    """Edits of the current measurement of an AnnotatorWindow. Invalid input is reported next to the fields, errors
    while saving in a dialog.
    """

    def __init__(self, window):
        self._window = window

    def enter_truth(self, x_m, z_m, y_m=None):
        """Set the truth, and go to the next measurement."""
        self._enter(lambda document, number: document.set_truth(number, x_m, z_m, y_m))

    def same_as_last(self):
        """Set the truth of the last annotated measurement, and go to the next measurement."""
        self._enter(lambda document, number: document.set_same_as_last(number))

    def ask_reject(self):
        """Ask for a reason, reject the measurement, and go to the next one."""
        window = self._window
        if window.current is not None:
            reason = dialogs.ask_reason(window, window.document.measurements[window.current].id)
            if reason:
                self._enter(lambda document, number: document.reject(number, reason))

    def restore(self):
        """Restore the rejected measurement."""
        self._edit(lambda document, number: document.restore(number))

    def choose_person(self, person):
        """Select the box of the person by its index."""
        window = self._window
        if window.current is None:
            return
        measurement = window.document.measurements[window.current]
        if person >= len(measurement.detections):
            window.statusBar().showMessage('There is no box %d' % (person + 1))
        elif person != measurement.person:
            self._edit(lambda document, number: document.choose_person(number, person))

    def add_box(self, box_px):
        """Add a box that was drawn by hand, and select it as the person."""
        window = self._window
        if not self._edit(lambda document, number: document.add_box(number, box_px)):
            return
        estimated = window.document.measurements[window.current].estimate_m is not None
        window.statusBar().showMessage('The box is selected as the person' if estimated else
                                       'The box has not enough depth for an estimate')

    def undo(self):
        """Undo the last edit, and show its measurement."""
        self._step(lambda document: document.undo())

    def redo(self):
        """Redo the last undone edit, and show its measurement."""
        self._step(lambda document: document.redo())

    def edit_marks(self):
        """Edit the marks on the floor."""
        window = self._window
        marks = dialogs.ask_marks(window, window.document.grid) if window.document is not None else None
        if marks is not None and marks != window.document.grid and self._succeeds(window.document.set_grid, marks):
            self._show(window.current)

    def _enter(self, edit):
        """Apply an edit that completes a measurement."""
        window, number = self._window, self._window.current
        if number is None or not self._succeeds(edit, window.document, number):
            return
        self._show(number)
        measurement = window.document.measurements[number]
        window.last_entry.setText('<b>%s</b>: %s' % (measurement.id, error_text(window.document.errors(number))
                                                     if measurement.rejected is None else 'rejected'))
        if window.actions['go_on'].isChecked():
            window.next_new()

    def _edit(self, edit):
        """Apply an edit to the current measurement, and show it. Returns whether it succeeded."""
        window = self._window
        done = window.current is not None and self._succeeds(edit, window.document, window.current)
        if done:
            self._show(window.current)
        return done

    def _step(self, step):
        window = self._window
        numbers = []
        if window.document is not None and self._succeeds(lambda: numbers.append(step(window.document))):
            self._show(window.current if numbers[0] is None else numbers[0])

    def _show(self, number):
        """Show the result of an edit instead of that of the previous one."""
        self._window.statusBar().clearMessage()
        self._window.last_entry.clear()
        self._window.after_edit()
        if number is not None:
            self._window.show_measurement(number)

    def _succeeds(self, edit, *arguments):
        """Save the typed text, and apply an edit. Returns whether it succeeded."""
        window = self._window
        window.keep_typed()
        try:
            edit(*arguments)
            return True
        except (SessionError, OSError) as error:
            dialogs.show_error(window, 'The edit was not saved', error)
        except ValueError as error:
            window.pane.truth.show_problem(str(error))
        return False
