"""What benchmarks find on a machine: weights, scenarios, recorded data, its cores; and the limits of options."""
import argparse
import glob
import os
import platform

import numpy as np

from ros_3d_bb.detection.yolov5.onnx_backend import export_folder

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))))  # repository root
SCENARIOS = os.path.join(ROOT, 'config', 'scenarios')
SIMULATED_ERROR_MODEL = os.path.join(ROOT, 'config', 'error_models', 'simulated_d435i.yaml')


def default_weights():
    """Path of yolov5n.pt in the cache of `./run`; None if the file does not exist."""
    path = os.path.join(os.path.dirname(export_folder()), 'weights', 'yolov5n.pt')
    return path if os.path.isfile(path) else None


def scenario_path(name):
    shipped = os.path.join(SCENARIOS, name if name.endswith('.yaml') else name + '.yaml')
    for path in (shipped, name):
        if os.path.isfile(path):
            return path
    raise argparse.ArgumentTypeError('no scenario %r; a file, or one of %s expected'
                                     % (name, ', '.join(map(scene_name, scenario_paths('*')))))


def scenario_paths(pattern):
    return sorted(glob.glob(os.path.join(SCENARIOS, pattern + '.yaml')))


def scene_name(path):
    return os.path.splitext(os.path.basename(path))[0]


def add_scenarios(parser, *patterns):
    """Add scenarios to the options of a benchmark; by default those whose names match a pattern."""
    parser.add_argument('scenarios', nargs='*', type=scenario_path, metavar='SCENARIO',
                        default=[path for pattern in patterns for path in scenario_paths(pattern)],
                        help='names in config/scenarios or files (default: %s)' % ', '.join(patterns))


def in_range(kind, low, high=float('inf')):
    def converted(text):
        value = kind(text)
        if not low <= value <= high:
            raise argparse.ArgumentTypeError('%s; %g to %g expected' % (text, low, high))
        return value
    return converted


def data_folder(name):
    """Folder of recorded data by its name in `$ROS_3D_BB_DATA/data`; None if it does not exist."""
    path = os.path.join(os.environ.get('ROS_3D_BB_DATA', ''), 'data', name)
    return path if os.path.isdir(path) else None


def describe_machine():
    """Cores, CPU model and software versions as one line of text."""
    fields = {}
    if os.path.exists('/proc/cpuinfo'):
        with open('/proc/cpuinfo') as stream:
            fields = dict(line.partition(':')[::2] for line in stream if ':' in line)
    fields = {name.strip(): value.strip() for name, value in fields.items()}
    where = ' of a virtual machine' if 'hypervisor' in fields.get('flags', '').split() else ''
    return '%d cores%s, %s; Python %s, numpy %s' % (
        os.cpu_count(), where, fields.get('model name', platform.machine()), platform.python_version(), np.__version__)
