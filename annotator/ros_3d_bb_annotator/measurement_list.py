"""List of measurements with their states: a Qt model, and a view."""
from ros_3d_bb.sessions.session_reader import ANNOTATED, NEW, NOBODY, REJECTED
from ros_3d_bb.sessions.session_writer import ID_FORMAT
from ros_3d_bb_annotator.lengths import number_text
from ros_3d_bb_annotator.qt import Qt, QtCore, QtGui, QtWidgets, Signal

COLUMNS = ('ID', 'X', 'Z', 'Error', 'State', 'Label')  # the first ones are visible in a small window
NUMBERS = 'X', 'Z', 'Error'
IMPLAUSIBLE, INVALID = 'implausible', 'invalid'
# Okabe and Ito's colours, which are different for all kinds of colour vision
COLORS = {NEW: QtGui.QColor(0, 114, 178), NOBODY: QtGui.QColor(170, 80, 0), ANNOTATED: QtGui.QColor(40, 40, 40),
          REJECTED: QtGui.QColor(130, 130, 130), IMPLAUSIBLE: QtGui.QColor(150, 60, 0),
          INVALID: QtGui.QColor(150, 60, 0)}
WARNING_GROUND = QtGui.QColor(255, 224, 178)


class MeasurementModel(QtCore.QAbstractTableModel):
    """Model with one row per measurement of a document. Cells are computed when they are shown."""

    def __init__(self, parent=None):
        super(MeasurementModel, self).__init__(parent)
        self._document, self._count = None, 0

    def show_document(self, document):
        self.beginResetModel()
        self._document, self._count = document, len(document.measurements)
        self.endResetModel()

    def update_rows(self):
        if len(self._document.measurements) != self._count:
            self.show_document(self._document)
        elif self._count:
            self.dataChanged.emit(self.index(0, 0), self.index(self._count - 1, len(COLUMNS) - 1))

    def rowCount(self, parent=QtCore.QModelIndex()):  # noqa: N802 (Qt's name)
        return 0 if parent.isValid() else self._count

    def columnCount(self, parent=QtCore.QModelIndex()):  # noqa: N802
        return 0 if parent.isValid() else len(COLUMNS)

    def headerData(self, section, orientation, role=Qt.DisplayRole):  # noqa: N802
        if role == Qt.DisplayRole and orientation == Qt.Horizontal:
            return COLUMNS[section]
        if role == Qt.ToolTipRole and COLUMNS[section] in NUMBERS:
            return {'X': 'True X [mm]', 'Z': 'True Z [mm]'}.get(
                COLUMNS[section], 'Distance of the analysed estimate from the true position [mm]')
        return None

    def state_of(self, row):
        """State that is shown: that of the measurement, 'implausible' or 'invalid'."""
        measurement = self._document.measurements[row]
        if measurement.problem is not None and measurement.rejected is None:
            return INVALID
        state = measurement.state
        return IMPLAUSIBLE if state == ANNOTATED and row in self._document.estimates.implausible() else state

    def data(self, index, role=Qt.DisplayRole):
        row, column = index.row(), index.column()
        if role == Qt.DisplayRole:
            return self._texts(row)[column]
        if role == Qt.ForegroundRole:
            return QtGui.QBrush(COLORS[self.state_of(row)])
        if role == Qt.BackgroundRole and self.state_of(row) == IMPLAUSIBLE:
            return QtGui.QBrush(WARNING_GROUND)
        if role == Qt.ToolTipRole:
            measurement = self._document.measurements[row]
            return measurement.problem or measurement.rejected or measurement.name
        if role == Qt.TextAlignmentRole and COLUMNS[column] in NUMBERS:
            return int(Qt.AlignRight | Qt.AlignVCenter)
        return None

    def _texts(self, row):
        measurement, errors_m = self._document.measurements[row], self._document.known_errors(row)
        x_m, _y_m, z_m = measurement.truth_m or (None, None, None)
        values_m = (x_m, True), (z_m, False), (None if errors_m is None else errors_m[2], False)
        stored = ID_FORMAT.match(measurement.id)  # its number is unique, and the rest, a stamp, is wide
        return [stored.group(1) if stored else measurement.id] + [
            '' if value_m is None else number_text(value_m, signed) for value_m, signed in values_m] + [
            self.state_of(row), measurement.label]


class MeasurementList(QtWidgets.QTableView):
    """List. `chosen` is emitted with the index of the measurement that the user selects."""

    chosen = Signal(int)

    def __init__(self, parent=None):
        super(MeasurementList, self).__init__(parent)
        model = MeasurementModel(self)
        self.show_document, self.update_rows = model.show_document, model.update_rows
        self.setModel(model)
        self.setSelectionBehavior(QtWidgets.QTableView.SelectRows)
        self.setSelectionMode(QtWidgets.QTableView.ExtendedSelection)
        self.setTabKeyNavigation(False)
        self.setShowGrid(False)
        self.setWordWrap(False)
        self.setTextElideMode(Qt.ElideMiddle)  # names that contain times differ at the end
        self.verticalHeader().hide()
        self.verticalHeader().setSectionResizeMode(QtWidgets.QHeaderView.Fixed)  # no sizes of invisible rows
        self.verticalHeader().setDefaultSectionSize(self.fontMetrics().height() + 6)
        header, metrics = self.horizontalHeader(), self.fontMetrics()
        widths = [metrics.boundingRect(text).width() + 12 for text in (
            '00000_00', '\u22120000', '00000', 'Error', 'nobody found', 'Label')]
        for column, width in enumerate(widths):
            header.resizeSection(column, width)
        self.setMinimumWidth(sum(widths[:4]) + self.style().pixelMetric(QtWidgets.QStyle.PM_ScrollBarExtent) + 4)
        self.selectionModel().currentChanged.connect(self._on_current)

    @property
    def selection(self):
        return sorted(index.row() for index in self.selectionModel().selectedRows())

    def mark_current(self, number):
        """Select the current measurement without emitting `chosen`."""
        self.blockSignals(True)
        if number != self.currentIndex().row():
            self.setCurrentIndex(self.model().index(number, 0))
        self.blockSignals(False)

    def selectionCommand(self, index, event=None):  # noqa: N802 (Qt's name)
        """As in Qt, but only the user extends the selection, not the window that goes on with Ctrl or Shift pressed."""
        if event is None:
            return QtCore.QItemSelectionModel.ClearAndSelect | QtCore.QItemSelectionModel.Rows
        return super(MeasurementList, self).selectionCommand(index, event)

    def _on_current(self, index, _previous):
        if index.isValid():
            self.chosen.emit(index.row())
