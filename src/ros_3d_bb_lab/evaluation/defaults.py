"""What benchmarks use where nothing is named: the weights in the cache, and the files in config/."""
import argparse
import glob
import os

from ros_3d_bb.detection.yolov5.onnx_cache import export_folder

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))))  # the checkout
SCENARIOS = os.path.join(ROOT, 'config', 'scenarios')
SIMULATED_ERROR_MODEL = os.path.join(ROOT, 'config', 'error_models', 'simulated_d435i.yaml')


def default_weights():
    """The path of yolov5n.pt in the cache of `./run`; None if there is none."""
    path = os.path.join(os.path.dirname(export_folder()), 'weights', 'yolov5n.pt')
    return path if os.path.isfile(path) else None


def scenario_path(name):
    """The path of a scenario, given as the name of one in config/scenarios or as a file; a type for argparse."""
    shipped = os.path.join(SCENARIOS, name if name.endswith('.yaml') else name + '.yaml')
    for path in (shipped, name):
        if os.path.isfile(path):
            return path
    raise argparse.ArgumentTypeError('no scenario %r; a file, or one of %s expected'
                                     % (name, ', '.join(os.path.basename(path)[:-5] for path in scenario_paths('*'))))


def scenario_paths(*patterns):
    """The paths of the scenarios in config/scenarios whose names match one of the patterns, in their order."""
    return [path for pattern in patterns for path in sorted(glob.glob(os.path.join(SCENARIOS, pattern + '.yaml')))]
