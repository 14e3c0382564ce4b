"""Compare trackers on simulated detections from a camera on a standing or driving robot among recorded pedestrians.

Detection errors are as measured in the thesis. Without recordings, pedestrian trajectories are generated.
"""
import numpy as np

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.tracker import Tracker
from ros_3d_bb_lab.evaluation.baselines.norfair_baseline import LIDAR, LIDAR_SCORE, Norfair
from ros_3d_bb_lab.evaluation.baselines.original_tracker import OriginalTracker, as_it_arrived
from ros_3d_bb_lab.evaluation.defaults import data_folder, in_range
from ros_3d_bb_lab.evaluation.text_table import line_of, table_of, transposed
from ros_3d_bb_lab.evaluation.tracking.metrics import score_run, scores_of
from ros_3d_bb_lab.evaluation.tracking.recorded_detections import read_recordings
from ros_3d_bb_lab.evaluation.tracking.robot_motion import DRIVING, STANDING
from ros_3d_bb_lab.evaluation.tracking.run_generator import SECONDS, simulate
from ros_3d_bb_lab.evaluation.tracking.trajectories import COLUMNS, made_sequences, read_sequences

RATE_SCORES = 'hota', 'idf1', 'id_switches'
PEDESTRIANS_EVERY = 1, 2, 3, 6, 10  # 30, 15, 10, 5 and 3 Hz


def outputs_of(tracker, run):
    return [tracker.update(image.stamp_ns, image.detections, image.view) for image in run.images]


def _norfair_outputs(run):
    """As `outputs_of`, for Norfair at the rate of the run, without the boxes below the score tuned for it."""
    period_s = np.median(np.diff([image.stamp_ns for image in run.images])) / NS
    images = [image._replace(detections=[detection for detection in image.detections
                                         if detection.score >= LIDAR_SCORE]) for image in run.images]
    return outputs_of(Norfair(LIDAR._replace(rate_hz=1 / period_s)), run._replace(images=tuple(images)))


# Functions that return what a new tracker publishes on a run.
OURS = {'ours': lambda run: outputs_of(Tracker(), run)}
CONTESTANTS = dict(OURS, thesis=lambda run: outputs_of(OriginalTracker(), as_it_arrived(run)),
                   library=lambda run: outputs_of(Norfair(), run))
CONTESTANTS_ON_DETECTIONS = dict(OURS, library=_norfair_outputs)


def compare(runs, contestants):
    """Score each tracker on all runs, and print its HOTA on each. Returns {name: scores}.

    Raises ValueError if an optional library is not installed.
    """
    scores = {name: [] for name in contestants}
    for run in runs:
        for name, outputs in contestants.items():
            scores[name].append(score_run(run, outputs(run)))
        print(line_of('%s, %d images, HOTA:' % (run.name, len(run.images)), **{
            name: scores_of(run_scores[-1:])['hota'] for name, run_scores in scores.items()}), flush=True)
    return {name: scores_of(run_scores) for name, run_scores in scores.items()}


def run(arguments):
    """Run the comparison and print it. Returns the settings and the scores of each tracker."""
    if arguments.detections:
        return _run_on_detections(arguments)
    sequences = read_sequences(arguments.data) if arguments.data else made_sequences(arguments.seed)
    names = [sequence.name for sequence in sequences]
    print('sequences: %s (%s), seed %d' % (', '.join(names), arguments.data or 'generated; no recordings found',
                                           arguments.seed), flush=True)
    runs = (simulate(sequence, motion, (arguments.seed, repetition), seconds=arguments.seconds)
            for sequence in sequences for motion in (STANDING, DRIVING) for repetition in range(arguments.repetitions))
    if arguments.rates:
        return _run_at_rates(list(runs))
    trackers = compare(runs, CONTESTANTS)
    print('\n'.join(table_of(transposed(trackers))))
    return {'sequences': names, 'recorded': bool(arguments.data), 'seed': arguments.seed,
            'repetitions': arguments.repetitions, 'seconds': arguments.seconds, 'trackers': trackers}


def _run_on_detections(arguments):
    runs = list(read_recordings(arguments.detections, arguments.every))
    trackers = compare(runs, CONTESTANTS_ON_DETECTIONS)
    print('\n'.join(table_of(transposed(trackers))))
    return {'sequences': [run.name for run in runs], 'every': arguments.every, 'trackers': trackers}


def _run_at_rates(runs):
    result = {}
    for every in PEDESTRIANS_EVERY:
        thinned = [run._replace(images=run.images[::every]) for run in runs]
        gaps_ns = np.concatenate([np.diff([image.stamp_ns for image in run.images]) for run in thinned])
        rate_hz = '%.1f' % (NS / np.median(gaps_ns))
        scores = compare(thinned, OURS)['ours']
        result[rate_hz] = {key: scores[key] for key in RATE_SCORES}
        print(line_of(rate_hz + ' Hz', **result[rate_hz]), flush=True)
    return result


def add_options(parser):
    parser.add_argument('--data', default=data_folder('trajectories'), metavar='DIR',
                        help='folder of CSV files with the columns %s (default: $ROS_3D_BB_DATA/data/trajectories if '
                        'it exists, otherwise generated trajectories)' % ','.join(COLUMNS))
    parser.add_argument('--detections', metavar='DIR', help='track recorded 3D detections instead: a folder of '
                        'recordings, see doc/benchmark_methods.md')
    parser.add_argument('--rates', action='store_true',
                        help='score our tracker on the pedestrians by image rate instead')
    parser.add_argument('--every', type=in_range(int, 1), default=1, metavar='N',
                        help='of --detections: use each N-th image')
    parser.add_argument('--seed', type=in_range(int, 0, 2 ** 32 - 1), default=0, metavar='N',
                        help='random seed (default: 0)')
    parser.add_argument('--repetitions', type=in_range(int, 1), default=2, metavar='N',
                        help='runs of each sequence with a standing and with a driving robot (default: 2)')
    parser.add_argument('--seconds', type=in_range(float, 0.1), default=SECONDS,
                        help='duration of a run (default: %g)' % SECONDS)
