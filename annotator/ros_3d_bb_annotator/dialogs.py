"""Dialogs with questions and messages."""
from ros_3d_bb.sessions.plausibility import position_text as plausible_text
from ros_3d_bb_annotator.marks import parse_marks
from ros_3d_bb_annotator.qt import QtWidgets

REASONS = ('', 'not on the mark', 'truncated by the image border', 'occluded', 'nobody found', 'wrong depth')
ENTER_ALL = 'enter all'
MOST_SHOWN = 5


def show_error(parent, what, error):
    box = QtWidgets.QMessageBox(QtWidgets.QMessageBox.Critical, what, '<b>%s</b>' % what,
                                QtWidgets.QMessageBox.Ok, parent)
    box.setInformativeText(str(error))
    box.exec_()


def ask_reason(parent, names):
    """Ask for the reason of a rejection. Returns an empty text if the dialog is cancelled."""
    what = names[0] if len(names) == 1 else '%d measurements' % len(names)
    reason, accepted = QtWidgets.QInputDialog.getItem(parent, 'Reject', 'Reason for rejecting %s:' % what, REASONS, 0,
                                                      True)
    return reason.strip() if accepted else ''


def ask_implausible(parent, problems, count):
    """Ask about implausible truths: {index: lines of text or Outlier} among `count` measurements.

    Returns ENTER_ALL, the truth (x, y, z) that was intended, or None to correct it.
    """
    found = [problem for lines in problems.values() for problem in lines]
    box = QtWidgets.QMessageBox(QtWidgets.QMessageBox.Warning, 'Implausible position',
                                '<b>%s</b>' % ('Is this the true position?' if count == 1 else
                                               'The position is implausible for %d of %d measurements'
                                               % (len(problems), count)), QtWidgets.QMessageBox.NoButton, parent)
    lines = [str(problem) if count > 1 else _first_upper(getattr(problem, 'description', problem)) for problem in found]
    box.setInformativeText('\n'.join(lines[:MOST_SHOWN] + ['…'] * (len(lines) > MOST_SHOWN)))
    correct = box.addButton('&Correct it', QtWidgets.QMessageBox.RejectRole)
    answers = {box.addButton('&Enter it anyway', QtWidgets.QMessageBox.AcceptRole): ENTER_ALL}
    intended = {tuple(problem.intended_m) for problem in found if getattr(problem, 'intended_m', None) is not None}
    if len(intended) == 1 and len(problems) == count:
        (x_m, z_m), = intended
        use = box.addButton('&Use %s' % plausible_text((x_m, z_m)), QtWidgets.QMessageBox.AcceptRole)
        answers[use] = x_m, None, z_m
    box.setDefaultButton(correct)
    box.setEscapeButton(correct)
    box.exec_()
    return answers.get(box.clickedButton())


def _first_upper(text):
    return text[:1].upper() + text[1:]


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


def ask_marks(parent, marks):
    """Let the user edit the marks on the floor. Returns the new marks, or the old ones if the dialog is cancelled."""
    dialog = MarksDialog(marks, parent)
    dialog.exec_()
    return dialog.marks
