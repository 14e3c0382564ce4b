"""Dialog for the floor marks."""
from ros_3d_bb_annotator.marks import parse_marks
from ros_3d_bb_annotator.qt import QtWidgets


class MarksDialog(QtWidgets.QDialog):
    """Text with a mark per line. `marks` are the accepted ones."""

    def __init__(self, marks, parent=None):
        super(MarksDialog, self).__init__(parent)
        self.setWindowTitle('Floor marks')
        self.resize(480, 480)
        self.marks = tuple(marks)
        self.text = QtWidgets.QPlainTextEdit('\n'.join(
            '%s\t%.10g\t%.10g' % (mark.name, round(1000 * mark.x_m, 3), round(1000 * mark.z_m, 3)) for mark in marks))
        self.problem = QtWidgets.QLabel()
        self.problem.setStyleSheet('color: #a04000; font-weight: bold')
        self.problem.setWordWrap(True)
        buttons = QtWidgets.QDialogButtonBox(QtWidgets.QDialogButtonBox.Ok | QtWidgets.QDialogButtonBox.Cancel)
        buttons.accepted.connect(self.accept)
        buttons.rejected.connect(self.reject)
        layout = QtWidgets.QVBoxLayout(self)
        layout.addWidget(QtWidgets.QLabel('One mark per line: name, X to the right of the camera, Z ahead of it,\n'
                                          'in mm or with a unit, such as: A1, -600, 1.5 m'))
        for widget in (self.text, self.problem, buttons):
            layout.addWidget(widget)

    def accept(self):
        """Close the dialog if every line is a mark. Otherwise name the invalid line."""
        try:
            self.marks = parse_marks(self.text.toPlainText())
        except ValueError as error:
            self.problem.setText(str(error))
            return
        super(MarksDialog, self).accept()
