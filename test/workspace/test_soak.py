"""A short soak: the whole graph under roslaunch, with faults."""
import json
import os
import subprocess
import sys

import pytest

from soak.faults import FAULTS
from support.processes import processes_naming

TEST = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
SCENE = {'duration': 2.0, 'rate': 5.0, 'people': [{'start': [3.0, 0.6], 'facing': 3.1, 'repeat': True, 'moves': [
    {'to': [3.0, -0.6], 'speed': 0.6}, {'to': [3.0, 0.6], 'speed': 0.6}]}, {'start': [4.0, -0.7], 'facing': 3.1}]}
TIMEOUT_S = 1200


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


@pytest.mark.long
def test_a_short_soak_violates_no_invariant(soaking, tmp_path):
    """Each kind of fault occurs. The limit of the recovery time depends on the load of the machine."""
    process = soaking('--minutes', '1.5', '--seed', '8', '--recover-within', '600', '--json', 'soak.json')
    printed, progress = process.communicate(timeout=TIMEOUT_S)
    assert (tmp_path / 'soak.json').exists(), printed + progress
    found = json.loads((tmp_path / 'soak.json').read_text())
    assert process.returncode == 0 and all(invariant['holds'] for invariant in found['invariants']), printed + progress
    assert all(fault['recovered_s'] is not None for fault in found['faults'])
    assert len(found['faults']) >= len(FAULTS)
    assert set(process['node'] for process in found['processes']) == {
        'depth_detector_node', 'bbox3d_node', 'tracker_node', 'planner_bridge_node'}
    assert found['arrays']['ros_3d_bb/tracks'] > 0 and found['sent']['camera/color/image_raw'] > 0
    assert '%d images sent' % found['images'] in printed
    assert processes_naming(str(tmp_path)) == 0
