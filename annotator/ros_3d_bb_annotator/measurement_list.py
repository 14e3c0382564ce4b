"""List of measurements with their states: a Qt model, and a view with a filter and a search."""
from ros_3d_bb_annotator.lengths import number_text
from ros_3d_bb_annotator.measurement import ANNOTATED, NEW, NOBODY, REJECTED, STATES
from ros_3d_bb_annotator.qt import Qt, QtCore, QtGui, QtWidgets, Signal

COLUMNS = ('ID', 'Label', 'State', 'X', 'Z', 'Error')
STATE_COLUMN, NUMBERS = COLUMNS.index('State'), ('X', 'Z', 'Error')
IMPLAUSIBLE, INVALID = 'implausible', 'invalid'
# Okabe and Ito's colours, which are different for all kinds of colour vision
COLORS = {NEW: QtGui.QColor(0, 114, 178), NOBODY: QtGui.QColor(170, 80, 0), ANNOTATED: QtGui.QColor(40, 40, 40),
          REJECTED: QtGui.QColor(130, 130, 130), IMPLAUSIBLE: QtGui.QColor(150, 60, 0),
          INVALID: QtGui.QColor(150, 60, 0)}
WARNING_GROUND = QtGui.QColor(255, 224, 178)
SORT_ROLE = Qt.UserRole


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
        return IMPLAUSIBLE if state == ANNOTATED and self._document.is_implausible(row) else state

    def matches(self, row, state, text):
        """Whether a row has a state ('': any) and contains a text."""
        measurement = self._document.measurements[row]
        texts = [measurement.id, measurement.label, measurement.rejected or ''] + self._texts(row)[STATE_COLUMN:]
        return state in ('', self.state_of(row)) and any(text.casefold() in part.casefold() for part in texts)

    def data(self, index, role=Qt.DisplayRole):
        row, column = index.row(), index.column()
        if role == Qt.DisplayRole:
            return self._texts(row)[column]
        if role == SORT_ROLE:
            return self._sort_key(row, column)
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

    def _values_m(self, row):
        """True x and z, and the distance of the estimate, or None."""
        truth_m, errors_m = self._document.measurements[row].truth_m, self._document.known_errors(row)
        x_m, _y_m, z_m = truth_m or (None, None, None)
        return x_m, z_m, None if errors_m is None else errors_m[2]

    def _texts(self, row):
        measurement = self._document.measurements[row]
        values_m = zip(self._values_m(row), (True, False, False))
        return [measurement.id, measurement.label, self.state_of(row)] + [
            '' if value_m is None else number_text(value_m, signed) for value_m, signed in values_m]

    def _sort_key(self, row, column):
        if COLUMNS[column] not in NUMBERS:
            return self._texts(row)[column]
        value_m = self._values_m(row)[NUMBERS.index(COLUMNS[column])]
        return float('-inf') if value_m is None else value_m


class Filter(QtCore.QSortFilterProxyModel):
    """Rows with a state and a text."""

    state, text = '', ''

    def show(self, state, text):
        self.state, self.text = state, text
        self.invalidateFilter()

    def filterAcceptsRow(self, row, _parent):  # noqa: N802 (Qt's name)
        return not (self.state or self.text) or self.sourceModel().matches(row, self.state, self.text)


class Table(QtWidgets.QTableView):
    """Table whose selection is extended by the user only, not while the window goes on with Ctrl or Shift pressed."""

    def selectionCommand(self, index, event=None):  # noqa: N802 (Qt's name)
        if event is None:
            return QtCore.QItemSelectionModel.ClearAndSelect | QtCore.QItemSelectionModel.Rows
        return super(Table, self).selectionCommand(index, event)


class MeasurementList(QtWidgets.QWidget):
    """List with a filter. `chosen` is emitted with the index of the measurement that the user selects."""

    chosen = Signal(int)

    def __init__(self, parent=None):
        super(MeasurementList, self).__init__(parent)
        self._model, self._filter = MeasurementModel(self), Filter(self)
        self._filter.setSourceModel(self._model)
        self._filter.setSortRole(SORT_ROLE)
        self.filter_box, self.search = QtWidgets.QComboBox(), QtWidgets.QLineEdit()
        for state in ('',) + STATES + (IMPLAUSIBLE,):
            self.filter_box.addItem(state, state)
        self.search.setPlaceholderText('Search (Ctrl+F)')
        self.search.setClearButtonEnabled(True)
        self.filter_box.currentIndexChanged.connect(self._on_filter)
        self.search.textChanged.connect(self._on_filter)
        self.table = self._make_table()
        layout = QtWidgets.QVBoxLayout(self)
        layout.setContentsMargins(6, 6, 0, 6)
        for widget in (self.filter_box, self.search, self.table):
            layout.addWidget(widget)

    @property
    def selection(self):
        """Indices of the selected measurements in the order of the session."""
        return sorted(self._filter.mapToSource(index).row() for index in self.table.selectionModel().selectedRows())

    def show_document(self, document):
        self._document = document
        self._model.show_document(document)
        self._show_counts()

    def update_rows(self):
        self._model.update_rows()
        self._show_counts()

    def mark_current(self, number):
        """Select the current measurement without emitting `chosen`."""
        index = self._filter.mapFromSource(self._model.index(number, 0))
        self.blockSignals(True)
        if not index.isValid():
            self.table.clearSelection()
        elif index.row() != self.table.currentIndex().row():
            self.table.setCurrentIndex(index)
        self.blockSignals(False)

    def _make_table(self):
        table = Table()
        table.setModel(self._filter)
        table.setSelectionBehavior(QtWidgets.QTableView.SelectRows)
        table.setSelectionMode(QtWidgets.QTableView.ExtendedSelection)
        # The order of the session, until the user selects a column. Qt 5.10 does not sort by a column of -1 later.
        table.horizontalHeader().setSortIndicator(-1, Qt.AscendingOrder)
        table.setSortingEnabled(True)
        table.setTabKeyNavigation(False)
        table.setShowGrid(False)
        table.setWordWrap(False)
        table.setTextElideMode(Qt.ElideMiddle)  # names that contain times differ at the end
        table.verticalHeader().hide()
        table.verticalHeader().setSectionResizeMode(QtWidgets.QHeaderView.Fixed)  # no sizes of invisible rows
        table.verticalHeader().setDefaultSectionSize(table.fontMetrics().height() + 6)
        header, metrics = table.horizontalHeader(), table.fontMetrics()
        for column, text in enumerate(('00000_00', 'Label', 'nobody found', '\u22120.000', '00.000', 'Error')):
            header.resizeSection(column, metrics.boundingRect(text).width() + 12)
        table.selectionModel().currentChanged.connect(self._on_current)
        return table

    def _on_current(self, index, _previous):
        if index.isValid():
            self.chosen.emit(self._filter.mapToSource(index).row())

    def _on_filter(self):
        self._filter.show(self.filter_box.currentData(), self.search.text().strip())

    def _show_counts(self):
        states = [self._model.state_of(row) for row in range(self._model.rowCount())]
        self.filter_box.setItemText(0, 'all measurements (%d)' % len(states))
        for row in range(1, self.filter_box.count()):
            state = self.filter_box.itemData(row)
            self.filter_box.setItemText(row, '%s (%d)' % (state, states.count(state)))
