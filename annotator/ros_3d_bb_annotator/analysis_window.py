"""Window with the figures of the noise analysis."""
import os

from ros_3d_bb_annotator.qt import Qt, QtCore, QtGui, QtWidgets

TITLES = {
    'figure_5_2': 'Depth error by distance, and the theory of stereo cameras',
    'figure_5_3': 'Z error by true Z', 'figure_5_4': 'Variance of the Z error',
    'figure_5_5': 'X error by true X', 'figure_5_6': 'Variance of the X error',
    'figure_5_7': 'Distribution of the Z error', 'figure_5_8': 'Distribution of the X error'}


class FigureArea(QtWidgets.QScrollArea):
    """Shows an image, scaled down to the available width if necessary."""

    def __init__(self, parent=None):
        super(FigureArea, self).__init__(parent)
        self.picture, self._full = QtWidgets.QLabel(), QtGui.QPixmap()
        self.picture.setAlignment(Qt.AlignCenter)
        self.picture.setStyleSheet('background: white')
        self.setWidget(self.picture)
        self.setWidgetResizable(True)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarAlwaysOff)

    def show_picture(self, path):
        """Show the image of a file."""
        self._full = QtGui.QPixmap(path)
        self._fit()

    def resizeEvent(self, event):  # noqa: N802 (Qt's name)
        super(FigureArea, self).resizeEvent(event)
        self._fit()

    def _fit(self):
        if not self._full.isNull():
            width = min(self.viewport().width(), self._full.width())
            self.picture.setPixmap(self._full.scaledToWidth(width, Qt.SmoothTransformation))


class AnalysisWindow(QtWidgets.QDialog):
    """Shows an `analysis.Analysed`."""

    def __init__(self, analysed, parent=None):
        super(AnalysisWindow, self).__init__(parent)
        self.setWindowTitle('Noise analysis – %s' % analysed.folder)
        self.setAttribute(Qt.WA_DeleteOnClose)
        self.resize(1150, 780)
        self.names, self.figure = QtWidgets.QListWidget(), FigureArea()
        self._report_path = analysed.report_path
        summary = QtWidgets.QLabel('\n'.join(filter(None, (
            analysed.text, analysed.no_model and 'No cross-validated error model: %s' % analysed.no_model,
            'Report, figures and error model are in %s' % analysed.folder))))
        summary.setTextInteractionFlags(Qt.TextSelectableByMouse)
        summary.setWordWrap(True)
        for path in analysed.figure_paths:
            item = QtWidgets.QListWidgetItem(_title_of(path))
            item.setData(Qt.UserRole, path)
            self.names.addItem(item)
        self.names.setFixedWidth(280)
        self.names.setWordWrap(True)
        self.names.currentItemChanged.connect(self._show)
        self._lay_out(summary)
        self.names.setCurrentRow(0)

    def _lay_out(self, summary):
        buttons = QtWidgets.QDialogButtonBox(QtWidgets.QDialogButtonBox.Close)
        report = buttons.addButton('Open the &report', QtWidgets.QDialogButtonBox.ActionRole)
        report.clicked.connect(self._open_report)
        buttons.rejected.connect(self.reject)
        figures = QtWidgets.QHBoxLayout()
        figures.addWidget(self.names)
        figures.addWidget(self.figure, 1)
        layout = QtWidgets.QVBoxLayout(self)
        layout.addWidget(summary)
        layout.addLayout(figures, 1)
        layout.addWidget(buttons)

    def _show(self, item, _previous=None):
        if item is not None:
            self.figure.show_picture(item.data(Qt.UserRole))

    def _open_report(self):
        QtGui.QDesktopServices.openUrl(QtCore.QUrl.fromLocalFile(self._report_path))


def _title_of(path):
    name = os.path.splitext(os.path.basename(path))[0]
    return TITLES.get(name, name)
