"""The environment of real planners, built from archives, or of replicas where there are no archives."""
import os
import subprocess
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
STAND_INS = os.path.join(ROOT, 'test', 'support', 'stand_ins')
ENVIRONMENT = 'import os, sys; sys.stdout.write("\\0".join("%s=%s" % item for item in os.environ.items()))'


def planner_environment(folder):
    """Environment for roslaunch, and whether its move_base and costmap_2d are the real ones.

    The real ones are built on the first call (`./run planners`, in the cache of ./run). `folder` is an empty folder for
    packages of replicas.
    """
    if not os.path.isdir(os.path.join(os.environ.get('ROS_3D_BB_DATA', ''), 'planners')):
        return _replicas(folder), False
    environment = {name: value for name, value in os.environ.items() if name != 'ROS_3D_BB_CACHE'}  # see conftest.py
    setup = subprocess.check_output([os.path.join(ROOT, 'run'), 'planners'], env=environment).decode().split()[-1]
    text = subprocess.check_output(['bash', '-c', 'source %s --extend && exec %s -c \'%s\''
                                    % (setup, sys.executable, ENVIRONMENT)]).decode()
    return dict(pair.split('=', 1) for pair in text.split('\0')), True


def _replicas(folder):
    """Packages move_base and costmap_2d whose nodes are `support.replica_nodes`."""
    for package, node in (('move_base', 'move_base'), ('costmap_2d', 'costmap_2d_node')):
        path = os.path.join(folder, package)
        os.makedirs(path)
        with open(os.path.join(path, 'package.xml'), 'w') as stream:
            stream.write('<package format="2"><name>%s</name></package>' % package)
        with open(os.path.join(path, node), 'w') as stream:
            stream.write('#!%s\nfrom support.replica_nodes import %s\n%s()\n' % (sys.executable, node, node))
        os.chmod(os.path.join(path, node), 0o755)
    paths = {'ROS_PACKAGE_PATH': [folder], 'PYTHONPATH': [STAND_INS, os.path.join(ROOT, 'test')]}
    return dict(os.environ, **{name: os.pathsep.join(added + [os.environ.get(name, '')])
                               for name, added in paths.items()})
