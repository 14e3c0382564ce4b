"""Dialog to edit the marks on the floor."""
from ros_3d_bb_annotator.measurement import Mark
from ros_3d_bb_annotator.qt import QtCore, QtWidgets

HEADER = ('name', 'X [mm]', 'Z [mm]')


class MarksDialog(QtWidgets.QDialog):
    """Table of marks in millimetres. `marks` are the accepted ones."""

    def __init__(self, marks, parent=None):
        super(MarksDialog, self).__init__(parent)
        self.setWindowTitle('Marks on the floor')
        self.resize(560, 420)
        self.marks = tuple(marks)
        self.table = QtWidgets.QTableWidget(0, len(HEADER), self)
        self.table.setHorizontalHeaderLabels(HEADER)
        self.table.horizontalHeader().setSectionResizeMode(QtWidgets.QHeaderView.Stretch)
        for mark in marks:
            self._add((mark.name, '%g' % round(1000 * mark.x_m, 3), '%g' % round(1000 * mark.z_m, 3)))
        self._problem = QtWidgets.QLabel()
        self._problem.setStyleSheet('color: #b00020')
        self._problem.setWordWrap(True)
        layout = QtWidgets.QVBoxLayout(self)
        layout.addWidget(QtWidgets.QLabel('X is to the right of the camera, Z ahead of it.'))
        layout.addWidget(self.table)
        layout.addWidget(self._problem)
        layout.addLayout(self._buttons())

    def _buttons(self):
        row = QtWidgets.QHBoxLayout()
        for text, call in (('&Add a mark', self.add_empty), ('&Remove it', self.remove_current)):
            button = QtWidgets.QPushButton(text)
            button.setAutoDefault(False)
            button.clicked.connect(call)
            row.addWidget(button)
        row.addStretch()
        box = QtWidgets.QDialogButtonBox(QtWidgets.QDialogButtonBox.Ok | QtWidgets.QDialogButtonBox.Cancel)
        box.accepted.connect(self.accept)
        box.rejected.connect(self.reject)
        row.addWidget(box)
        return row

    def add_empty(self):
        """Add a row and select it."""
        self._add(('', '', ''))
        self.table.setCurrentCell(self.table.rowCount() - 1, 0)
        self.table.setFocus()

    def remove_current(self):
        """Remove the selected row."""
        if self.table.currentRow() >= 0:
            self.table.removeRow(self.table.currentRow())

    def accept(self):
        """Close the dialog if every row is a mark. Otherwise name the invalid row."""
        try:
            self.marks = self._read()
        except ValueError as error:
            self._problem.setText(str(error))
            return
        super(MarksDialog, self).accept()

    def _add(self, texts):
        row = self.table.rowCount()
        self.table.insertRow(row)
        for column, text in enumerate(texts):
            self.table.setItem(row, column, QtWidgets.QTableWidgetItem(text))

    def _read(self):
        """Convert the rows to marks without empty rows. Raises ValueError."""
        marks = []
        for row in range(self.table.rowCount()):
            name, x_mm, z_mm = (self.table.item(row, column).text().strip() for column in range(len(HEADER)))
            if not (name or x_mm or z_mm):
                continue
            if not name or name in [mark.name for mark in marks]:
                raise ValueError('Row %d: the name %r is empty or used before' % (row + 1, name))
            marks.append(Mark(name, *(_metres(text, 'Row %d' % (row + 1)) for text in (x_mm, z_mm))))
        return tuple(marks)


def _metres(text, where):
    value_mm, is_number = QtCore.QLocale.c().toDouble(text)
    if not is_number:
        raise ValueError('%s: %r is not a length in millimetres' % (where, text))
    return value_mm / 1000
