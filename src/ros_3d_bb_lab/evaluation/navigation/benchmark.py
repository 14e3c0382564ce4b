"""Closed loop: move_base drives a simulated robot among people, with different knowledge of them."""
import argparse
import os
import tempfile

import yaml

from ros_3d_bb.pipeline.detectors import without_weights
from ros_3d_bb_lab.evaluation.defaults import describe_machine, in_range
from ros_3d_bb_lab.evaluation.launching import recorded
from ros_3d_bb_lab.evaluation.navigation.navigation_scenes import GOAL_M, RATE_HZ, SCENES, scenario_of
from ros_3d_bb_lab.evaluation.navigation.trial_result import summaries
from ros_3d_bb_lab.evaluation.text_table import line_of, table_of

MODES = 'ours', 'limited', 'none', 'laser', 'visible'
PLANNERS = 'dwa', 'teb'
TRUE_BOXES = 'exact'
TRIAL_TIMEOUT_S = 900.0


def run_trial(scene, mode, seed, folder, arguments):
    """Run one trial with a folder for its files. It is not repeated if its record is in the folder.

    Returns its record as a dictionary, with `scene`, `mode` and `seed`. Raises RuntimeError if there is no record.
    """
    name = os.path.join(folder, '%s-%s-%d' % (scene, mode, seed))
    with open(name + '.yaml', 'w') as stream:
        yaml.safe_dump(scenario_of(scene, seed, arguments.rate), stream)
    launch_arguments = {'scenario': name + '.yaml', 'mode': mode, 'goal_x': GOAL_M[0], 'goal_y': GOAL_M[1],
                        'local_planner': arguments.planner}
    if arguments.detector in without_weights():
        launch_arguments['detector'] = arguments.detector
    elif arguments.detector != TRUE_BOXES:
        launch_arguments.update(detector='yolov5', weights=os.path.abspath(arguments.detector))
    record = recorded('navigation_benchmark.launch', launch_arguments, name, TRIAL_TIMEOUT_S)
    return dict(record, scene=scene, mode=mode, seed=seed)


def run(arguments):
    names = [TRUE_BOXES] + without_weights()
    if arguments.detector not in names and not os.path.isfile(arguments.detector):
        raise ValueError('--detector %s: %s or the path of a file expected' % (arguments.detector, ', '.join(names)))
    print(describe_machine(), flush=True)
    trials = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(arguments.seed, arguments.seed + arguments.runs):
            for scene in arguments.scenes:
                for mode in arguments.modes:
                    trials.append(run_trial(scene, mode, seed, os.path.abspath(arguments.logs or folder), arguments))
                    print(line_of(**trials[-1]), flush=True)
    result = dict(summaries(trials), machine=describe_machine(), trials=trials)
    rows = {'%s %s' % (scene, mode): row for scene, modes in result['scenes'].items() for mode, row in modes.items()}
    print('\n'.join(table_of(dict(rows, **result['all']))))
    return result


def add_options(parser):
    parser.add_argument('--runs', type=in_range(int, 1), default=20, metavar='N',
                        help='trials per scene and mode (default: 20)')
    parser.add_argument('--seed', type=in_range(int, 0), default=1, metavar='N',
                        help='seed of the first trial (default: 1)')
    parser.add_argument('--scenes', type=_names_of(SCENES), default=list(SCENES), metavar='A,B',
                        help='some of %s' % ', '.join(SCENES))
    parser.add_argument('--modes', type=_names_of(MODES), default=list(MODES), metavar='A,B',
                        help='some of %s' % ', '.join(MODES))
    parser.add_argument('--planner', choices=PLANNERS, default='dwa', help='local planner (default: dwa)')
    parser.add_argument('--detector', default=TRUE_BOXES, metavar='exact|NAME|FILE',
                        help='2D boxes of the modes ours and limited: true ones with a jitter of 1 pixel; '
                        'a detector without weights, such as depth; yolov5 with these weights (default: exact)')
    parser.add_argument('--rate', type=in_range(float, 1, 30), default=RATE_HZ, metavar='HZ',
                        help='images per second of each camera (default: %g)' % RATE_HZ)
    parser.add_argument('--logs', metavar='DIR',
                        help='existing folder in which logs and records are kept; recorded trials are not repeated')


def _names_of(known):
    def names(text):
        for name in text.split(','):
            if name not in known:
                raise argparse.ArgumentTypeError('%r is unknown; known: %s' % (name, ', '.join(known)))
        return text.split(',')
    return names
