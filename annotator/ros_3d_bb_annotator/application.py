"""Annotator application with a window."""
import signal
import sys

from ros_3d_bb_annotator.main_window import AnnotatorWindow
from ros_3d_bb_annotator.qt import QtCore, QtWidgets

WAKE_MS = 250


def make_application():
    """Create the QApplication of this process."""
    application = QtWidgets.QApplication(sys.argv[:1])
    application.setApplicationName('ros_3d_bb annotator')
    application.setStyle('Fusion')  # same appearance on all platforms
    return application


def run_window(folder=None):
    """Show the window, optionally with the session in `folder`, until it is closed. Returns the exit status."""
    application = make_application()
    signal.signal(signal.SIGINT, lambda _number, _frame: application.closeAllWindows())
    wake = QtCore.QTimer(interval=WAKE_MS)  # Python handles signals only while it executes bytecode
    wake.timeout.connect(lambda: None)
    wake.start()
    window = AnnotatorWindow()
    window.show()
    if folder is not None:
        QtCore.QTimer.singleShot(0, lambda: window.open_session(folder))
    return application.exec_()
