"""Dialogs with questions and messages."""
from ros_3d_bb_annotator.marks_dialog import MarksDialog
from ros_3d_bb_annotator.qt import QtWidgets

REASONS = ('', 'not on the mark', 'person cut by the border', 'person hidden', 'nobody there', 'wrong depth')


def show_error(parent, what, error):
    """Show an error message: what failed, and why."""
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
    """Let the user edit the marks on the floor. Returns the new marks, or None if the dialog is cancelled."""
    dialog = MarksDialog(marks, parent)
    return dialog.marks if dialog.exec_() == QtWidgets.QDialog.Accepted else None
