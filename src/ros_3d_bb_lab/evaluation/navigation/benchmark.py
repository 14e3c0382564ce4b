"""Closed loop: move_base drives a simulated robot among people, with different knowledge of them."""
import argparse
import json
import multiprocessing
import os
import signal
import subprocess
import sys
import tempfile

import yaml

from ros_3d_bb_lab.evaluation.defaults import describe_machine, write_json
from ros_3d_bb_lab.evaluation.launching import launch
from ros_3d_bb_lab.evaluation.navigation.navigation_scenes import CAMERAS, GOAL_M, RATE_HZ, SCENES, scenario_of
from ros_3d_bb_lab.evaluation.navigation.trial_result import summaries

MODES = 'ours', 'limited', 'none', 'laser', 'depth', 'thesis', 'visible', 'truth'
PLANNERS = 'dwa', 'teb'
TRUE_BOXES = 'exact'
TRIAL_TIMEOUT_S = 900.0
COLUMNS = '%-15s %-7s %5s %11s %14s %8s %13s %13s %6s'
TITLES = ('scene', 'mode', 'runs', 'collisions', 'while driving', 'reached', 'time to goal', 'min distance', 'stops')


def run_trial(task):
    """Run one trial: (scene, mode, seed, folder for its files, arguments). It is not repeated if its record is in the
    folder.

    Returns its record as a dictionary, with `scene`, `mode` and `seed`. Raises RuntimeError if there is no record.
    """
    scene, mode, seed, folder, arguments = task
    name = os.path.join(folder, '%s-%s-%d' % (scene, mode, seed))
    if not os.path.exists(name + '.json'):
        _launch_trial(scene, mode, seed, name, arguments)
    try:
        with open(name + '.json') as stream:
            return dict(json.load(stream), scene=scene, mode=mode, seed=seed)
    except OSError:
        with open(name + '.log') as stream:
            raise RuntimeError('%s, %s, seed %d: no result. The end of the log:\n%s'
                               % (scene, mode, seed, stream.read()[-3000:]))


def _launch_trial(scene, mode, seed, name, arguments):
    """Run a trial, which writes `name`.json."""
    with open(name + '.yaml', 'w') as stream:
        yaml.safe_dump(scenario_of(scene, seed, arguments.rate, () if mode == 'thesis' else CAMERAS), stream)
    launch_arguments = {'scenario': name + '.yaml', 'record': name + '.json', 'mode': mode, 'goal_x': GOAL_M[0],
                        'goal_y': GOAL_M[1], 'local_planner': arguments.planner}
    if arguments.detector == 'depth':
        launch_arguments['detector'] = 'depth'
    elif arguments.detector != TRUE_BOXES:
        launch_arguments.update(detector='yolov5', weights=os.path.abspath(arguments.detector))
    with open(name + '.log', 'w') as log:
        launch('navigation_benchmark.launch', launch_arguments, TRIAL_TIMEOUT_S, log)


def table(result):
    """Format the result (see `summaries`) as lines of text."""
    rows = [(scene, mode, result['scenes'][scene][mode]) for scene in result['scenes']
            for mode in MODES if mode in result['scenes'][scene]]
    rows += [('all', mode, result['all'][mode]) for mode in MODES if mode in result['all']]
    lines = [COLUMNS % TITLES]
    for scene, mode, row in rows:
        time_s = '-' if row['time_to_goal_s'] is None else '%.1f s' % row['time_to_goal_s']
        lines.append(COLUMNS % (scene, mode, row['runs'], row['collisions'], row['collisions_driving'], row['reached'],
                                time_s, '%.2f m' % row['min_distance_m'], '%.1f' % row['stops']))
    return '\n'.join(lines)


def main():
    """Run the command `./run bench navigation`."""
    arguments = _arguments()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # runs the cleanup, which ends all processes
    print(describe_machine(), flush=True)
    trials, seeds = [], range(arguments.seed, arguments.seed + arguments.runs)
    _check_planners(arguments.planner)
    with tempfile.TemporaryDirectory() as folder, multiprocessing.Pool(arguments.jobs) as pool:
        tasks = [(scene, mode, seed, os.path.abspath(arguments.logs or folder), arguments) for seed in seeds
                 for scene in arguments.scenes for mode in arguments.modes]
        for trial in pool.imap_unordered(run_trial, tasks):
            trials.append(trial)
            print('%(scene)s, %(mode)s, seed %(seed)d: %(collisions)d collisions, goal after %(time_to_goal_s)s s, '
                  '%(min_distance_m).2f m, %(stops)d stops' % trials[-1], flush=True)
            write_json(arguments.json, dict(summaries(trials), machine=describe_machine(), trials=trials))
        pool.close()  # terminated workers can wait for a lock forever
        pool.join()
    print(table(summaries(trials)))


def _check_planners(planner):
    for package in ['move_base'] + ['teb_local_planner'] * (planner == 'teb'):
        if subprocess.call(['rospack', 'find', package], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) != 0:
            raise RuntimeError('%s is not installed; install ros-noetic-navigation and ros-noetic-teb-local-planner, '
                               'or set ROS_3D_BB_DATA to a folder that contains planners/, from which ./run builds '
                               'them' % package)


def _arguments():
    parser = argparse.ArgumentParser(prog='./run bench navigation', description=__doc__)
    parser.add_argument('--runs', type=int, default=20, metavar='N', help='trials per scene and mode (default: 20)')
    parser.add_argument('--seed', type=int, default=1, metavar='N', help='seed of the first trial (default: 1)')
    parser.add_argument('--scenes', type=_names_of(SCENES), default=list(SCENES), metavar='A,B',
                        help='some of %s' % ', '.join(SCENES))
    parser.add_argument('--modes', type=_names_of(MODES), default=list(MODES), metavar='A,B',
                        help='some of %s' % ', '.join(MODES))
    parser.add_argument('--planner', choices=PLANNERS, default='dwa', help='local planner (default: dwa)')
    parser.add_argument('--detector', default=TRUE_BOXES, metavar='exact|depth|FILE',
                        help='2D boxes of the modes ours, limited and thesis: true ones with a jitter of 1 pixel; '
                        'depth_detector_node; yolov5_node with these weights (default: exact)')
    parser.add_argument('--rate', type=float, default=RATE_HZ, metavar='HZ',
                        help='images per second of each camera (default: %g)' % RATE_HZ)
    parser.add_argument('--jobs', type=int, default=1, metavar='N', help='trials at the same time (default: 1)')
    parser.add_argument('--logs', metavar='DIR',
                        help='existing folder in which logs and records are kept; recorded trials are not repeated')
    parser.add_argument('--json', metavar='FILE', help='also write the results to this file')
    arguments = parser.parse_args()
    if arguments.runs < 1 or arguments.jobs < 1 or arguments.seed < 0:
        parser.error('--runs %d, --jobs %d, --seed %d: at least 1, 1 and 0 expected'
                     % (arguments.runs, arguments.jobs, arguments.seed))
    if not 1 <= arguments.rate <= 30:
        parser.error('--rate %g: 1 to 30 expected' % arguments.rate)
    if arguments.detector not in (TRUE_BOXES, 'depth') and not os.path.isfile(arguments.detector):
        parser.error('--detector %s: exact, depth or the path of a file expected' % arguments.detector)
    return arguments


def _names_of(known):
    def names(text):
        for name in text.split(','):
            if name not in known:
                raise argparse.ArgumentTypeError('%r is unknown; known: %s' % (name, ', '.join(known)))
        return text.split(',')
    return names
