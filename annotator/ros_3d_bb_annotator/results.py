"""Export and noise analysis from the window; the analysis runs in a thread of its own."""
import os

from ros_3d_bb_annotator import dialogs
from ros_3d_bb_annotator.analysis_window import AnalysisWindow
from ros_3d_bb_annotator.export import export
from ros_3d_bb_annotator.qt import Qt, QtCore, QtWidgets


class Work(QtCore.QThread):
    """Calls `work()` in a thread; afterwards `result` is what it returned, or `error` what it raised."""

    def __init__(self, work, parent=None):
        super(Work, self).__init__(parent)
        self._work, self.result, self.error = work, None, None

    def run(self):
        try:
            self.result = self._work()
        except Exception as error:  # whatever a library raises is for the one who waits for it
            self.error = error


class Results(QtCore.QObject):
    """What is made of a document, for a window. `figures` is the AnalysisWindow that was shown last."""

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
        """Write the table of errors to a file, or say in a message why not."""
        try:
            count = export(document, path)
        except (ValueError, OSError) as error:
            dialogs.show_error(self._window, 'The table is not written', error)
            return
        self._window.statusBar().showMessage('%d measurements are in %s' % (count, path))

    def analyse(self, document):
        """Run the noise analysis of a document and show its figures; nothing is edited meanwhile."""
        waiting = QtWidgets.QProgressDialog('The noise analysis runs; it takes some seconds.', '', 0, 0, self._window)
        waiting.setWindowTitle('Noise analysis')
        waiting.setCancelButton(None)
        waiting.setWindowModality(Qt.WindowModal)
        waiting.setMinimumDuration(0)
        waiting.show()
        self._work = Work(lambda: _analysed(document), self)
        self._work.finished.connect(lambda: self._on_analysed(waiting))
        self._work.start()

    def wait(self):
        """Wait for an analysis that is running: Qt must not go before its threads."""
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
    from ros_3d_bb_annotator.analysis import analyse  # scipy and matplotlib take a second, and are not always there
    return analyse(document)
