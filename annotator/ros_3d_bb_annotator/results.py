"""Export and noise analysis from the window. The analysis runs in a separate thread."""
import os

from ros_3d_bb_annotator import dialogs
from ros_3d_bb_annotator.analysis_window import AnalysisWindow
from ros_3d_bb_annotator.export import export
from ros_3d_bb_annotator.qt import Qt, QtCore, QtWidgets


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
    """Exports and analyses a document for a window. `figures` is the last AnalysisWindow."""

    def __init__(self, window):
        super(Results, self).__init__(window)
        self._window, self._work, self.figures = window, None, None

    def ask_export(self, document):
        """Ask for a file and write the table of errors to it."""
        path, _kind = QtWidgets.QFileDialog.getSaveFileName(
            self._window, 'Export CSV', os.path.join(document.folder, 'measurements.csv'), 'CSV (*.csv)')
        if path:
            self.export(document, path)

    def export(self, document, path):
        """Write the table of errors to a file, or show an error message."""
        try:
            count = export(document, path)
        except (ValueError, OSError) as error:
            dialogs.show_error(self._window, 'The table was not written', error)
            return
        self._window.statusBar().showMessage('%d measurements written to %s' % (count, path))

    def analyse(self, document):
        """Run the noise analysis of a document and show its figures. Editing is blocked meanwhile."""
        waiting = QtWidgets.QProgressDialog('The noise analysis takes some seconds.', '', 0, 0, self._window)
        waiting.setWindowTitle('Noise analysis')
        waiting.setCancelButton(None)
        waiting.setWindowModality(Qt.WindowModal)
        waiting.setMinimumDuration(0)
        waiting.show()
        self._work = Work(lambda: _analysed(document), self)
        self._work.finished.connect(lambda: self._on_analysed(waiting))
        self._work.start()

    def wait(self):
        """Wait for a running analysis, because threads must end before Qt is destroyed."""
        if self._work is not None:
            self._work.wait()

    def _on_analysed(self, waiting):
        waiting.reset()
        waiting.deleteLater()
        if self._work.error is not None:
            dialogs.show_error(self._window, 'The noise cannot be analysed', self._work.error)
            return
        self.figures = AnalysisWindow(self._work.result, self._window)
        self.figures.show()


def _analysed(document):
    from ros_3d_bb_annotator.analysis import analyse  # optional scipy and matplotlib take a second
    return analyse(document)
