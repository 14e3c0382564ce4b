"""Dialogs with questions and messages."""
from ros_3d_bb_annotator.measurement import Mark
from ros_3d_bb_annotator.qt import QtCore, QtWidgets

REASONS = ('', 'not on the mark', 'person truncated by the border', 'person occluded', 'no person', 'wrong depth')
HEADER = ('name', 'X [mm]', 'Z [mm]')


def show_error(parent, what, error):
    box = QtWidgets.QMessageBox(QtWidgets.QMessageBox.Critical, what, '<b>%s</b>' % what,
                                QtWidgets.QMessageBox.Ok, parent)
    box.setInformativeText(str(error))
    box.exec_()


def ask_reason(parent, name):
    """Ask for the reason of a rejection. Returns an empty text if the dialog is cancelled."""
    reason, accepted = QtWidgets.QInputDialog.getItem(parent, 'Reject', 'Reason for rejecting measurement %s:' % name,
                                                      REASONS, 0, True)
    return reason.strip() if accepted else ''


def ask_marks(parent, marks):
    """Let the user edit the marks on the floor. Returns the new marks, or the old ones if the dialog is cancelled."""
    dialog = MarksDialog(marks, parent)
    dialog.exec_()
    return dialog.marks


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
        self.problem = QtWidgets.QLabel()
        self.problem.setStyleSheet('color: #b00020')
        self.problem.setWordWrap(True)
        buttons = QtWidgets.QDialogButtonBox(QtWidgets.QDialogButtonBox.Ok | QtWidgets.QDialogButtonBox.Cancel)
        for text, call in (('&Add a mark', self.add_empty), ('&Remove the mark', self.remove_current)):
            button = buttons.addButton(text, QtWidgets.QDialogButtonBox.ActionRole)
            button.setAutoDefault(False)
            button.clicked.connect(call)
        buttons.accepted.connect(self.accept)
        buttons.rejected.connect(self.reject)
        layout = QtWidgets.QVBoxLayout(self)
        for widget in (QtWidgets.QLabel('X is to the right of the camera, Z ahead of it.'), self.table, self.problem,
                       buttons):
            layout.addWidget(widget)

    def add_empty(self):
        self._add(('', '', ''))
        self.table.setCurrentCell(self.table.rowCount() - 1, 0)
        self.table.setFocus()

    def remove_current(self):
        self.table.removeRow(self.table.currentRow())

    def accept(self):
        """Close the dialog if every row is a mark. Otherwise name the invalid row."""
        try:
            self.marks = self._read()
        except ValueError as error:
            self.problem.setText(str(error))
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
                raise ValueError('Row %d: the name %r is empty or not unique' % (row + 1, name))
            marks.append(Mark(name, *(_metres(text, 'Row %d' % (row + 1)) for text in (x_mm, z_mm))))
        return tuple(marks)


def _metres(text, where):
    value_mm, is_number = QtCore.QLocale.c().toDouble(text)
    if not is_number:
        raise ValueError('%s: %r is not a length in millimetres' % (where, text))
    return value_mm / 1000
