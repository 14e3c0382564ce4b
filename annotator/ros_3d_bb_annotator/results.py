"""Export and noise analysis from the window."""
import os
from concurrent.futures import ThreadPoolExecutor

from ros_3d_bb_annotator import dialogs
from ros_3d_bb_annotator.estimates import ESTIMATOR
from ros_3d_bb_annotator.export import analyse, export
from ros_3d_bb_annotator.qt import QtCore, QtGui, QtWidgets, Signal


class Results(QtCore.QObject):
    """Exports and analyses the document of a window. `analysis` is the last one, see `export.analyse`."""

    _analysed = Signal()

    def __init__(self, window):
        super(Results, self).__init__(window)
        self._window, self.is_busy, self.analysis = window, False, None

    def ask_export(self):
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
        """Run the noise analysis in a thread, and open its report. Editing is blocked meanwhile."""
        waiting = QtWidgets.QProgressDialog('Fitting the error model…', None, 0, 0, self._window)
        waiting.setWindowTitle('Noise analysis')
        self._analysed.connect(waiting.accept)
        self.is_busy = True
        with ThreadPoolExecutor(1) as thread:
            future = thread.submit(analyse, self._window.document.folder, None, ESTIMATOR)
            future.add_done_callback(lambda _future: self._analysed.emit())
            waiting.exec_()
        self.is_busy = False
        waiting.deleteLater()
        if future.exception() is not None:
            dialogs.show_error(self._window, 'The noise analysis failed', future.exception())
            return
        self.analysis, folder = future.result()
        text = ('Report and figures are in %s; %s' % (folder, self.analysis.model_note)
                if self.analysis.model_note else 'Report, figures and error model are in %s' % folder)
        if self.analysis.inputs.outliers:
            text += '; %d implausible positions were left out (Ctrl+I)' % len(self.analysis.inputs.outliers)
        self._window.statusBar().showMessage(text)
        QtGui.QDesktopServices.openUrl(QtCore.QUrl.fromLocalFile(str(folder / 'report.html')))
