"""The latency benchmark for a few seconds: the whole pipeline under roslaunch, with a detector that costs nothing."""
import json
import os
import signal
import subprocess
import sys

import pytest

from ros_3d_bb.bags.bag_writer import write_bag
from ros_3d_bb_lab.simulation.ros.scenario_to_bag import scenario_images
from ros_3d_bb_lab.simulation.scenario import scenario_from
from support.processes import processes_naming

NODES = {'replay_node', 'latency_probe_node', 'bbox3d_node', 'tracker_node'}


def test_results_are_written_and_no_process_remains(tmp_path):
    """On half a second of two standing people, with their 2D boxes. Processes of nodes name the folder of the log."""
    people = [{'start': [3.0, 0.6], 'facing': 3.1}, {'start': [4.0, -0.7], 'facing': 3.1}]
    scenario = scenario_from({'duration': 0.4, 'rate': 20.0, 'robot': {}, 'people': people})
    bag, results = str(tmp_path / 'images.bag'), str(tmp_path / 'latency.json')
    write_bag(scenario_images(scenario, with_boxes=True), bag, 'none')
    printed = subprocess.check_output(
        [sys.executable, '-m', 'ros_3d_bb_lab.evaluation', 'latency', '--bag', bag, '--cases', 'free', '--seconds', '5',
         '--rate', '10', '--separate', '--limits', '--json', results], universal_newlines=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # background jobs of a script ignore it
        env=dict(os.environ, ROS_HOSTNAME='localhost', ROS_LOG_DIR=str(tmp_path)))
    with open(results) as stream:
        found = json.load(stream)
    case, = found['cases']
    assert found['machine'] and case['name'] in printed
    assert case['output_hz'] > 0 and 0 < case['p50_ms'] <= case['p95_ms'] <= case['p99_ms']
    assert NODES <= set(case['cpu_percent']) & set(case['rss_mb']) & set(case['trend']['rss_mb_per_minute'])
    assert set(case['nodes']) == {'bbox3d_node', 'tracker_node'}
    assert case['pipeline']['cpu_percent'] == pytest.approx(sum(node['cpu_percent'] for node in case['nodes'].values()))
    assert processes_naming(str(tmp_path)) == 0
