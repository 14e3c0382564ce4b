"""Export and noise analysis from the window. The analysis runs in a separate thread."""
import os

from ros_3d_bb_annotator import dialogs
from ros_3d_bb_annotator.estimates import ESTIMATOR
from ros_3d_bb_annotator.export import export
from ros_3d_bb_annotator.qt import Qt, QtCore, QtGui, QtWidgets


class Work(QtCore.QThread):
    """Calls `work()` in a thread. Afterwards `result` is its return value, or `error` its exception."""

    def __init__(self, work, parent=None):
        super(Work, self).__init__(parent)
        self._work, self.result, self.error = work, None, None

    def run(self):
        try:
            self.result = self._work()
        except Exception as error:  # reported by the thread that waits
            self.error = error


class Results(QtCore.QObject):
    """Exports and analyses the document of a window. `analysis` is the last one, see `analysis.analyse`."""

    def __init__(self, window):
        super(Results, self).__init__(window)
        self._window, self._work, self.analysis = window, None, None

    @property
    def is_busy(self):
        return self._work is not None and self._work.isRunning()

    def ask_export(self):
        """Ask for a file, and write the table of errors to it."""
        path, _filter = QtWidgets.QFileDialog.getSaveFileName(
            self._window, 'Export CSV', os.path.join(self._window.document.folder, 'measurements.csv'), '*.csv')
        if path:
            self.export(path)

    def export(self, path):
        """Write the table of errors to a file, or show an error message."""
        document = self._window.document
        try:
            count = export(document, path, ESTIMATOR)
        except (ValueError, OSError) as error:
            dialogs.show_error(self._window, 'The table was not written', error)
            return
        self._window.statusBar().showMessage('%d rows written to %s' % (count, path))

    def analyse(self):
        """Run the noise analysis and open its report. Editing is blocked meanwhile."""
        def work():
            from ros_3d_bb_annotator.analysis import analyse  # optional scipy and matplotlib take a second
            return analyse(document)
        document = self._window.document
        waiting = QtWidgets.QProgressDialog('Fitting the error model…', None, 0, 0, self._window)
        waiting.setWindowTitle('Noise analysis')
        waiting.setWindowModality(Qt.WindowModal)
        self._work = Work(work, self)
        self._work.finished.connect(lambda: self._on_finished(waiting))
        waiting.show()
        self._work.start()

    def wait(self):
        """Wait for a running analysis, because threads must end before Qt is destroyed."""
        if self._work is not None:
            self._work.wait()

    def _on_finished(self, waiting):
        waiting.reset()
        waiting.deleteLater()
        if self._work.error is not None:
            dialogs.show_error(self._window, 'The noise analysis failed', self._work.error)
            return
        self.analysis, _text, folder = self._work.result
        text = ('Report and figures are in %s; %s' % (folder, self.analysis.model_note)
                if self.analysis.model_note else 'Report, figures and error model are in %s' % folder)
        if self.analysis.inputs.outliers:
            text += '; %d implausible positions were left out (Ctrl+I)' % len(self.analysis.inputs.outliers)
        self._window.statusBar().showMessage(text)
        QtGui.QDesktopServices.openUrl(QtCore.QUrl.fromLocalFile(str(folder / 'report.html')))
