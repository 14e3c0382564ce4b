"""Qt 5 from python_qt_binding, which comes with ROS, or from PyQt5."""
try:
    from python_qt_binding import QtCore, QtGui, QtWidgets
except ImportError:
    from PyQt5 import QtCore, QtGui, QtWidgets

Qt = QtCore.Qt
Signal = getattr(QtCore, 'Signal', None) or QtCore.pyqtSignal

__all__ = ['Qt', 'QtCore', 'QtGui', 'QtWidgets', 'Signal']
