"""A short soak: the whole graph under roslaunch, with faults.

Two invariants depend on the speed of the machine, which other programs change; here they only have to be reported. They
are tested in test/unit/test_soak_invariants.py.
"""
import json
import os
import signal
import subprocess
import sys

import pytest

from soak.faults import FAULTS
from soak.graph import Graph
from support.processes import processes_naming

TEST = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
SCENE = {'duration': 2.0, 'rate': 5.0, 'people': [{'start': [3.0, 0.6], 'facing': 3.1, 'repeat': True, 'moves': [
    {'to': [3.0, -0.6], 'speed': 0.6}, {'to': [3.0, 0.6], 'speed': 0.6}]}, {'start': [4.0, -0.7], 'facing': 3.1}]}
LOG = """\x1b[1mprocess[master]: started with pid [10]\x1b[0m
process[rosout-1]: started with pid [11]
\x1b[1mprocess[bbox3d_node-2]: started with pid [12]\x1b[0m
process[tracker_node-3]: started with pid [13]
\x1b[31m[bbox3d_node-2] process has died [pid 12, exit code -9, cmd bbox3d_node].
log file: bbox3d_node-2*.log\x1b[0m
[bbox3d_node-2] restarting process
\x1b[1mprocess[bbox3d_node-2]: started with pid [18]\x1b[0m
[tracker_node-3] process has finished cleanly
[ERROR] [160.1]: bad callback: <bound method>
Traceback (most recent call last):
KeyError: 3
"""
TIMEOUT_S = 1200
SPEED_DEPENDENT = {'queues do not grow', 'CPU time per image is flat'}


@pytest.fixture
def soaking(tmp_path):
    """Starts a soak of a small scene; the command lines of its nodes contain the log folder `tmp_path`."""
    (tmp_path / 'scene.yaml').write_text(json.dumps(SCENE))
    environment = dict(os.environ, ROS_HOSTNAME='localhost', ROS_LOG_DIR=str(tmp_path),
                       PYTHONPATH=os.pathsep.join([TEST, os.environ.get('PYTHONPATH', '')]))
    processes = []

    def start(*arguments):
        command = [sys.executable, '-m', 'soak', '--scenarios', str(tmp_path / 'scene.yaml'), '--images', '8', '--rate',
                   '5'] + list(arguments)
        processes.append(subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                          universal_newlines=True, env=environment, cwd=str(tmp_path)))
        return processes[-1]

    yield start
    for process in processes:
        if process.poll() is None:
            process.terminate()
            process.communicate(timeout=TIMEOUT_S)


def test_a_short_soak_violates_no_invariant(soaking, tmp_path):
    """Each kind of fault occurs. The limit of the recovery time depends on the load of the machine."""
    process = soaking('--minutes', '1.5', '--seed', '8', '--recover-within', '600', '--json', 'soak.json')
    printed, progress = process.communicate(timeout=TIMEOUT_S)
    assert (tmp_path / 'soak.json').exists(), printed + progress
    found = json.loads((tmp_path / 'soak.json').read_text())
    broken = set(invariant['name'] for invariant in found['invariants'] if not invariant['holds'])
    assert broken <= SPEED_DEPENDENT and process.returncode == bool(broken), printed + progress
    assert SPEED_DEPENDENT < set(invariant['name'] for invariant in found['invariants'])
    assert all(fault['recovered_s'] is not None for fault in found['faults'])
    assert len(found['faults']) >= len(FAULTS)
    assert set(process['node'] for process in found['processes']) == {
        'depth_detector_node', 'bbox3d_node', 'tracker_node', 'planner_bridge_node'}
    assert found['arrays']['ros_3d_bb/tracks'] > 0 and found['sent']['camera/color/image_raw'] > 0
    assert '%d images sent' % found['images'] in printed and 'tracker_node' in printed
    assert processes_naming(str(tmp_path)) == 0


def test_after_ctrl_c_violations_are_printed_and_no_process_remains(soaking, tmp_path):
    """Recovery within 0 s is impossible."""
    process = soaking('--minutes', '30', '--recover-within', '0')
    progress = ''
    while process.poll() is None and '   2 faults' not in progress[-200:]:
        progress += process.stderr.read(50)
    process.send_signal(signal.SIGINT)
    printed, _progress = process.communicate(timeout=TIMEOUT_S)
    violation = printed[printed.index('BROKEN  the graph recovers'):].splitlines()[1]
    assert process.returncode == 1 and violation.strip().startswith('at 0:'), printed
    assert processes_naming(str(tmp_path)) == 0


@pytest.mark.parametrize('arguments, status, reason', [
    (('--minutes', '0'), 2, 'more than 0'), (('--rate', '-1'), 2, '-1'),
    (('--detector', 'yolov5'), 2, 'needs --weights'), (('--scenarios', 'nowhere.yaml'), 1, 'nowhere.yaml')])
def test_invalid_arguments_are_rejected(soaking, arguments, status, reason):
    process = soaking(*arguments)
    _printed, errors = process.communicate(timeout=TIMEOUT_S)
    assert process.returncode == status and reason in errors and 'Traceback' not in errors


def test_the_log_of_roslaunch_is_parsed():
    graph = Graph('launch.log', 0, [])
    for line in LOG.splitlines():
        graph.parse(1.0, line)
    assert graph.pids == {'bbox3d_node': 18, 'tracker_node': 13}
    assert graph.deaths == [(1.0, 12, 'bbox3d_node (process 12) ended with exit code -9'),
                            (1.0, 13, 'tracker_node (process 13) ended with a clean exit')]
    (_at_s, text), = graph.errors
    assert text.startswith('[ERROR] [160.1]: bad callback') and text.endswith('KeyError: 3')
