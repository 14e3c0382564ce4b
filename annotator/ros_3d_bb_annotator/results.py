"""Export and noise analysis from the window. The analysis runs in a separate thread."""
import os

from ros_3d_bb_annotator import dialogs
from ros_3d_bb_annotator.export import export
from ros_3d_bb_annotator.qt import Qt, QtCore, QtGui, QtWidgets

TITLES = {
    'figure_5_2.png': 'Depth error by distance, and the theory of stereo cameras',
    'figure_5_3.png': 'Z error by true Z', 'figure_5_4.png': 'Variance of the Z error',
    'figure_5_5.png': 'X error by true X', 'figure_5_6.png': 'Variance of the X error',
    'figure_5_7.png': 'Distribution of the Z error', 'figure_5_8.png': 'Distribution of the X error'}


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
    """Exports and analyses the document of a window. `figures` is the last AnalysisWindow."""

    def __init__(self, window):
        super(Results, self).__init__(window)
        self._window, self._work, self.figures = window, None, None

    def ask_export(self):
        """Ask for a file and write the table of errors to it."""
        path, _kind = QtWidgets.QFileDialog.getSaveFileName(
            self._window, 'Export CSV', os.path.join(self._window.document.folder, 'measurements.csv'), 'CSV (*.csv)')
        if path:
            self.export(path)

    def export(self, path):
        """Write the table of errors to a file, or show an error message."""
        try:
            count = export(self._window.document, path)
        except (ValueError, OSError) as error:
            dialogs.show_error(self._window, 'The table was not written', error)
            return
        self._window.statusBar().showMessage('%d measurements written to %s' % (count, path))

    def analyse(self):
        """Run the noise analysis and show its figures. Editing is blocked meanwhile."""
        self._window.keep_typed()
        waiting = QtWidgets.QProgressDialog('The noise analysis takes some seconds.', '', 0, 0, self._window)
        waiting.setWindowTitle('Noise analysis')
        waiting.setCancelButton(None)
        waiting.setWindowModality(Qt.WindowModal)
        waiting.setMinimumDuration(0)
        waiting.show()
        document = self._window.document
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
            dialogs.show_error(self._window, 'The noise analysis failed', self._work.error)
            return
        self.figures = AnalysisWindow(self._work.result, self._window)
        self.figures.show()


def _analysed(document):
    from ros_3d_bb_annotator.analysis import analyse  # optional scipy and matplotlib take a second
    return analyse(document)


class AnalysisWindow(QtWidgets.QDialog):
    """Shows an `analysis.Analysed`: a list of figures, and the current one scaled to the width of its scroll area."""

    def __init__(self, analysed, parent=None):
        super(AnalysisWindow, self).__init__(parent)
        self.setWindowTitle('Noise analysis – %s' % analysed.folder)
        self.setAttribute(Qt.WA_DeleteOnClose)
        self.resize(1150, 780)
        summary = QtWidgets.QLabel('\n'.join(filter(None, (
            analysed.text, analysed.no_model and 'No cross-validated error model: %s' % analysed.no_model,
            'Report, figures and error model are in %s' % analysed.folder))))
        summary.setTextInteractionFlags(Qt.TextSelectableByMouse)
        summary.setWordWrap(True)
        self._figure_paths, self._full = analysed.figure_paths, QtGui.QPixmap()
        self.names, self.picture, self._area = QtWidgets.QListWidget(), QtWidgets.QLabel(), QtWidgets.QScrollArea()
        self.names.addItems([TITLES[os.path.basename(path)] for path in analysed.figure_paths])
        self.names.setFixedWidth(280)
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
        self._full = QtGui.QPixmap(self._figure_paths[row])
        self._fit()

    def _fit(self):
        width = min(self._area.viewport().width(), self._full.width())
        self.picture.setPixmap(self._full.scaledToWidth(width, Qt.SmoothTransformation))
