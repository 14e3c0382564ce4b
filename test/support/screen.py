"""A virtual display, and key presses on it."""
import atexit
import os
import subprocess


def start_screen(width=1600, height=900):
    """Start a virtual display, set DISPLAY, and return its process, which ends with this one."""
    # Without -noreset, a program that connects while the last client disconnects is rejected.
    process = subprocess.Popen(['Xvfb', '-noreset', '-displayfd', '1', '-screen', '0', '%dx%dx24' % (width, height)],
                               stdout=subprocess.PIPE)
    atexit.register(process.kill)  # Qt needs its display until the end
    os.environ['DISPLAY'] = ':' + process.stdout.readline().decode().strip()
    return process


def press(title, key):
    """Press a key in the window with a title, after setting the focus. Returns whether there is such a window."""
    return subprocess.call(['xdotool', 'search', '--onlyvisible', '--name', title, 'windowfocus', '--sync',
                            'key', key]) == 0
