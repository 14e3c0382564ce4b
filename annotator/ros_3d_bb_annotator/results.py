"""Export and noise analysis from the window. The analysis runs in a separate thread."""
import os

from ros_3d_bb_annotator import dialogs
from ros_3d_bb_annotator.export import default_estimator, export
from ros_3d_bb_annotator.qt import Qt, QtCore, QtGui, QtWidgets, Signal

FORMS = ('CSV, one row per person (*.csv)', 'CSV in the form of the thesis (*.csv)')


class Cancelled(Exception):
    """Raised in the thread of a Work that is cancelled."""


class Work(QtCore.QThread):
    """Calls `work(progress)` in a thread. Afterwards `result` is its return value, or `error` its exception.

    `work` calls `progress` with the share 0..1 that is done, which raises Cancelled after `cancel`.
    """

    progressed = Signal(float)

    def __init__(self, work, parent=None):
        super(Work, self).__init__(parent)
        self._work, self._is_cancelled, self.result, self.error = work, False, None, None

    def run(self):
        try:
            self.result = self._work(self._progress)
        except Exception as error:  # reported by the thread that waits
            self.error = error

    def cancel(self):
        self._is_cancelled = True

    def _progress(self, share):
        if self._is_cancelled:
            raise Cancelled()
        self.progressed.emit(share)


class Results(QtCore.QObject):
    """Exports and analyses the document of a window. `figures` is the last AnalysisWindow."""

    def __init__(self, window):
        super(Results, self).__init__(window)
        self._window, self._work, self.figures = window, None, None

    @property
    def is_busy(self):
        return self._work is not None and self._work.isRunning()

    def ask_export(self):
        """Ask for a file and its form, and write the table of errors to it."""
        path, form = QtWidgets.QFileDialog.getSaveFileName(
            self._window, 'Export CSV', os.path.join(self._window.document.folder, 'measurements.csv'),
            ';;'.join(FORMS))
        if path:
            self.export(path, form == FORMS[1])

    def export(self, path, in_thesis_form=False):
        """Write the table of errors to a file, or show an error message."""
        document = self._window.document
        try:
            count = export(document, path, default_estimator(document), in_thesis_form)
        except (ValueError, OSError) as error:
            dialogs.show_error(self._window, 'The table was not written', error)
            return
        self._window.statusBar().showMessage('%d rows written to %s' % (count, path))

    def analyse(self):
        """Name implausible truths, run the noise analysis and show its figures. Editing is blocked meanwhile."""
        self._window.keep_typed()
        document = self._window.document
        self._start('Estimating positions…', lambda progress: document.outliers(progress), self._on_outliers)

    def wait(self):
        """Wait for a running analysis, because threads must end before Qt is destroyed."""
        if self._work is not None:
            self._work.cancel()
            self._work.wait()

    def _start(self, text, work, then):
        """Run `work(progress)` in a thread with a progress dialog, and call `then(result)` if it succeeds."""
        waiting = QtWidgets.QProgressDialog(text, 'Cancel', 0, 100, self._window)
        waiting.setWindowTitle('Noise analysis')
        waiting.setWindowModality(Qt.WindowModal)
        waiting.setMinimumDuration(300)
        waiting.setAutoReset(False)
        self._work = Work(work, self)
        waiting.canceled.connect(self._work.cancel)
        self._work.progressed.connect(lambda share: waiting.setValue(int(100 * share)))
        self._work.finished.connect(lambda: self._on_finished(waiting, then))
        waiting.setValue(0)
        self._work.start()

    def _on_finished(self, waiting, then):
        waiting.reset()
        waiting.deleteLater()
        work = self._work
        if isinstance(work.error, Cancelled):
            self._window.statusBar().showMessage('The noise analysis was cancelled')
        elif work.error is not None:
            dialogs.show_error(self._window, 'The noise analysis failed', work.error)
        else:
            then(work.result)

    def _on_outliers(self, outliers):
        answer = dialogs.ask_outliers(self._window, outliers) if outliers else dialogs.ANALYSE
        if answer == dialogs.ANALYSE:
            document = self._window.document
            self._start('Fitting the error model…', lambda progress: _analysed(document, progress), self._on_analysed)
        elif answer is not None:
            self._window.show_measurement(answer)
            self._window.pane.truth.begin()

    def _on_analysed(self, analysed):
        self.figures = AnalysisWindow(analysed, self._window)
        self.figures.show()


def _analysed(document, progress):
    from ros_3d_bb_annotator.analysis import analyse  # optional scipy and matplotlib take a second
    return analyse(document, progress=progress)


class AnalysisWindow(QtWidgets.QDialog):
    """Shows an `analysis.Analysed`: a list of figures, and the current one scaled to the width of its scroll area."""

    def __init__(self, analysed, parent=None):
        super(AnalysisWindow, self).__init__(parent)
        self.setWindowTitle('Noise analysis – %s' % analysed.folder)
        self.setAttribute(Qt.WA_DeleteOnClose)
        self.resize(QtCore.QSize(1150, 780).boundedTo(
            QtWidgets.QApplication.primaryScreen().availableSize() * 0.95))
        summary = QtWidgets.QLabel('\n'.join(filter(None, (
            analysed.text, analysed.no_model and 'No cross-validated error model: %s' % analysed.no_model,
            '; '.join(map(str, analysed.outliers)) and 'Left out: ' + '; '.join(map(str, analysed.outliers)),
            'Report, figures and error model are in %s' % analysed.folder))))
        summary.setTextInteractionFlags(Qt.TextSelectableByMouse)
        summary.setWordWrap(True)
        self._figures, self._full = analysed.figures, QtGui.QPixmap()
        self.names, self.picture, self._area = QtWidgets.QListWidget(), QtWidgets.QLabel(), QtWidgets.QScrollArea()
        self.names.addItems([title for _path, title in analysed.figures])
        self.names.setFixedWidth(240)
        self.names.setWordWrap(True)
        self.picture.setAlignment(Qt.AlignCenter)
        self.picture.setStyleSheet('background: white')
        self._area.setWidget(self.picture)
        self._area.setWidgetResizable(True)
        self._area.setHorizontalScrollBarPolicy(Qt.ScrollBarAlwaysOff)
        buttons = QtWidgets.QDialogButtonBox(QtWidgets.QDialogButtonBox.Close)
        report = buttons.addButton('Open the &report', QtWidgets.QDialogButtonBox.ActionRole)
        report.clicked.connect(lambda: QtGui.QDesktopServices.openUrl(QtCore.QUrl.fromLocalFile(analysed.report_path)))
        buttons.rejected.connect(self.reject)
        layout = QtWidgets.QGridLayout(self)
        layout.addWidget(summary, 0, 0, 1, 2)
        layout.addWidget(self.names, 1, 0)
        layout.addWidget(self._area, 1, 1)
        layout.addWidget(buttons, 2, 0, 1, 2)
        self.names.currentRowChanged.connect(self._show)
        self.names.setCurrentRow(0)

    def resizeEvent(self, event):  # noqa: N802 (Qt's name)
        super(AnalysisWindow, self).resizeEvent(event)
        self._fit()

    def _show(self, row):
        self._full = QtGui.QPixmap(self._figures[row][0])
        self._fit()

    def _fit(self):
        width = min(self._area.viewport().width(), self._full.width())
        self.picture.setPixmap(self._full.scaledToWidth(width, Qt.SmoothTransformation))
