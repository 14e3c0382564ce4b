"""Latency of the complete pipeline, from the image stamp to the markers, by detector."""
import os
import subprocess
import tempfile
from typing import NamedTuple

from ros_3d_bb.pipeline.detectors import without_weights
from ros_3d_bb_lab.evaluation.defaults import default_weights, describe_machine, in_range, scenario_path
from ros_3d_bb_lab.evaluation.latency.latency_result import result_of
from ros_3d_bb_lab.evaluation.launching import recorded
from ros_3d_bb_lab.evaluation.text_table import line_of, table_of

IMAGES = 60  # first images of the demo, played forwards and backwards: 2 s, 90 MB
# Nodes of the benchmark, which do not run on a robot.
HARNESS = 'replay_node', 'latency_probe_node', 'rosout'


class Case(NamedTuple):
    name: str
    detector: str    # of pipeline.launch
    image_size: int  # of the network; 0: the default, which adapts to the machine
    weights: str     # path of the model file


def cases_of(weights):
    """All cases for a list of model files, of which each is a case: first the defaults of each detector, then the first
    file with the largest input, and precomputed 2D boxes.
    """
    detectors = [(os.path.splitext(os.path.basename(path))[0], 'yolov5', 0, path) for path in weights]
    detectors += [(name, name, 0, '') for name in without_weights()]
    detectors += [(name + '-640', 'yolov5', 640, path) for name, _detector, _size, path in detectors[:len(weights[:1])]]
    detectors += [('free', 'none', 0, '')]
    return [Case(*row) for row in detectors]


def measured(case, arguments, bag, folder):
    """Run one case with a separate ROS master. Returns its results as a dictionary, see `latency_result.result_of`.

    Raises RuntimeError if nothing was measured.
    """
    options = {'bag': bag, 'detector': case.detector, 'weights': case.weights, 'image_size': case.image_size,
               'seconds': arguments.seconds, 'rate': arguments.rate, 'single_process': not arguments.separate}
    record = recorded('latency.launch', options, os.path.join(folder, case.name), arguments.seconds + 200)
    result = dict(result_of(record), name=case.name, load_average=record['load_average'])
    nodes = [node for node in result['cpu_percent'] if node not in HARNESS]
    return dict(result, pipeline={key: sum(result[key][node] for node in nodes) for key in ('cpu_percent', 'rss_mb')})


def print_result(result):
    print(line_of(**{key: value for key, value in dict(result, **result['pipeline']).items()
                     if not isinstance(value, dict)}))
    print('\n'.join(table_of({node: {'cpu_percent': result['cpu_percent'][node], 'rss_mb': result['rss_mb'][node]}
                              for node in sorted(result['cpu_percent'])})))
    print(line_of('median ms from stamp:', **result['stages_ms']), flush=True)


def run(arguments):
    cases = _cases(arguments)
    print(describe_machine(), flush=True)
    results = []
    with tempfile.TemporaryDirectory() as folder:
        bag = arguments.bag and os.path.abspath(arguments.bag)
        if not bag:
            bag = os.path.join(folder, 'images.bag')
            subprocess.check_call(['rosrun', 'ros_3d_bb', 'scenario_to_bag', scenario_path('demo'), bag, '--boxes',
                                   '--images', str(IMAGES), '--compression', 'none'], stdout=subprocess.DEVNULL)
        for case in cases:
            results.append(measured(case, arguments, bag, folder))
            print_result(results[-1])
    return {'machine': describe_machine(), 'cases': results}


def _cases(arguments):
    known = {case.name: case for case in cases_of([os.path.abspath(path) for path in arguments.weights])}
    names = arguments.cases.split(',') if arguments.cases else list(known)
    for name in names:
        if name not in known:
            raise ValueError('case %r is unknown; known: %s%s' % (name, ', '.join(known), '' if arguments.weights else
                                                                  '; cases of networks need --weights'))
    return [known[name] for name in names]


def add_options(parser):
    parser.add_argument('--cases', help='some of depth, free, the names of the model files without suffix and, for the '
                        'first one, this name with -640, separated by commas (default: all)')
    parser.add_argument('--seconds', type=in_range(float, 1), default=20.0,
                        help='duration of a measurement (default: 20)')
    parser.add_argument('--rate', type=in_range(float, 0.1), default=30.0, metavar='HZ',
                        help='images per second (default: 30)')
    parser.add_argument('--weights', nargs='+', default=list(filter(None, [default_weights()])), metavar='FILE',
                        help='model files: YOLOv5 checkpoints, ONNX files (default: yolov5n.pt in the cache, if any)')
    parser.add_argument('--bag', help='bag written by scenario_to_bag --boxes (default: the '
                        'first %d images of the demo)' % IMAGES)
    parser.add_argument('--separate', action='store_true', help='run each node in a process of its own')
