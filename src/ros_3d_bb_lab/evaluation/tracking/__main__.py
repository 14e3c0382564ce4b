"""Compare trackers on simulated detections from a camera on a standing or driving robot among recorded pedestrians.

Detection errors are as measured in the thesis. Without recordings, pedestrian trajectories are generated.
"""
import argparse
import json
import os
import sys

from ros_3d_bb_lab.evaluation.defaults import scenario_path
from ros_3d_bb_lab.evaluation.tracking.benchmark import BOUND, CONTESTANTS, compare, cpu_times, runs_of, table
from ros_3d_bb_lab.evaluation.tracking.rendered_scenes import compare_scenes
from ros_3d_bb_lab.evaluation.tracking.run_generator import SECONDS
from ros_3d_bb_lab.evaluation.tracking.trajectories import COLUMNS, made_sequences, read_sequences


def main():
    """Run the command `./run bench tracking`."""
    arguments = _arguments()
    try:
        if arguments.scenarios:
            result = {'scenes': compare_scenes(arguments.scenarios, arguments.weights)}
        else:
            result = bench(arguments)
        if arguments.json:
            with open(arguments.json, 'w') as stream:
                json.dump(result, stream, indent=1)
    except (ValueError, OSError) as error:
        sys.exit('./run bench tracking: %s' % error)


def bench(arguments):
    """Run the comparison and print it. Returns the settings and the scores of each tracker, as written by --json."""
    sequences = read_sequences(arguments.data) if arguments.data else made_sequences(arguments.seed)
    names = [sequence.name for sequence in sequences]
    print('sequences: %s (%s), seed %d' % (', '.join(names), arguments.data or 'made; no recordings are at hand',
                                           arguments.seed), flush=True)
    contestants = CONTESTANTS + ((BOUND,) if arguments.bound else ())
    runs = runs_of(sequences, arguments.seed, arguments.repetitions, arguments.seconds)
    trackers = compare(runs, contestants, on_run=_say)
    for name, times_ms in cpu_times(contestants).items():
        trackers[name]['cpu_ms'] = times_ms
    print('\n'.join(table(trackers)))
    return {'sequences': names, 'recorded': bool(arguments.data), 'seed': arguments.seed,
            'repetitions': arguments.repetitions, 'seconds': arguments.seconds, 'trackers': trackers}


def _say(run, scores):
    """Print one line for a run."""
    print('  %-24s %4d images, HOTA %s' % (run.name, len(run.images), ', '.join(
        '%s %.1f' % (name, tracker['hota']) for name, tracker in scores.items())), flush=True)


def _arguments():
    parser = argparse.ArgumentParser(prog='./run bench tracking', description=__doc__)
    data = os.path.join(os.environ.get('ROS_3D_BB_DATA', ''), 'data', 'trajectories')
    parser.add_argument('--data', default=data if os.path.isdir(data) else None, metavar='DIR',
                        help='folder of CSV files with the columns %s (default: $ROS_3D_BB_DATA/data/trajectories, '
                        'and without it recordings that are made)' % ','.join(COLUMNS))
    parser.add_argument('--seed', type=int, default=0, metavar='N', help='of all that is random (default: 0)')
    parser.add_argument('--repetitions', type=int, default=2, metavar='N',
                        help='runs of each sequence, standing and driving each (default: 2)')
    parser.add_argument('--seconds', type=float, default=SECONDS, help='length of a run (default: %g)' % SECONDS)
    parser.add_argument('--bound', action='store_true',
                        help='also our tracker when it is told whose each detection is')
    parser.add_argument('--scenarios', nargs='+', type=scenario_path, metavar='SCENARIO',
                        help='instead: the whole pipeline on rendered scenes')
    parser.add_argument('--weights', help='of YOLOv5, for --scenarios; without, the weight-free detector')
    parser.add_argument('--json', metavar='FILE', help='also write the scores there')
    arguments = parser.parse_args()
    for name in ('repetitions', 'seconds'):
        if not getattr(arguments, name) > 0:
            parser.error('--%s is %g; more than 0 expected' % (name, getattr(arguments, name)))
    if arguments.weights and not arguments.scenarios:
        parser.error('--weights is for --scenarios; people of recordings are not rendered')
    if not 0 <= arguments.seed < 2 ** 32:
        parser.error('--seed is %d; 0 to %d expected' % (arguments.seed, 2 ** 32 - 1))
    return arguments


if __name__ == '__main__':
    main()
