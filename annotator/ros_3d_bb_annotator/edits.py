"""What the window does to the document."""
from ros_3d_bb.measurements import SessionError
from ros_3d_bb_annotator import dialogs
from ros_3d_bb_annotator.truth_panel import error_text


class Edits(object):
    """The edits of the measurement that an AnnotatorWindow shows. Wrong input is said beside the fields; what cannot
    be saved is said in a message.
    """

    def __init__(self, window):
        self._window = window

    def enter_truth(self, x_m, z_m, y_m=None):
        """Enter the truth, and go on."""
        self._enter(lambda document, number: document.set_truth(number, x_m, z_m, y_m))

    def same_as_last(self):
        """Enter the truth of the last one that was annotated, and go on."""
        self._enter(lambda document, number: document.set_same_as_last(number))

    def ask_reject(self):
        """Ask for a reason, reject the measurement, and go on."""
        window = self._window
        if window.current is not None:
            reason = dialogs.ask_reason(window, window.document.measurements[window.current].id)
            if reason:
                self._enter(lambda document, number: document.reject(number, reason))

    def restore(self):
        """Take back that the measurement is rejected."""
        self._edit(lambda document, number: document.restore(number))

    def choose_person(self, person):
        """Say which box, by its number, is the person's."""
        window = self._window
        if window.current is None:
            return
        measurement = window.document.measurements[window.current]
        if person >= len(measurement.detections):
            window.statusBar().showMessage('There is no box %d' % (person + 1))
        elif person != measurement.person:
            self._edit(lambda document, number: document.choose_person(number, person))

    def add_box(self, box_px):
        """Add a box drawn by hand, which becomes the person's."""
        window = self._window
        if not self._edit(lambda document, number: document.add_box(number, box_px)):
            return
        estimated = window.document.measurements[window.current].estimate_m is not None
        window.statusBar().showMessage('The box is the person\'s now' if estimated else
                                       'There is not enough depth in this box for an estimate')

    def undo(self):
        """Undo the last edit and show where it was."""
        self._step(lambda document: document.undo())

    def redo(self):
        """Do the last undone edit again and show where it was."""
        self._step(lambda document: document.redo())

    def edit_marks(self):
        """Edit the marks on the floor."""
        window = self._window
        marks = dialogs.ask_marks(window, window.document.grid) if window.document is not None else None
        if marks is not None and marks != window.document.grid and self._tried(window.document.set_grid, marks):
            self._show(window.current)

    def _enter(self, edit):
        """Do an edit that ends the work on a measurement."""
        window, number = self._window, self._window.current
        if number is None or not self._tried(edit, window.document, number):
            return
        self._show(number)
        measurement = window.document.measurements[number]
        window.last_entry.setText('<b>%s</b>: %s' % (measurement.id, error_text(window.document.errors(number))
                                                     if measurement.rejected is None else 'rejected'))
        if window.actions['go_on'].isChecked():
            window.next_new()

    def _edit(self, edit):
        """Do an edit of the measurement that is shown, and show it. Returns whether it was done."""
        window = self._window
        done = window.current is not None and self._tried(edit, window.document, window.current)
        if done:
            self._show(window.current)
        return done

    def _step(self, step):
        window = self._window
        numbers = []
        if window.document is not None and self._tried(lambda: numbers.append(step(window.document))):
            self._show(window.current if numbers[0] is None else numbers[0])

    def _show(self, number):
        """Show what an edit made, and nothing more of the one before."""
        self._window.statusBar().clearMessage()
        self._window.last_entry.clear()
        self._window.after_edit()
        if number is not None:
            self._window.show_measurement(number)

    def _tried(self, edit, *arguments):
        """Whether an edit went well; what is typed is kept before."""
        window = self._window
        window.keep_typed()
        try:
            edit(*arguments)
            return True
        except (SessionError, OSError) as error:
            dialogs.show_error(window, 'The edit is not saved', error)
        except ValueError as error:
            window.pane.truth.show_problem(str(error))
        return False
