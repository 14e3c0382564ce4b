"""List of measurements with their states: a Qt model, and a view with a filter."""
from ros_3d_bb_annotator.qt import Qt, QtCore, QtGui, QtWidgets, Signal

COLUMNS = ('measurement', 'state', 'error')
COLORS = {'new': QtGui.QColor(60, 120, 200), 'annotated': QtGui.QColor(30, 140, 60),
          'rejected': QtGui.QColor(150, 150, 150)}
PROBLEM = QtGui.QColor(190, 0, 40)


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
        return None

    def data(self, index, role=Qt.DisplayRole):
        measurement = self._document.measurements[index.row()]
        if role == Qt.DisplayRole:
            errors = self._document.errors(index.row())
            error = '' if errors is None else '%.0f mm' % (1000 * errors[2])
            return (measurement.id, measurement.state, error)[index.column()]
        if role == Qt.ForegroundRole:
            return QtGui.QBrush(PROBLEM if measurement.problem else COLORS[measurement.state])
        if role == Qt.ToolTipRole:
            return measurement.problem or measurement.rejected or measurement.label or None
        if role == Qt.TextAlignmentRole and index.column() == 2:
            return int(Qt.AlignRight | Qt.AlignVCenter)
        return None


class MeasurementList(QtWidgets.QWidget):
    """List with a filter. `chosen` is emitted with the index of the measurement that the user selects."""

    chosen = Signal(int)

    def __init__(self, parent=None):
        super(MeasurementList, self).__init__(parent)
        self._model, self._filter = MeasurementModel(self), QtCore.QSortFilterProxyModel(self)
        self._filter.setSourceModel(self._model)
        self._filter.setFilterKeyColumn(COLUMNS.index('state'))
        self.filter_box = QtWidgets.QComboBox()
        for state in ('',) + tuple(COLORS):
            self.filter_box.addItem('%s only' % state, state)
        self.filter_box.currentIndexChanged.connect(
            lambda _row: self._filter.setFilterFixedString(self.filter_box.currentData()))
        self.table = self._make_table()
        layout = QtWidgets.QVBoxLayout(self)
        layout.setContentsMargins(6, 6, 0, 6)
        layout.addWidget(self.filter_box)
        layout.addWidget(self.table)

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
        if index.isValid():
            self.table.setCurrentIndex(index)
        else:
            self.table.clearSelection()
        self.blockSignals(False)

    def _make_table(self):
        table = QtWidgets.QTableView()
        table.setModel(self._filter)
        table.setSelectionBehavior(QtWidgets.QTableView.SelectRows)
        table.setSelectionMode(QtWidgets.QTableView.SingleSelection)
        table.setTabKeyNavigation(False)
        table.setShowGrid(False)
        table.setWordWrap(False)
        table.setTextElideMode(Qt.ElideMiddle)  # names that contain times differ at the end
        table.verticalHeader().hide()
        table.verticalHeader().setSectionResizeMode(QtWidgets.QHeaderView.Fixed)  # no sizes of invisible rows
        table.verticalHeader().setDefaultSectionSize(table.fontMetrics().height() + 6)
        table.horizontalHeader().setSectionResizeMode(0, QtWidgets.QHeaderView.Stretch)
        for column, text in ((1, 'annotated'), (2, '00000 mm')):
            table.horizontalHeader().setSectionResizeMode(column, QtWidgets.QHeaderView.Fixed)
            table.horizontalHeader().resizeSection(column, table.fontMetrics().boundingRect(text).width() + 14)
        table.selectionModel().currentChanged.connect(self._on_current)
        return table

    def _on_current(self, index, _previous):
        if index.isValid():
            self.chosen.emit(self._filter.mapToSource(index).row())

    def _show_counts(self):
        states = [measurement.state for measurement in self._document.measurements]
        self.filter_box.setItemText(0, 'all measurements (%d)' % len(states))
        for row, state in enumerate(COLORS, 1):
            self.filter_box.setItemText(row, '%s only (%d)' % (state, states.count(state)))
