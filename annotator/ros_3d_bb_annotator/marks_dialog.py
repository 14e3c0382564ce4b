"""Dialog for the floor marks: a table, a grid generator, and tables from files and the clipboard."""
from ros_3d_bb_annotator.marks import checked, grid_of, mark_of, parse_marks
from ros_3d_bb_annotator.qt import QtGui, QtWidgets

HEADER = ('Name', 'X', 'Z')


class MarksDialog(QtWidgets.QDialog):
    """Table of marks. `marks` are the accepted ones. Lengths are those of the fields of the true position."""

    def __init__(self, marks, parent=None):
        super(MarksDialog, self).__init__(parent)
        self.setWindowTitle('Floor marks')
        self.resize(640, 480)
        self.marks = tuple(marks)
        self.table = QtWidgets.QTableWidget(0, len(HEADER), self)
        self.table.setHorizontalHeaderLabels(HEADER)
        self.table.horizontalHeader().setSectionResizeMode(QtWidgets.QHeaderView.Stretch)
        self.show_marks(marks)
        self.x_field, self.z_field = QtWidgets.QLineEdit('-600 0 600'), QtWidgets.QLineEdit('1500 2000 2500 3000')
        self.problem = QtWidgets.QLabel()
        self.problem.setStyleSheet('color: #a04000; font-weight: bold')
        self.problem.setWordWrap(True)
        self._lay_out()

    def show_marks(self, marks):
        """Replace the rows by marks."""
        self.table.setRowCount(0)
        for mark in marks:
            self._add((mark.name, '%g' % round(1000 * mark.x_m, 3), '%g' % round(1000 * mark.z_m, 3)))

    def add_empty(self):
        self._add(('', '', ''))
        self.table.setCurrentCell(self.table.rowCount() - 1, 0)
        self.table.setFocus()

    def remove_current(self):
        self.table.removeRow(self.table.currentRow())

    def add_grid(self):
        self._succeeds(lambda: self._append(grid_of(self.x_field.text(), self.z_field.text())))

    def paste(self):
        """Add the marks in the clipboard."""
        text = QtGui.QGuiApplication.clipboard().text()
        self._succeeds(lambda: self._append(parse_marks(text)))

    def ask_file(self):
        path, _kind = QtWidgets.QFileDialog.getOpenFileName(self, 'Open floor marks', '', 'Table (*.csv *.txt *.tsv)')
        if path:
            self._succeeds(lambda: self.open(path))

    def open(self, path):
        """Add the marks in a file. Raises OSError or ValueError."""
        with open(path, encoding='utf-8-sig') as stream:
            self._append(parse_marks(stream.read()))

    def accept(self):
        """Close the dialog if every row is a mark. Otherwise name the invalid row."""
        if self._succeeds(lambda: setattr(self, 'marks', self._read())):
            super(MarksDialog, self).accept()

    def _append(self, marks):
        self.show_marks(checked(self._read() + marks))

    def _succeeds(self, change):
        try:
            change()
        except (ValueError, OSError) as error:
            self.problem.setText(str(error))
            return False
        self.problem.clear()
        return True

    def _lay_out(self):
        buttons = QtWidgets.QDialogButtonBox(QtWidgets.QDialogButtonBox.Ok | QtWidgets.QDialogButtonBox.Cancel)
        for text, call in (('A&dd', self.add_empty), ('&Remove', self.remove_current), ('&Paste', self.paste),
                           ('Open &CSV…', self.ask_file)):
            button = buttons.addButton(text, QtWidgets.QDialogButtonBox.ActionRole)
            button.setAutoDefault(False)
            button.clicked.connect(call)
        buttons.accepted.connect(self.accept)
        buttons.rejected.connect(self.reject)
        grid, add_grid = QtWidgets.QGridLayout(), QtWidgets.QPushButton('Add a &grid')
        add_grid.setAutoDefault(False)
        add_grid.clicked.connect(self.add_grid)
        for row, (text, field) in enumerate((('X of the columns A, B, …', self.x_field),
                                             ('Z of the rows 1, 2, …', self.z_field))):
            grid.addWidget(QtWidgets.QLabel(text), row, 0)
            grid.addWidget(field, row, 1)
        grid.addWidget(add_grid, 1, 2)
        layout = QtWidgets.QVBoxLayout(self)
        layout.addWidget(QtWidgets.QLabel('X is to the right of the camera, Z ahead of it, in mm or with a unit '
                                          '(1.5 m).'))
        layout.addWidget(self.table)
        layout.addLayout(grid)
        layout.addWidget(self.problem)
        layout.addWidget(buttons)

    def _add(self, texts):
        row = self.table.rowCount()
        self.table.insertRow(row)
        for column, text in enumerate(texts):
            self.table.setItem(row, column, QtWidgets.QTableWidgetItem(text))

    def _read(self):
        """Convert the rows to marks without empty rows. Raises ValueError."""
        rows = [[self.table.item(row, column).text() for column in range(len(HEADER))]
                for row in range(self.table.rowCount())]
        return checked([mark_of(*texts, where='Row %d' % number) for number, texts in enumerate(rows, 1) if any(texts)])
