"""Dialogs with questions and messages."""
from ros_3d_bb_annotator.marks import parse_marks
from ros_3d_bb_annotator.qt import QtWidgets

REASONS = ('', 'not on the mark', 'truncated by the image border', 'occluded', 'nobody found', 'wrong depth')
MOST_SHOWN = 5
MARKS_HINT = ('One mark per line: name, X to the right of the camera, Z ahead of it,\n'
              'in mm or with a unit, such as: A1, -600, 1.5 m')


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
    """Ask about implausible truths: {index: lines of text or Outlier} among `count` measurements. Returns whether to
    enter them."""
    found = [problem for lines in problems.values() for problem in lines]
    box = QtWidgets.QMessageBox(QtWidgets.QMessageBox.Warning, 'Implausible position',
                                '<b>%s</b>' % ('Is this the true position?' if count == 1 else
                                               'The position is implausible for %d of %d measurements'
                                               % (len(problems), count)), QtWidgets.QMessageBox.NoButton, parent)
    lines = [str(problem) if count > 1 else getattr(problem, 'description', problem) for problem in found]
    text = '\n'.join(lines[:MOST_SHOWN] + ['…'] * (len(lines) > MOST_SHOWN))
    box.setInformativeText(text[:1].upper() + text[1:])
    correct = box.addButton('&Correct it', QtWidgets.QMessageBox.RejectRole)
    enter = box.addButton('&Enter it anyway', QtWidgets.QMessageBox.AcceptRole)
    box.setDefaultButton(correct)
    box.setEscapeButton(correct)
    box.exec_()
    return box.clickedButton() is enter


def ask_marks(parent, marks):
    """Let the user edit the marks on the floor. Returns the new marks, or the old ones if the dialog is cancelled."""
    dialog = QtWidgets.QInputDialog(parent)
    dialog.setOption(QtWidgets.QInputDialog.UsePlainTextEditForTextInput)
    dialog.setWindowTitle('Floor marks')
    dialog.resize(480, 480)
    dialog.setLabelText(MARKS_HINT)
    dialog.setTextValue('\n'.join('%s\t%.10g\t%.10g' % (
        mark.name, round(1000 * mark.x_m, 3), round(1000 * mark.z_m, 3)) for mark in marks))
    while dialog.exec_():
        try:
            return parse_marks(dialog.textValue())
        except ValueError as error:
            dialog.setLabelText('%s\n\n%s' % (MARKS_HINT, error))
    return tuple(marks)
