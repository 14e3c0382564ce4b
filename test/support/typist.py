"""Annotate all of a session in the window of a process of its own, which may be killed meanwhile.

Says 'typed N' when the truth of measurement N is in the fields, and 'entered N' when Enter has been pressed.
"""
import sys


def truth_mm_of(number):
    """The truth (x, z) that is typed for a measurement."""
    return number, 1000 + 10 * number


def main(folder):
    """Annotate what is new."""
    from support.window import Driver, Qt  # the tests import this module too, and need no Qt for it
    driver = Driver(folder)
    number = driver.window.current
    while driver.measurement(number).state == 'new':
        x_mm, z_mm = truth_mm_of(number)
        driver.press('%d' % x_mm, Qt.Key_Tab, '%d' % z_mm)
        print('typed %d' % number, flush=True)
        driver.press(Qt.Key_Return)
        print('entered %d' % number, flush=True)
        number = driver.window.current


if __name__ == '__main__':
    main(sys.argv[1])
