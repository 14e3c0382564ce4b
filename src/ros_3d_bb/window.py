"""A window on the screen, by OpenCV. All of it in the main thread, as the toolkits below want it."""
import os
import subprocess
import sys

import cv2
import numpy as np

FLAGS = 0x10  # WINDOW_GUI_NORMAL, which old versions do not name: no toolbar; to be resized, with its proportions
NO_KEY = 255


class WindowError(ValueError):
    """No window can be opened; says why."""


class Window(object):
    """A window that shows pictures and takes keys.

    Raises
    ------
    WindowError
        If there is no display, or this OpenCV has no windows.
    """

    def __init__(self, title):
        check_display()
        self._title = title
        try:
            cv2.namedWindow(title, cv2.WINDOW_NORMAL | FLAGS)
        except cv2.error as error:
            raise WindowError('OpenCV opens no window: %s' % str(error).strip())
        self._size_px = None

    @property
    def is_closed(self):
        """Whether somebody closed it."""
        return self._size_px is not None and cv2.getWindowProperty(self._title, cv2.WND_PROP_VISIBLE) < 1

    def show(self, picture):
        """Show an RGB picture; the window takes its size."""
        if picture.shape != self._size_px:
            self._size_px = picture.shape
            cv2.resizeWindow(self._title, picture.shape[1], picture.shape[0])
        cv2.imshow(self._title, np.ascontiguousarray(picture[..., ::-1]))

    def key(self, wait_ms):
        """The key that is pressed within a time, as a character; '' where none is.

        Of several that came since the last call, OpenCV's Qt windows give the last one and drop the others.
        """
        code = cv2.waitKey(wait_ms) & 0xff
        return '' if code == NO_KEY else chr(code)

    def close(self):
        """Close the window."""
        cv2.destroyAllWindows()
        cv2.waitKey(1)  # the toolkit closes it only now


def check_display():
    """Raise WindowError where no window can be opened.

    Tried in a process of its own: where the display does not answer, OpenCV's toolkit ends the process.
    """
    if not (os.environ.get('DISPLAY') or os.environ.get('WAYLAND_DISPLAY')):
        raise WindowError('there is no display (DISPLAY is not set)')
    trial = [sys.executable, '-c', 'import cv2; cv2.namedWindow("trial")']
    if subprocess.call(trial, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL):
        raise WindowError('no window can be opened on the display %s' % os.environ.get('DISPLAY'))
