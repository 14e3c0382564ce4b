"""jackal.launch with a second computer: two addresses of this machine, with clocks that differ."""
import contextlib
import json
import os
import subprocess
import sys

import pytest

from ros_3d_bb_lab.evaluation.launching import free_port
from support.processes import end

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
SUPPORT = os.path.join(ROOT, 'test', 'support')
ROBOT, OTHER = '127.0.0.7', '127.0.0.8'
AHEAD_S, WANTED = 1000.0, 4
WAIT_FOR_MASTER = 'import rosgraph, time\nwhile not rosgraph.is_master_online(): time.sleep(0.1)'
SCENE = """
duration: 100.0
rate: 3.0
people:
- {start: [3.0, 0.3], facing: 3.1}
"""


def environment_script(folder):
    """The environment script of the README for the other computer."""
    path = folder / 'env.sh'
    path.write_text('#!/bin/sh\nexport ROS_IP=%s PYTHONPATH=%s:$PYTHONPATH CLOCK_AHEAD_S=%s\nunset ROS_HOSTNAME\n'
                    'exec "$@"\n' % (OTHER, os.path.join(SUPPORT, 'other_clock'), AHEAD_S))
    path.chmod(0o755)
    return str(path)


@pytest.fixture(scope='module')
def received(tmp_path_factory):
    """Messages received by a listener on the robot."""
    folder = tmp_path_factory.mktemp('two_machines')
    (folder / 'scene.yaml').write_text(SCENE)
    port = free_port()
    environment = dict(os.environ, ROS_IP=ROBOT, ROS_MASTER_URI='http://%s:%d' % (ROBOT, port), OTHER_COMPUTER=OTHER,
                       ROS_LOG_DIR=str(folder))
    environment.pop('ROS_HOSTNAME', None)
    with_ssh = dict(environment, PYTHONPATH='%s:%s' % (
        os.path.join(SUPPORT, 'two_machines'), environment['PYTHONPATH']))
    with contextlib.ExitStack() as running:
        running.callback(end, subprocess.Popen(
            [sys.executable, '-c', 'import roslaunch; roslaunch.main()', '-p', str(port), 'ros_3d_bb', 'jackal.launch',
             'driver:=none', 'detector:=depth', 'frame_world:=odom', 'computer:=' + OTHER,
             'computer_user:=somebody_else', 'computer_env:=' + environment_script(folder)], env=with_ssh))
        subprocess.check_call([sys.executable, '-c', WAIT_FOR_MASTER], env=environment, timeout=60)
        running.callback(end, subprocess.Popen(
            [sys.executable, os.path.join(ROOT, 'scripts', 'simulator_node'), '_scenario:=%s' % (folder / 'scene.yaml'),
             '_wait_for_subscribers:=1'], env=environment))
        listener = os.path.join(SUPPORT, 'two_machines', 'listener.py')
        output = subprocess.check_output([sys.executable, listener, str(WANTED), '90'], env=environment,
                                         universal_newlines=True)
    line, = [line for line in output.splitlines() if line.startswith('RECEIVED ')]
    return json.loads(line[len('RECEIVED '):])


def test_the_pipeline_runs_on_the_other_computer(received):
    hosts = {name: uri.split(':')[1].strip('/') for name, uri in received['nodes'].items()}
    assert hosts == {'/tracker_node': OTHER, '/simulator_node': ROBOT, '/camera_mount': ROBOT}


def test_tracks_have_the_stamps_of_the_images_with_another_clock(received):
    assert received['clocks']['tracker_node'] == pytest.approx(AHEAD_S, abs=20)
    assert received['clocks']['simulator_node'] == pytest.approx(0, abs=20)
    found = [stamp for stamp, frame, people in received['tracks'] if people == 1 and frame == 'odom']
    assert len(found) >= WANTED and set(found) <= set(received['images'])
