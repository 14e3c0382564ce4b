"""Qt 5 from where it is: through python_qt_binding on a machine with ROS, as plain PyQt5 without."""
try:
    from python_qt_binding import QtCore, QtGui, QtWidgets
except ImportError:
    from PyQt5 import QtCore, QtGui, QtWidgets

Qt = QtCore.Qt
Signal = getattr(QtCore, 'Signal', None) or QtCore.pyqtSignal

__all__ = ['Qt', 'QtCore', 'QtGui', 'QtWidgets', 'Signal']
