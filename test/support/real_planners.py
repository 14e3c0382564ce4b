"""The environment of the real planners, which are built from archives in ROS_3D_BB_DATA."""
import os
import subprocess

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))


def planner_environment():
    """Environment for roslaunch with move_base and costmap_2d.

    They are built on the first call (`./run planners`, in the cache of ./run).
    """
    environment = {name: value for name, value in os.environ.items() if name != 'ROS_3D_BB_CACHE'}  # see conftest.py
    printed = subprocess.check_output([os.path.join(ROOT, 'run'), 'planners'], env=environment).decode().split()
    assert printed, 'ROS_3D_BB_DATA contains no archives of the planners'
    setup = printed[-1]
    text = subprocess.check_output(['bash', '-c', 'source %s --extend && env -0' % setup]).decode()
    return dict(pair.split('=', 1) for pair in text.rstrip('\0').split('\0'))
