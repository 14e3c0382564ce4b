"""Drive the annotator's window: keys go to the widget with the keyboard focus, clicks to positions in a widget."""
import importlib
import os

os.environ.setdefault('QT_QPA_PLATFORM', 'offscreen')  # before Qt is imported; a virtual display does as well

from ros_3d_bb_annotator.document import Document  # noqa: E402
from ros_3d_bb_annotator.main_window import AnnotatorWindow, make_application  # noqa: E402
from ros_3d_bb_annotator.qt import Qt, QtCore, QtGui, QtWidgets  # noqa: E402

QtTest = importlib.import_module(QtCore.__name__.replace('QtCore', 'QtTest'))  # of the binding that is in use
CONTROL, SHIFT = Qt.ControlModifier, Qt.ShiftModifier
TRIES, WAIT_MS = 1000, 20
FORGOTTEN_MS = 10000
APPLICATION = make_application()  # Qt ends with the last reference to it


def close_forgotten(before=None):
    """Close a dialog that was open at the last call, too: without an answer, the test would wait forever."""
    dialog = QtWidgets.QApplication.activeModalWidget()
    if dialog is not None and dialog is before and not isinstance(dialog, QtWidgets.QProgressDialog):
        dialog.close()
    QtCore.QTimer.singleShot(FORGOTTEN_MS, lambda: close_forgotten(dialog))


close_forgotten()


class Driver(object):
    """An AnnotatorWindow that is shown, with a session."""

    def __init__(self, folder):
        self.window = AnnotatorWindow()
        self.window.show()
        self.window.activateWindow()
        QtTest.QTest.qWaitForWindowActive(self.window)
        self.opened = self.window.open_session(folder)
        self.settle()

    @property
    def document(self):
        return self.window.document

    def measurement(self, number):
        return self.document.measurements[number]

    def press(self, *keys):
        """Press keys: Qt's numbers, (key, modifiers), or text to be typed."""
        for key in keys:
            widget = QtWidgets.QApplication.focusWidget() or self.window
            if isinstance(key, str):
                QtTest.QTest.keyClicks(widget, key)
            else:
                QtTest.QTest.keyClick(widget, *(key if isinstance(key, tuple) else (key,)))
        self.settle()

    def click(self, widget, place, modifiers=Qt.NoModifier):
        QtTest.QTest.mouseClick(widget, Qt.LeftButton, modifiers, place.toPoint())
        self.settle()

    def drag(self, widget, start, end, modifiers=Qt.NoModifier):
        QtTest.QTest.mousePress(widget, Qt.LeftButton, modifiers, start.toPoint())
        for place in ((start + end) / 2, end):  # QTest.mouseMove presses no button
            QtWidgets.QApplication.sendEvent(widget, QtGui.QMouseEvent(
                QtCore.QEvent.MouseMove, place, Qt.NoButton, Qt.LeftButton, modifiers))
        QtTest.QTest.mouseRelease(widget, Qt.LeftButton, modifiers, end.toPoint())
        self.settle()

    def answer(self, reply, act):
        """Open a dialog by `act()`, and return what `reply(dialog)` returns."""
        replies = []

        def reply_when_it_is_there():
            dialog = QtWidgets.QApplication.activeModalWidget()
            if dialog is None or not dialog.isVisible() or isinstance(dialog, QtWidgets.QProgressDialog):
                QtCore.QTimer.singleShot(10, reply_when_it_is_there)
                return
            try:
                replies.append(reply(dialog))
            finally:
                if dialog.isVisible():
                    dialog.close()  # a reply that fails must not leave the test waiting

        QtCore.QTimer.singleShot(0, reply_when_it_is_there)
        act()
        self.wait_for(lambda: replies)
        self.window.activateWindow()  # a window manager would
        QtTest.QTest.qWaitForWindowActive(self.window)
        self.settle()
        return replies[0]

    def wait_for(self, condition):
        for _ in range(TRIES):
            if condition():
                return
            QtTest.QTest.qWait(WAIT_MS)
        raise AssertionError('timeout')

    def settle(self):
        for _ in range(5):
            QtWidgets.QApplication.processEvents()

    def close(self):
        self.window.close()
        self.window.deleteLater()
        self.settle()


def opened(folder):
    return Document(folder).measurements
