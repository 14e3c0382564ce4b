"""Main window: list of measurements, view of the current measurement, and actions."""
import functools
import signal
import sys

from ros_3d_bb_annotator import dialogs
from ros_3d_bb_annotator.actions import build_menus, keys_dialog
from ros_3d_bb_annotator.document import Document
from ros_3d_bb_annotator.edits import Edits
from ros_3d_bb_annotator.measurement import NEW
from ros_3d_bb_annotator.measurement_list import MeasurementList
from ros_3d_bb_annotator.measurement_pane import MeasurementPane
from ros_3d_bb_annotator.qt import Qt, QtCore, QtWidgets
from ros_3d_bb_annotator.results import Results

TITLE = 'ros_3d_bb annotator'
REFRESH_MS, WAKE_MS = 2000, 250


class AnnotatorWindow(QtWidgets.QMainWindow):
    """Main window of the annotator. `actions` are its QActions by the name of the method that they call."""

    def __init__(self, parent=None):
        super(AnnotatorWindow, self).__init__(parent)
        self.document, self.current = None, None
        self.list, self.pane = MeasurementList(), MeasurementPane()
        self.progress, self.last_entry = QtWidgets.QProgressBar(), QtWidgets.QLabel()
        self.edits, self.results = Edits(self), Results(self)
        self.actions = build_menus(self)
        self._lay_out()
        self._connect()
        self._ahead = QtCore.QTimer(self, singleShot=True, interval=0)
        self._ahead.timeout.connect(self._read_ahead)
        self._refresh = QtCore.QTimer(self, interval=REFRESH_MS)
        self._refresh.timeout.connect(self._refresh_document)
        self._show_state()

    @property
    def measurement(self):
        return None if self.current is None else self.document.measurements[self.current]

    def handler(self, name):
        """Method that an action calls: a method of the window or of one of its parts."""
        if name.startswith('choose_'):
            return functools.partial(self.edits.choose_person, int(name.split('_')[1]) - 1)
        owners = self, self.edits, self.results, self.pane.shared, self.pane.truth
        return next(getattr(owner, name) for owner in owners if hasattr(owner, name))

    def ask_session(self):
        folder = QtWidgets.QFileDialog.getExistingDirectory(self, 'Open a measurement session')
        if folder:
            self.open_session(folder)

    def open_session(self, folder):
        """Open the session in a folder, or show an error message. Returns whether it is open."""
        self.keep_typed()
        try:
            document = Document.open(folder)
        except (ValueError, OSError) as error:
            dialogs.show_error(self, 'The session cannot be opened', error)
            return False
        self.document, self.current = document, None
        self.last_entry.clear()
        self.pane.show_document(document)
        self.list.show_document(document)
        self.setWindowTitle('%s – %s' % (document.folder, TITLE))
        self._show_state()
        if document.measurements:
            self.show_measurement(self._next_new(-1) or 0)
            self.pane.truth.begin()
        self._refresh.start()
        return True

    def reload(self):
        """Read changes of the session by other programs, and reload the images."""
        self.pane.read_again()
        self._refresh.start()
        self._refresh_document()
        if self.current is not None:
            self.keep_typed()
            self.show_measurement(self.current)

    def _refresh_document(self):
        """Show changes of the session by other programs."""
        before = self.measurement
        try:
            if not self.document.refresh():
                return
        except (ValueError, OSError) as error:
            self._refresh.stop()  # one message instead of one every two seconds; reload restarts it
            dialogs.show_error(self, 'The session has changed and cannot be read', error)
            return
        count = len(self.document.measurements)
        if self.current is not None and self.current >= count:
            self.current = None  # another program removed the measurement
        self.after_edit()
        if count and (self.current is None or self.measurement is not before):
            self.show_measurement(self._next_new(-1) or 0 if self.current is None else self.current)

    def show_measurement(self, number):
        """Show a measurement. The text typed for the previous one is saved."""
        changed = number != self.current
        if changed:
            self.keep_typed()
        self.current = number
        self.pane.show_measurement(number)
        if changed and self.pane.truth.has_keyboard():
            self.pane.truth.begin()
        self.list.mark_current(number)
        self._show_state()
        self._ahead.start()

    def next(self):
        self._go_to(self.current + 1)

    def previous(self):
        self._go_to(self.current - 1)

    def first(self):
        self._go_to(0)

    def last(self):
        self._go_to(len(self.document.measurements) - 1)

    def next_new(self):
        """Show the next measurement that is neither annotated nor rejected."""
        number = self._next_new(self.current)
        if number is None:
            self.statusBar().showMessage('No new measurements: %d of %d are done' % self.document.progress)
        else:
            self._go_to(number)

    def go_to_list(self):
        self.list.table.setFocus()

    def go_to_image(self):
        self.pane.color_view.setFocus()

    def go_to_truth(self):
        self.pane.truth.begin()

    def go_to_floor(self):
        self.pane.floor.setFocus()

    def start_drawing(self):
        """Start to draw a box by dragging or by cursor and Space, or stop it."""
        self.pane.shared.start_drawing(not self.pane.shared.drawing)
        self.pane.color_view.setFocus()

    def show_keys(self):
        keys_dialog(self).exec_()

    def keep_typed(self):
        """Save the text that was typed for the current measurement."""
        if self.current is not None:
            self.pane.truth.flush()

    def after_edit(self):
        """Update the window from the document."""
        self.list.update_rows()
        self._show_state()

    def closeEvent(self, event):  # noqa: N802 (Qt's name)
        self.keep_typed()
        self._refresh.stop()
        self.results.wait()
        super(AnnotatorWindow, self).closeEvent(event)

    def _go_to(self, number):
        if 0 <= number < len(self.document.measurements):
            self.show_measurement(number)

    def _next_new(self, number):
        """Index of the next new measurement, continuing at the start after the last one; None if there is none."""
        measurements = self.document.measurements
        order = list(range(number + 1, len(measurements))) + list(range(number + 1))
        return next((index for index in order if measurements[index].state == NEW), None)

    def _read_ahead(self):
        """Read the images of neighbouring measurements, one measurement per idle event."""
        for step in (1, -1):
            number = self.current + step
            if 0 <= number < len(self.document.measurements) and self.pane.read_ahead(number):
                self._ahead.start()
                return

    def _on_drawing(self, drawing):
        self.statusBar().showMessage('Drag a box around the person, or move the cursor with the arrows and set two '
                                     'corners with Space; Esc cancels it' if drawing else '')

    def _keep_draft(self, texts):
        try:
            self.document.set_draft(self.current, texts)
        except (ValueError, OSError) as error:
            self.pane.truth.show_problem(str(error))

    def _show_state(self):
        done, count = self.document.progress if self.document is not None else (0, 0)
        self.progress.setRange(0, max(count, 1))
        self.progress.setValue(done)
        self.progress.setFormat('%d of %d done' % (done, count))
        measurement = self.measurement
        self.actions['undo'].setEnabled(bool(self.document and self.document.can_undo))
        self.actions['redo'].setEnabled(bool(self.document and self.document.can_redo))
        self.actions['restore'].setEnabled(measurement is not None and measurement.rejected is not None)
        for name in ('same_as_last', 'ask_reject', 'start_drawing', 'next', 'previous', 'next_new', 'first', 'last'):
            self.actions[name].setEnabled(measurement is not None)
        for name in ('ask_export', 'analyse', 'edit_marks', 'reload'):
            self.actions[name].setEnabled(self.document is not None)
        self.pane.set_usable(measurement is not None)

    def _lay_out(self):
        self.setWindowTitle(TITLE)
        self.resize(1400, 860)
        split = QtWidgets.QSplitter(Qt.Horizontal)
        split.addWidget(self.list)
        split.addWidget(self.pane)
        split.setStretchFactor(1, 1)
        split.setSizes([330, 1070])
        self.setCentralWidget(split)
        for place, name in enumerate(('same_as_last', 'ask_reject', 'start_drawing', 'restore')):
            button = QtWidgets.QToolButton()
            button.setDefaultAction(self.actions[name])
            button.setSizePolicy(QtWidgets.QSizePolicy.Expanding, QtWidgets.QSizePolicy.Fixed)
            self.pane.buttons.addWidget(button, place // 2, place % 2)
        self.progress.setFixedWidth(220)
        self.statusBar().addPermanentWidget(self.last_entry)
        self.statusBar().addPermanentWidget(self.progress)

    def _connect(self):
        self.list.chosen.connect(self.show_measurement)
        self.pane.person_chosen.connect(self.edits.choose_person)
        self.pane.shared.box_drawn.connect(self.edits.add_box)
        self.pane.shared.drawing_changed.connect(self._on_drawing)
        self.pane.truth.entered.connect(self.edits.enter_truth)
        self.pane.truth.typed.connect(self._keep_draft)
        self.pane.floor.mark_chosen.connect(lambda mark: self.edits.enter_truth(mark.x_m, mark.z_m))
        self.actions['show_samples'].toggled.connect(self.pane.show_samples)


def make_application():
    application = QtWidgets.QApplication(sys.argv[:1])
    application.setApplicationName('ros_3d_bb annotator')
    application.setStyle('Fusion')  # same appearance on all platforms
    return application


def run_window(folder=None):
    """Show the window, optionally with the session in `folder`, until it is closed. Returns the exit status."""
    application = make_application()
    signal.signal(signal.SIGINT, lambda _number, _frame: application.closeAllWindows())
    wake = QtCore.QTimer(interval=WAKE_MS)  # Python handles signals only while it executes bytecode
    wake.timeout.connect(lambda: None)
    wake.start()
    window = AnnotatorWindow()
    window.show()
    if folder is not None:
        QtCore.QTimer.singleShot(0, lambda: window.open_session(folder))
    return application.exec_()
