"""Main window: list of measurements, view of the current measurement, and actions."""
import functools
import signal
import sys

from ros_3d_bb_annotator import dialogs
from ros_3d_bb_annotator.actions import build_menus
from ros_3d_bb_annotator.document import Document
from ros_3d_bb_annotator.edits import Edits
from ros_3d_bb_annotator.measurement_list import MeasurementList
from ros_3d_bb_annotator.measurement_pane import MeasurementPane
from ros_3d_bb_annotator.qt import Qt, QtCore, QtWidgets
from ros_3d_bb_annotator.results import Results

TITLE = 'ros_3d_bb annotator'
REFRESH_MS = 2000
SHOW_ESTIMATES_EVERY = 100


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
        self._estimate = QtCore.QTimer(self, interval=0)
        self._estimate.timeout.connect(self._estimate_next)
        self._refresh = QtCore.QTimer(self, interval=REFRESH_MS)
        self._refresh.timeout.connect(self._refresh_document)
        self._show_state()

    @property
    def measurement(self):
        return None if self.current is None else self.document.measurements[self.current]

    @property
    def selection(self):
        """Indices of the measurements that an entry applies to: those selected in the list, or the current one."""
        selected = self.list.selection
        return selected if self.current in selected else [self.current]

    def handler(self, name):
        """Method that an action calls: a method of the window or of one of its parts."""
        if name.startswith('choose_'):
            return functools.partial(self.edits.choose_person, int(name.split('_')[1]) - 1)
        owners = self, self.edits, self.results, self.pane.images, self.pane.truth
        return next(getattr(owner, name) for owner in owners if hasattr(owner, name))

    def ask_session(self):
        folder = QtWidgets.QFileDialog.getExistingDirectory(self, 'Open a measurement session')
        if folder:
            self.open_session(folder)

    def open_session(self, folder):
        """Open the session in a folder, or show an error message. Returns whether it is open."""
        try:
            document = Document(folder)
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
            self.show_measurement(self._next_of(-1, self._is_to_do) or 0)
            self.pane.truth.begin()
        self._start_estimates()
        self._refresh.start()
        return True

    def _refresh_document(self):
        before = self.measurement
        try:
            if not self.document.refresh():
                return
        except (ValueError, OSError) as error:
            self._refresh.stop()  # one message instead of one every two seconds
            dialogs.show_error(self, 'The session has changed and cannot be read', error)
            return
        count = len(self.document.measurements)
        if self.current is not None and self.current >= count:
            self.current = None  # another program removed the measurement
        self.after_edit()
        if count and (self.current is None or self.measurement is not before):
            self.show_measurement(self._next_of(-1, self._is_to_do) or 0 if self.current is None else self.current)

    def show_measurement(self, number):
        changed, self.current = number != self.current, number
        self.pane.show_measurement(number)
        if changed and self.pane.truth.has_keyboard():
            self.pane.truth.begin()
        self.list.mark_current(number)
        self._show_state()

    def next(self):
        self._go_to(self.current + 1)

    def previous(self):
        self._go_to(self.current - 1)

    def next_new(self):
        self._go_to_next(self._is_to_do, 'All done: %d of %d' % self.document.progress)

    def next_implausible(self):
        self._go_to_next(lambda number: number in self.document.estimates.implausible(), 'No implausible positions')

    def after_edit(self):
        self.list.update_rows()
        self._show_state()
        self._start_estimates()

    def closeEvent(self, event):  # noqa: N802 (Qt's name)
        self._refresh.stop()
        self._estimate.stop()
        super(AnnotatorWindow, self).closeEvent(event)

    def _go_to(self, number):
        if 0 <= number < len(self.document.measurements):
            self.show_measurement(number)

    def _go_to_next(self, is_wanted, text):
        number = self._next_of(self.current, is_wanted)
        if number is None:
            self.statusBar().showMessage(text)
        else:
            self._go_to(number)

    def _is_to_do(self, number):
        return not self.document.measurements[number].is_done

    def _next_of(self, number, is_wanted):
        """Index of the next measurement for which `is_wanted(index)`, from the start after the last one; None if none.
        """
        count = len(self.document.measurements)
        order = list(range(number + 1, count)) + list(range(min(number + 1, count)))
        return next((index for index in order if is_wanted(index)), None)

    def _start_estimates(self):
        """Compute the estimates of annotated measurements while the window is idle."""
        self._missing, self._computed = self.document.estimates.missing(), 0
        self._estimate.start()

    def _estimate_next(self):
        index = None if self.results.is_busy else next(self._missing, None)
        if index is None:
            self._estimate.stop()
        else:
            self.document.estimates.of(index)
            self._computed += 1
        if self._computed and (index is None or self._computed % SHOW_ESTIMATES_EVERY == 0):
            self.list.update_rows()

    def _show_state(self):
        done, count = self.document.progress if self.document is not None else (0, 0)
        self.progress.setRange(0, max(count, 1))
        self.progress.setValue(done)
        self.progress.setFormat('%d of %d done' % (done, count))
        measurement = self.measurement
        self.actions['undo'].setEnabled(bool(self.document and self.document.undo_steps))
        self.actions['redo'].setEnabled(bool(self.document and self.document.redo_steps))
        self.actions['clear_truth'].setEnabled(measurement is not None and measurement.truth_m is not None)
        self.actions['enter_for_label'].setEnabled(measurement is not None and bool(measurement.label))
        self.actions['delete_box'].setEnabled(measurement is not None and measurement.person is not None)
        self.actions['restore'].setEnabled(measurement is not None and measurement.rejected is not None)
        for name in ('same_as_last', 'ask_reject', 'next', 'previous', 'next_new', 'next_implausible'):
            self.actions[name].setEnabled(measurement is not None)
        for name in ('ask_export', 'analyse', 'edit_marks'):
            self.actions[name].setEnabled(self.document is not None)
        self.pane.set_usable(measurement is not None)

    def _lay_out(self):
        self.setWindowTitle(TITLE)
        self.resize(QtCore.QSize(1400, 860).boundedTo(QtWidgets.QApplication.primaryScreen().availableSize()))
        split = QtWidgets.QSplitter(Qt.Horizontal)
        split.addWidget(self.list)
        split.addWidget(self.pane)
        split.setStretchFactor(1, 1)
        split.setSizes([self.width() * 31 // 100, self.width() * 69 // 100])
        self.setCentralWidget(split)
        for name in ('same_as_last', 'enter_for_label', 'ask_reject'):
            button = QtWidgets.QToolButton()
            button.setDefaultAction(self.actions[name])
            button.setSizePolicy(QtWidgets.QSizePolicy.Expanding, QtWidgets.QSizePolicy.Fixed)
            self.pane.buttons.addWidget(button)
        self.progress.setFixedWidth(160)
        self.statusBar().addPermanentWidget(self.last_entry)
        self.statusBar().addPermanentWidget(self.progress)

    def _connect(self):
        self.list.chosen.connect(self.show_measurement)
        self.pane.person_chosen.connect(self.edits.choose_person)
        self.pane.images.box_drawn.connect(self.edits.draw_box)
        self.pane.truth.entered.connect(self.edits.enter_truth)
        self.pane.floor.mark_chosen.connect(lambda mark: self.edits.enter_truth((mark.x_m, None, mark.z_m)))


def make_application():
    application = QtWidgets.QApplication(sys.argv[:1])
    application.setApplicationName('ros_3d_bb annotator')
    application.setStyle('Fusion')  # same appearance on all platforms
    return application


def run_window(folder=None):
    """Show the window, optionally with the session in `folder`, until it is closed. Returns the exit status."""
    application = make_application()
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # entries are already saved
    window = AnnotatorWindow()
    window.show()
    if folder is not None:
        QtCore.QTimer.singleShot(0, lambda: window.open_session(folder))
    return application.exec_()
