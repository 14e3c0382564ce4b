"""The latency benchmark for a few seconds: the whole pipeline under roslaunch, with a detector that costs nothing."""
import json
import os
import signal
import subprocess
import sys
import time

import pytest

from ros_3d_bb.bags.bag_writer import write_bag
from ros_3d_bb_lab.simulation.ros.scenario_to_bag import scenario_images
from ros_3d_bb_lab.simulation.scenario import scenario_from
from support.processes import processes_naming

NODES = {'replay_node', 'latency_probe_node', 'bbox3d_node', 'tracker_node'}


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    """Half a second of two people who stand, with their 2D boxes."""
    people = [{'start': [3.0, 0.6], 'facing': 3.1}, {'start': [4.0, -0.7], 'facing': 3.1}]
    scenario = scenario_from({'duration': 0.4, 'rate': 20.0, 'robot': {}, 'people': people})
    path = str(tmp_path_factory.mktemp('latency') / 'images.bag')
    assert write_bag(scenario_images(scenario, with_boxes=True), path, 'none') == 8
    return path


@pytest.fixture
def benchmark(tmp_path):
    """Starts the benchmark as a process of its own; nodes have `tmp_path`, where they log, in their command line."""
    environment = dict(os.environ, ROS_HOSTNAME='localhost', ROS_LOG_DIR=str(tmp_path))

    def start(*arguments):
        return subprocess.Popen([sys.executable, '-m', 'ros_3d_bb_lab.evaluation.latency.benchmark'] + list(arguments),
                                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True,
                                env=environment)
    return start


def test_images_are_answered_and_everything_ends(bag, benchmark, tmp_path):
    results = str(tmp_path / 'latency.json')
    process = benchmark('--bag', bag, '--cases', 'free', '--seconds', '5', '--rate', '10', '--json', results)
    printed, _nothing = process.communicate()
    assert process.returncode == 0, printed
    with open(results) as stream:
        found = json.load(stream)
    case, = found['cases']
    assert found['machine'] and case['name'] in printed
    assert (case['name'], case['detector'], case['load']) == ('free', 'free', 'none')
    assert case['output_hz'] > 0 and 0 < case['p50_ms'] <= case['p95_ms'] <= case['p99_ms']
    assert NODES <= set(case['cpu_percent']) & set(case['rss_mb']) & set(case['trend']['rss_mb_per_minute'])
    assert processes_naming(str(tmp_path)) == 0


def test_ctrl_c_ends_everything(bag, benchmark, tmp_path):
    process = benchmark('--bag', bag, '--cases', 'free+load', '--seconds', '300')
    while process.poll() is None and processes_naming(str(tmp_path)) < 1 + len(NODES):
        time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    process.communicate()
    assert process.returncode == 130 and processes_naming(str(tmp_path)) == 0


@pytest.mark.parametrize('arguments,complaint', [(('--cases', 'fre'), "'fre' is unknown"),
                                                 (('--cases', 'yolov5-512'), 'needs --weights'),
                                                 (('--seconds', '0'), 'more than 0')])
def test_arguments_that_make_no_sense_are_refused(benchmark, arguments, complaint):
    process = benchmark('--bag', 'some.bag', *arguments)
    printed, _nothing = process.communicate()
    assert process.returncode == 2 and complaint in printed


def test_a_bag_of_something_else_is_refused_with_a_reason(benchmark, tmp_path):
    path = str(tmp_path / 'not_a.bag')
    with open(path, 'w') as stream:
        stream.write('not a bag')
    process = benchmark('--bag', path, '--cases', 'free')
    printed, _nothing = process.communicate()
    assert process.returncode == 1 and 'cannot be read' in printed
