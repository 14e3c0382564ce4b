"""jackal.launch with a second computer: two hosts with a network between them and clocks that differ."""
import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from typing import NamedTuple

import pytest

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
SUPPORT = os.path.join(ROOT, 'test', 'support')
PORT, AHEAD_S, WANTED = 11815, 1000.0, 4
WAIT_FOR_MASTER = 'import rosgraph, time\nwhile not rosgraph.is_master_online(): time.sleep(0.1)'
SCENE = """
duration: 100.0
rate: 3.0
people:
- {start: [3.0, 0.3], facing: 3.1}
"""


class Host(NamedTuple):
    """A computer: its address, and the prefix of commands that run on it."""

    address: str
    enter: tuple


@contextlib.contextmanager
def processes():
    """Start processes; at the end, those still running are ended, the last first."""
    started = []

    def start(command, **options):
        started.append(subprocess.Popen(command, **options))
        return started[-1]
    try:
        yield start
    finally:
        for process in reversed(started):
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
                with contextlib.suppress(subprocess.TimeoutExpired):
                    process.wait(15)
                process.kill()
            process.wait()


def network(start):
    """Two hosts, (robot, other), in network namespaces with a cable between them.

    If namespaces are not permitted (in some containers), two addresses of this machine, which are not isolated.
    """
    own = [] if os.geteuid() == 0 else ['--user', '--map-root-user']
    holders, enters = [], [()]
    try:
        for _host in range(2):
            command = list(enters[-1]) + ['unshare'] + (own if not holders else []) + ['--net', 'sleep', '600']
            holders.append(start(command, stderr=subprocess.DEVNULL))
            time.sleep(0.5)
            pid = str(holders[-1].pid)
            user = ['--user', '--preserve-credentials'] if own else []
            enters.append(tuple(['nsenter', '--target', pid, '--net'] + user))
        robot, other = Host('10.99.7.1', enters[1]), Host('10.99.7.2', enters[2])
        ip = shutil.which('ip', path='/usr/sbin:/sbin:/usr/bin:/bin') or 'ip'
        subprocess.check_call(list(robot.enter) + [ip, 'link', 'add', 'cable0', 'type', 'veth', 'peer', 'name',
                                                   'cable1', 'netns', str(holders[1].pid)])
        for host, cable in ((robot, 'cable0'), (other, 'cable1')):
            for words in (['addr', 'add', host.address + '/24', 'dev', cable], ['link', 'set', cable, 'up'],
                          ['link', 'set', 'lo', 'up']):
                subprocess.check_call(list(host.enter) + [ip] + words)
        return robot, other
    except (OSError, subprocess.CalledProcessError) as error:
        print('no network namespaces here: %s' % error)
        return Host('127.0.0.7', ()), Host('127.0.0.8', ())


def environment_script(folder, host):
    """The environment script of the README for the other computer."""
    path = folder / 'env.sh'
    path.write_text('#!/bin/sh\nexport ROS_IP=%s PYTHONPATH=%s:$PYTHONPATH CLOCK_AHEAD_S=%s\nunset ROS_HOSTNAME\n'
                    'exec "$@"\n' % (host.address, os.path.join(SUPPORT, 'other_clock'), AHEAD_S))
    path.chmod(0o755)
    return str(path)


@pytest.fixture(scope='module')
def received(tmp_path_factory):
    """Messages received by a listener on the robot, and the two hosts."""
    folder = tmp_path_factory.mktemp('two_machines')
    (folder / 'scene.yaml').write_text(SCENE)
    with processes() as start:
        robot, other = network(start)
        environment = dict(os.environ, ROS_IP=robot.address, ROS_MASTER_URI='http://%s:%d' % (robot.address, PORT),
                           OTHER_COMPUTER=other.address, ENTER_OTHER=' '.join(other.enter), ROS_LOG_DIR=str(folder))
        environment.pop('ROS_HOSTNAME', None)
        with_ssh = dict(environment, PYTHONPATH='%s:%s' % (
            os.path.join(SUPPORT, 'two_machines'), environment['PYTHONPATH']))
        run = list(robot.enter) + [sys.executable]
        start(run + ['-c', 'import roslaunch; roslaunch.main()', '-p', str(PORT), 'ros_3d_bb', 'jackal.launch',
                     'driver:=none', 'detector:=depth', 'frame_world:=odom', 'computer:=' + other.address,
                     'computer_user:=somebody_else', 'computer_env:=' + environment_script(folder, other)],
              env=with_ssh)
        subprocess.check_call(run + ['-c', WAIT_FOR_MASTER], env=environment, timeout=60)
        start(run + [os.path.join(ROOT, 'scripts', 'simulator_node'), '_scenario:=%s' % (folder / 'scene.yaml'),
                     '_wait_for_subscribers:=1'], env=environment)
        listener = os.path.join(SUPPORT, 'two_machines', 'listener.py')
        output = subprocess.check_output(run + [listener, str(WANTED), '90'], env=environment,
                                         universal_newlines=True)
    line, = [line for line in output.splitlines() if line.startswith('RECEIVED ')]
    return json.loads(line[len('RECEIVED '):]), robot, other


def test_the_pipeline_runs_on_the_other_computer(received):
    message, robot, other = received
    assert message['nodes']['/tracker_node'].startswith('http://%s:' % other.address)
    for name in ('/simulator_node', '/camera_mount'):
        assert message['nodes'][name].startswith('http://%s:' % robot.address)


def test_tracks_have_the_stamps_of_the_images_with_another_clock(received):
    message, _robot, _other = received
    assert message['clocks']['tracker_node'] == pytest.approx(AHEAD_S, abs=20)
    assert message['clocks']['simulator_node'] == pytest.approx(0, abs=20)
    found = [stamp for stamp, frame, people in message['tracks'] if people == 1 and frame == 'odom']
    assert len(found) >= WANTED and set(found) <= set(message['images'])
