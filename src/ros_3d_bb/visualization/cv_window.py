"""OpenCV window. All calls must be made from the main thread, as the GUI toolkits require."""
import os
import subprocess
import sys

import cv2
import numpy as np

FLAGS = 0x10  # WINDOW_GUI_NORMAL, which old versions do not define: no toolbar, resizable with fixed aspect ratio
NO_KEY = 255
REMEDY = 'set ~window:=false (launch argument window:=false) to run without a window'


class Window(object):
    """Window that shows images and reads keys. Raises ValueError if there is no display, or OpenCV has no GUI."""

    def __init__(self, title):
        _check_display()
        self._title = title
        try:
            cv2.namedWindow(title, cv2.WINDOW_NORMAL | FLAGS)
        except cv2.error as error:
            raise ValueError('OpenCV cannot open a window: %s; %s' % (str(error).strip(), REMEDY))
        self._size_px = None

    @property
    def is_closed(self):
        """Whether the user closed the window."""
        if self._size_px is None:
            return False
        visible = cv2.getWindowProperty(self._title, cv2.WND_PROP_VISIBLE)
        if visible < 0:  # also of open windows with GTK, in OpenCV 4.2 and 4.5.1
            return cv2.getWindowProperty(self._title, cv2.WND_PROP_AUTOSIZE) < 0
        return visible < 1

    def show(self, picture):
        """Show an RGB image and resize the window to its size."""
        if picture.shape != self._size_px:
            self._size_px = picture.shape
            cv2.resizeWindow(self._title, picture.shape[1], picture.shape[0])
        cv2.imshow(self._title, np.ascontiguousarray(picture[..., ::-1]))

    def key(self, wait_ms):
        """Wait for a key up to `wait_ms`. Returns its character, or '' if no key is pressed.

        If several keys were pressed since the last call, OpenCV's Qt windows return the last one and drop the others.
        """
        code = cv2.waitKey(wait_ms) & 0xff
        return '' if code == NO_KEY else chr(code)

    def close(self):
        cv2.destroyAllWindows()
        cv2.waitKey(1)  # the toolkit closes the window in its event loop


def _check_display():
    """Try to open a window in a separate process, because OpenCV aborts the process if the display does not respond."""
    if not (os.environ.get('DISPLAY') or os.environ.get('WAYLAND_DISPLAY')):
        raise ValueError('there is no display (DISPLAY is not set); %s' % REMEDY)
    trial = [sys.executable, '-c', 'import cv2; cv2.namedWindow("trial")']
    if subprocess.call(trial, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL):
        raise ValueError('no window can be opened on the display %s; %s' % (os.environ.get('DISPLAY'), REMEDY))
