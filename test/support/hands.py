"""Drive the window of the annotator by keys and the mouse of a display. Import it after DISPLAY is set."""
import os
import subprocess

os.environ['QT_QPA_PLATFORM'] = 'xcb'  # before Qt is imported
from support.window import Driver, QtCore  # noqa: E402

KEYSYMS = {'-': 'minus', '.': 'period'}


class Hands(Driver):
    """A Driver with key presses and clicks on the display."""

    def key(self, *names):
        """Press keys, given by their names in X, or as a digit, a minus or a point."""
        self._do('key', *[KEYSYMS.get(name, name) for name in names])

    def point_and_click(self, widget, position):
        """Click on a position (QPointF) in a widget."""
        pixel = widget.mapToGlobal(position.toPoint())
        self._do('mousemove', str(pixel.x()), str(pixel.y()), 'click', '1')

    def click_in_image(self, pixel):
        """Click on a pixel (u, v) of the colour image."""
        view = self.window.pane.color_view
        self.point_and_click(view, view.transform().map(QtCore.QPointF(*pixel)))

    def _do(self, *command):
        process = subprocess.Popen(('xdotool',) + command)
        self.wait_for(lambda: process.poll() is not None)
        assert process.returncode == 0
