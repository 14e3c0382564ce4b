import json
import os
import signal
import subprocess
import sys
from unittest import mock

import pytest

from ros_3d_bb_lab.evaluation.latency.latency_probe_node import LatencyProbeNode
from ros_3d_bb_lab.evaluation.navigation.benchmark import MODES
from support.bags import scene_bag
from support.launching import loaded
from support.masterless import masterless
from support.processes import processes_naming
from support.real_planners import planner_environment


@pytest.mark.long
def test_a_robot_that_knows_nothing_of_people_drives_into_one(tmp_path):
    environment = planner_environment()
    results, logs = str(tmp_path / 'results.json'), tmp_path / 'logs'
    logs.mkdir()
    subprocess.check_call([sys.executable, '-m', 'ros_3d_bb_lab.evaluation', 'navigation', '--runs', '1', '--scenes',
                           'standing', '--modes', 'none', '--json', results],
                          env=dict(environment, ROS_HOSTNAME='localhost', ROS_LOG_DIR=str(logs)))
    with open(results) as stream:
        found = json.load(stream)
    row = found['scenes']['standing']['none']
    assert found['all']['none'] == row
    assert (row['runs'], row['collisions'], row['collisions_driving'], row['reached']) == (1, 1, 1, 0)
    assert row['stops'] >= 1
    assert row['time_to_goal_s'] is None and -0.03 < row['min_distance_m'] < 0.03
    assert processes_naming(str(logs)) == 0


NODES = {'replay_node', 'latency_probe_node', 'bbox3d_node', 'tracker_node'}


def test_results_are_written_and_no_process_remains(tmp_path):
    """On half a second of two standing people, with their 2D boxes. Processes of nodes name the folder of the log."""
    people = [{'start': [3.0, 0.6], 'facing': 3.1}, {'start': [4.0, -0.7], 'facing': 3.1}]
    scene, results = {'duration': 0.4, 'rate': 20.0, 'people': people}, str(tmp_path / 'latency.json')
    bag = scene_bag(tmp_path / 'images.bag', scene, with_boxes=True)
    printed = subprocess.check_output(
        [sys.executable, '-m', 'ros_3d_bb_lab.evaluation', 'latency', '--bag', bag, '--cases', 'free', '--seconds', '2',
         '--rate', '10', '--separate', '--json', results], universal_newlines=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # background jobs of a script ignore it
        env=dict(os.environ, ROS_HOSTNAME='localhost', ROS_LOG_DIR=str(tmp_path)))
    with open(results) as stream:
        found = json.load(stream)
    case, = found['cases']
    assert found['machine'] and case['name'] in printed
    assert case['output_hz'] > 0 and 0 < case['p50_ms'] <= case['p95_ms'] <= case['p99_ms']
    assert NODES <= set(case['cpu_percent']) & set(case['rss_mb'])
    assert case['pipeline']['cpu_percent'] == pytest.approx(
        case['cpu_percent']['bbox3d_node'] + case['cpu_percent']['tracker_node'])
    assert processes_naming(str(tmp_path)) == 0


@pytest.mark.parametrize('checks', [0, 1, 2])
def test_a_latency_probe_that_is_shut_down_early_writes_no_record(tmp_path, checks):
    """Before the first markers, in the time of warming up, and while it measures."""
    module, answers = 'ros_3d_bb_lab.evaluation.latency.latency_probe_node.', [False] * checks
    with masterless({'record': str(tmp_path / 'record.json')}), mock.patch('time.sleep'), \
            mock.patch(module + 'pids_of_nodes', lambda: {'self': os.getpid()}), \
            mock.patch('rospy.is_shutdown', lambda: answers.pop() if answers else True):
        node = LatencyProbeNode()
        node._arrivals['markers'].extend([(0, 0)] * checks)
        node.measure()
    assert os.listdir(str(tmp_path)) == [] and not answers


ARGUMENTS = ['scenario:=/some/scene.yaml', 'record:=/some/record.json']


@pytest.mark.parametrize('mode', MODES)
def test_modes_differ_in_what_move_base_knows_of_people(mode):
    parameters, nodes = loaded('navigation_benchmark.launch', 'mode:=' + mode, *ARGUMENTS)
    is_tracked = mode in ('ours', 'limited')
    assert {'bbox3d_node', 'tracker_node'} & set(nodes) == ({'bbox3d_node', 'tracker_node'} if is_tracked else set())
    assert parameters['/simulator_node/boxes'] == is_tracked
    layers = [layer['name'] for layer in parameters['/move_base/local_costmap/plugins']]
    of_people = mode not in ('laser', 'none')
    assert layers == ['static_layer'] + (
        ['people_layer', 'prediction_layer'] if of_people else ['obstacle_layer', 'inflation_layer'])
    assert parameters['/move_base/DWAPlannerROS/sum_scores'] == of_people
    waits_for = [name for name in ('tracks', 'scan') if parameters['/navigation_trial_node/' + name]]
    assert waits_for == {'laser': ['scan'], 'limited': ['tracks', 'scan'], 'none': []}.get(mode, ['tracks'])
    assert parameters.get('/speed_limit_node/use_scan') == (True if mode == 'limited' else None)
    assert parameters['/navigation_trial_node/visible'] == (mode == 'visible')
    assert parameters['/simulator_node/drive'] and parameters['/simulator_node/supervised']
