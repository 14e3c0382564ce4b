"""Drive the annotator's window on a display by real keys and a real mouse. Import it when DISPLAY is set."""
import os
import subprocess

os.environ['QT_QPA_PLATFORM'] = 'xcb'  # before Qt is imported
from support.window import Driver, QtCore  # noqa: E402

KEYSYMS = {'-': 'minus', '.': 'period'}


class Hands(Driver):
    """A Driver whose keys and clicks come from the display."""

    def key(self, *names):
        """Press keys by X's names for them; a digit, a minus or a point may be named as it is."""
        self._do('key', *[KEYSYMS.get(name, name) for name in names])

    def point_and_click(self, widget, place):
        """Move the mouse to a place (QPointF) in a widget and click."""
        there = widget.mapToGlobal(place.toPoint())
        self._do('mousemove', str(there.x()), str(there.y()), 'click', '1')

    def click_in_image(self, pixel):
        """Click on a pixel (u, v) of the colour image."""
        view = self.window.pane.color_view
        self.point_and_click(view, view.transform().map(QtCore.QPointF(*pixel)))

    def _do(self, *command):
        process = subprocess.Popen(('xdotool',) + command)
        self.wait_for(lambda: process.poll() is not None)
        assert process.returncode == 0
