"""Default inputs of the benchmarks: the cached weights, and the files in config/."""
import argparse
import glob
import os

from ros_3d_bb.detection.yolov5.onnx_backend import export_folder

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))))  # repository root
SCENARIOS = os.path.join(ROOT, 'config', 'scenarios')
SIMULATED_ERROR_MODEL = os.path.join(ROOT, 'config', 'error_models', 'simulated_d435i.yaml')


def default_weights():
    """Path of yolov5n.pt in the cache of `./run`; None if the file does not exist."""
    path = os.path.join(os.path.dirname(export_folder()), 'weights', 'yolov5n.pt')
    return path if os.path.isfile(path) else None


def scenario_path(name):
    """Path of a scenario, given by its name in config/scenarios or by its path. A type for argparse."""
    shipped = os.path.join(SCENARIOS, name if name.endswith('.yaml') else name + '.yaml')
    for path in (shipped, name):
        if os.path.isfile(path):
            return path
    raise argparse.ArgumentTypeError('no scenario %r; a file, or one of %s expected'
                                     % (name, ', '.join(os.path.basename(path)[:-5] for path in scenario_paths('*'))))


def scenario_paths(*patterns):
    """Paths of the scenarios in config/scenarios whose names match a pattern, in the order of the patterns."""
    return [path for pattern in patterns for path in sorted(glob.glob(os.path.join(SCENARIOS, pattern + '.yaml')))]
