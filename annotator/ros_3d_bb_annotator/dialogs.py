"""Questions and messages in windows of their own."""
from ros_3d_bb_annotator.marks_dialog import MarksDialog
from ros_3d_bb_annotator.qt import QtWidgets

REASONS = ('', 'not on the mark', 'person cut by the border', 'person hidden', 'nobody there', 'wrong depth')


def show_error(parent, what, error):
    """Say what did not work, and why."""
    box = QtWidgets.QMessageBox(QtWidgets.QMessageBox.Critical, what, '<b>%s</b>' % what,
                                QtWidgets.QMessageBox.Ok, parent)
    box.setInformativeText(str(error))
    box.exec_()


def ask_reason(parent, name):
    """Why a measurement is rejected; empty where that was called off."""
    reason, accepted = QtWidgets.QInputDialog.getItem(parent, 'Reject', 'Why is measurement %s not to be used?' % name,
                                                      REASONS, 0, True)
    return reason.strip() if accepted else ''


def ask_marks(parent, marks):
    """The marks on the floor as edited, None where that was called off."""
    dialog = MarksDialog(marks, parent)
    return dialog.marks if dialog.exec_() == QtWidgets.QDialog.Accepted else None
