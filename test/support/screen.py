"""A virtual display, and keys and clicks that come from it as from any keyboard and mouse."""
import atexit
import os
import subprocess


def start_screen(width=1600, height=900):
    """Start a virtual display with nobody else on it, named by DISPLAY; it ends with this process. Returns it."""
    # without -noreset, a program that connects while the last client disconnects is turned away
    process = subprocess.Popen(['Xvfb', '-noreset', '-displayfd', '1', '-screen', '0', '%dx%dx24' % (width, height)],
                               stdout=subprocess.PIPE)
    atexit.register(process.kill)  # not before: Qt does not live longer than its display
    os.environ['DISPLAY'] = ':' + process.stdout.readline().decode().strip()
    return process


def press(title, key):
    """Press a key in the window with a title, which no window manager gives the focus. Returns whether it is there."""
    return subprocess.call(['xdotool', 'search', '--onlyvisible', '--name', title, 'windowfocus', '--sync',
                            'key', key]) == 0
