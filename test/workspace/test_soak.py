"""The soak for one minute: the whole graph under roslaunch, with faults.

Two invariants go by the time that an image takes, which other programs on the machine change meanwhile: here they only
have to be told. They are tested in test/unit/test_soak_invariants.py.
"""
import argparse
import contextlib
import json
import os
import signal
import subprocess
import sys
from unittest import mock

import pytest

from fuzz.hostile import Source, good_frame
from ros_3d_bb.core.time_sync import NS
from soak.faults import FAULTS
from soak.graph import LAUNCH, Graph
from soak.invariants import it_recovers
from soak.records import INTERRUPTED
from soak.rig import Interrupted, Rig
from support.launching import loaded
from support.running import processes_naming

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
NOW_NS = 1000 * NS
PATIENTLY = '600'  # seconds within which it has to recover: that depends on who else uses the machine
LONGEST_S = 1200  # of a whole soak; nothing takes so long where all is well
BY_THE_CLOCK = {'queues do not grow', 'CPU time of an image is flat'}


@pytest.fixture
def soaking(tmp_path):
    """Starts a soak of a small scene; its nodes have `tmp_path`, where they log, in their command line.

    What still runs at the end of the test is ended, with its nodes.
    """
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
            process.communicate(timeout=LONGEST_S)


def told_in(path):
    """What a soak wrote, and the names of the invariants that broke."""
    found = json.loads(path.read_text())
    return found, set(invariant['name'] for invariant in found['invariants'] if not invariant['holds'])


def test_one_minute_of_faults_breaks_nothing(soaking, tmp_path):
    process = soaking('--minutes', '1', '--seed', '8', '--recover-within', PATIENTLY, '--json', 'soak.json')
    printed, said = process.communicate(timeout=LONGEST_S)
    found, broken = told_in(tmp_path / 'soak.json')
    assert broken <= BY_THE_CLOCK and process.returncode == bool(broken), printed + said
    assert len(found['invariants']) == 10 and BY_THE_CLOCK < set(entry['name'] for entry in found['invariants'])
    assert all(fault['recovered_s'] is not None for fault in found['faults']) and found['faults']
    assert set(process['node'] for process in found['processes']) == {
        'depth_detector_node', 'bbox3d_node', 'tracker_node', 'planner_bridge_node'}
    assert found['arrays']['ros_3d_bb/tracks'] > 0 and found['sent']['camera/color/image_raw'] > 0
    assert '%d images sent' % found['images'] in printed and 'tracker_node' in printed
    assert processes_naming(str(tmp_path)) == 0


def test_an_invariant_that_breaks_is_named_with_the_time_and_the_exit_status_is_1(soaking):
    """Nobody recovers within no time at all."""
    process = soaking('--minutes', '0.2', '--recover-within', '0')
    printed, said = process.communicate(timeout=LONGEST_S)
    assert process.returncode == 1, printed + said
    broken = printed[printed.index('BROKEN  it recovers'):].splitlines()
    assert broken[1].strip().startswith('at 0:')


def test_ctrl_c_ends_everything_and_shows_what_there_is(soaking, tmp_path):
    process = soaking('--minutes', '30', '--recover-within', PATIENTLY, '--json', 'soak.json')
    said = ''
    while process.poll() is None and '   1 faults' not in said[-200:]:  # the progress line
        said += process.stderr.read(50)
    process.send_signal(signal.SIGINT)
    printed, _said = process.communicate(timeout=LONGEST_S)
    _found, broken = told_in(tmp_path / 'soak.json')
    assert broken <= BY_THE_CLOCK and process.returncode == (1 if broken else 130), printed
    assert 'invariants\n' in printed
    assert processes_naming(str(tmp_path)) == 0


@pytest.fixture
def rig():
    """Without a graph, whose only fault is one after which Ctrl-C is pressed, and nobody answers."""
    @contextlib.contextmanager
    def fault(_rig):
        yield 'time jumps back'
        os.kill(os.getpid(), signal.SIGINT)
    before = signal.getsignal(signal.SIGINT)
    with mock.patch('soak.rig.Witness') as witness, mock.patch('soak.rig.Camera') as camera, \
            mock.patch('soak.rig.FAULTS', ((fault, False, True),)):
        witness.return_value = mock.Mock(arrivals={'ros_3d_bb/tracks': []}, tracks=[], statuses=[])
        camera.return_value = mock.Mock(images=[], wrong_ns=[], sent={})
        yield Rig(mock.Mock(deaths=[], errors=[]), [], argparse.Namespace(
            seed=1, rate=5.0, minutes=0.1, recover_within=600.0))
    signal.signal(signal.SIGINT, before)


def test_a_recovery_that_ctrl_c_cuts_short_is_not_judged(rig):
    with pytest.raises(Interrupted):
        rig.play()
    record = rig.record()
    assert [fault.name for fault in record.faults] == [INTERRUPTED] and record.finished_faults == []
    assert it_recovers(2.0)(record).broken == []


@pytest.mark.parametrize('arguments, complaint', [(('--minutes', '0'), 'more than 0'), (('--rate', '-1'), '-1'),
                                                  (('--detector', 'yolov5'), 'needs --weights')])
def test_arguments_that_make_no_sense_are_refused(soaking, arguments, complaint):
    process = soaking(*arguments)
    _printed, said = process.communicate(timeout=LONGEST_S)
    assert process.returncode == 2 and complaint in said


def test_a_scenario_that_is_not_there_is_named(soaking):
    process = soaking('--scenarios', 'nowhere.yaml')
    _printed, said = process.communicate(timeout=LONGEST_S)
    assert process.returncode == 1 and 'nowhere.yaml' in said and 'Traceback' not in said


def test_the_log_of_the_graph_is_understood(tmp_path):
    graph = Graph(str(tmp_path), 0, [])
    for line in LOG.splitlines():
        graph._understand(1.0, line)
    assert graph.pids == {'bbox3d_node': 18, 'tracker_node': 13}
    assert [death[1:] for death in graph.deaths] == [
        ('bbox3d_node', 12, 'died with exit code -9'), ('tracker_node', 13, 'ended by itself')]
    (_at_s, text), = graph.errors
    assert text.startswith('[ERROR] [160.1]: bad callback') and text.endswith('KeyError: 3')


def test_nodes_are_started_again_where_they_end():
    parameters, nodes = loaded(LAUNCH, 'detector:=depth')
    assert parameters['/use_sim_time'] is True and len(nodes) == 4
    assert all(node.respawn for node in nodes.values())


def named_faults(seed, images):
    """The faults of two rounds, with so many images in each; nothing is really done."""
    rig = mock.Mock(source=Source(seed), wrong_source=Source(seed + 1), killed=set())
    rig.graph.pids = {'depth_detector_node': 1, 'bbox3d_node': 2, 'tracker_node': 3}
    names = []
    with mock.patch('soak.faults.os.kill'), mock.patch('soak.faults.subprocess.Popen'), \
            mock.patch('soak.faults.eating_a_core'):
        for fault in 2 * rig.source.sample([fault for fault, _lasts, _disturbs in FAULTS], len(FAULTS)):
            rig.camera.throw_in = None
            with fault(rig) as name:
                names.append((name, rig.source.random()))
                for _image in range(images if rig.camera.throw_in else 0):
                    rig.camera.throw_in(NOW_NS, good_frame(NOW_NS))
    return names


def test_the_seed_says_what_comes_however_many_images_the_machine_sends():
    assert named_faults(3, 1) == named_faults(3, 9) != named_faults(4, 1)
    assert len(set(name for name, _value in named_faults(3, 1))) >= len(FAULTS)


def test_each_kind_of_fault_says_what_it_is():
    assert all(fault.__doc__ for fault, _lasts, _disturbs in FAULTS) and len(FAULTS) >= 11
