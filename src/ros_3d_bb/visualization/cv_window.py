"""OpenCV window. All calls must be made from the main thread, as the GUI toolkits require."""
import os
import subprocess
import sys

import cv2
import numpy as np

FLAGS = 0x10  # WINDOW_GUI_NORMAL, which old versions do not define: no toolbar, resizable with fixed aspect ratio
# X keysyms of keys on the keypad, and of those that edit text
KEYSYMS = {0xff08: '\b', 0xff0d: '\r', 0xff8d: '\r', 0xff1b: '\x1b', 0xffad: '-', 0xffae: '.'}
KEYSYMS.update((0xffb0 + digit, str(digit)) for digit in range(10))
REMEDY = 'set ~window to false to run without a window'


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
        if self._size_px is None:
            return False
        visible = cv2.getWindowProperty(self._title, cv2.WND_PROP_VISIBLE)
        if visible < 0:  # also of open windows with GTK, in OpenCV 4.2 and 4.5.1
            return cv2.getWindowProperty(self._title, cv2.WND_PROP_AUTOSIZE) < 0
        return visible < 1

    def show(self, picture):
        if picture.shape != self._size_px:
            self._size_px = picture.shape
            cv2.resizeWindow(self._title, picture.shape[1], picture.shape[0])
        cv2.imshow(self._title, np.ascontiguousarray(picture[..., ::-1]))

    def key(self, wait_ms):
        """Wait for a key up to `wait_ms`. Returns its character, or '' if it has none, or no key is pressed.

        If several keys were pressed since the last call, OpenCV's Qt windows return the last one and drop the others.
        Letters are lower case there.
        """
        return character_of(cv2.waitKeyEx(wait_ms))

    def close(self):
        cv2.destroyAllWindows()
        cv2.waitKey(1)  # the toolkit closes the window in its event loop


def character_of(code):
    """Character of a key code of `cv2.waitKeyEx`; '' for no key (-1), and for keys such as Shift and the arrows.

    The lower 16 bits are a Latin-1 character or an X keysym, whose lower 8 bits alone would be another character.
    Qt's codes of letters such as ö are negative.
    """
    if code < -1:
        return chr(code & 0xff).lower()
    keysym = code & 0xffff
    return chr(keysym) if keysym < 0x100 else KEYSYMS.get(keysym, '')


def _check_display():
    """Try to open a window in a separate process, because OpenCV aborts the process if the display does not respond."""
    if not (os.environ.get('DISPLAY') or os.environ.get('WAYLAND_DISPLAY')):
        raise ValueError('there is no display (DISPLAY is not set); %s' % REMEDY)
    trial = [sys.executable, '-c', 'import cv2; cv2.namedWindow("trial")']
    if subprocess.call(trial, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL):
        raise ValueError('no window can be opened on the display %s; %s' % (os.environ.get('DISPLAY'), REMEDY))
