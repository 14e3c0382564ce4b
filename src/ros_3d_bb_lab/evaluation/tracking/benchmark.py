"""Compare trackers on simulated detections from a camera on a standing or driving robot among recorded pedestrians.

Detection errors are as measured in the thesis. Without recordings, pedestrian trajectories are generated.
"""
import argparse
import functools
from typing import Any, NamedTuple

import numpy as np

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.estimation.error_model import read_error_model
from ros_3d_bb.tracking.thesis_tracker import ThesisTracker
from ros_3d_bb.tracking.tracker import Tracker
from ros_3d_bb_lab.evaluation.baselines.norfair_baseline import LIDAR, LIDAR_SCORE, Norfair
from ros_3d_bb_lab.evaluation.baselines.oracle_association import outputs_with_perfect_association
from ros_3d_bb_lab.evaluation.baselines.original_tracker import OriginalTracker, as_it_arrived
from ros_3d_bb_lab.evaluation.defaults import data_folder, write_json
from ros_3d_bb_lab.evaluation.tracking.metrics import score_run, scores_of
from ros_3d_bb_lab.evaluation.tracking.prediction_benchmark import predictions
from ros_3d_bb_lab.evaluation.tracking.rates_benchmark import (PEDESTRIANS_EVERY, RECORDINGS_EVERY, Part,
                                                               scores_by_rate, with_sources)
from ros_3d_bb_lab.evaluation.tracking.recorded_detections import read_recordings, with_error_model
from ros_3d_bb_lab.evaluation.tracking.robot_motion import DRIVING, STANDING
from ros_3d_bb_lab.evaluation.tracking.run_generator import SECONDS, simulate
from ros_3d_bb_lab.evaluation.tracking.trajectories import COLUMNS, made_sequences, read_sequences


class Contestant(NamedTuple):
    """Tracker to be compared: `make` creates it, and `outputs(make, run)` returns what it publishes on a run."""

    name: str
    make: Any
    outputs: Any


def outputs_of(make_tracker, run):
    """Tracks that a tracker publishes after each image of a run."""
    tracker = make_tracker()
    return [tracker.update(image.stamp_ns, image.detections, image.view) for image in run.images]


# `thesis` is the tracker as implemented in the thesis' package; `thesis_mended` is that of `~tracker: thesis`.
CONTESTANTS = (Contestant('ours', Tracker, outputs_of),
               Contestant('thesis', OriginalTracker, lambda make, run: outputs_of(make, as_it_arrived(run))),
               Contestant('thesis_mended', ThesisTracker, outputs_of), Contestant('library', Norfair, outputs_of))


def _norfair_outputs(make_tracker, run):
    """As `outputs_of`, for Norfair at the rate of the run, without the boxes below the score tuned for it."""
    period_s = np.median(np.diff([image.stamp_ns for image in run.images])) / NS
    images = [image._replace(detections=[detection for detection in image.detections
                                         if detection.score >= LIDAR_SCORE]) for image in run.images]
    return outputs_of(lambda: make_tracker(LIDAR._replace(rate_hz=1 / period_s)),
                      run._replace(images=tuple(images)))


CONTESTANTS_ON_DETECTIONS = (Contestant('ours', Tracker, outputs_of),
                             Contestant('library', Norfair, _norfair_outputs))
BOUND = Contestant('perfect_association', Tracker, outputs_with_perfect_association)


def runs_of(sequences, seed, repetitions, seconds=SECONDS):
    """Yield the runs of a benchmark: each sequence with a standing and with a driving robot."""
    for sequence in sequences:
        for motion in (STANDING, DRIVING):
            for repetition in range(repetitions):
                yield simulate(sequence, motion, (seed, repetition), seconds=seconds)


def compare(runs, contestants):
    """Score each tracker on all runs, and print its HOTA on each. Returns {name: scores}.

    Raises ValueError if an optional library is not installed.
    """
    scores = {contestant.name: [] for contestant in contestants}
    for run in runs:
        for contestant in contestants:
            scores[contestant.name].append(score_run(run, contestant.outputs(contestant.make, run)))
        print('  %-24s %4d images, HOTA %s' % (run.name, len(run.images), ', '.join(
            '%s %.1f' % (name, scores_of(run_scores[-1:])['hota']) for name, run_scores in scores.items())), flush=True)
    return {name: scores_of(run_scores) for name, run_scores in scores.items()}


def table(trackers):
    """Format {name: scores} as lines of text."""
    lines = ['%-22s' % '' + ''.join('%20s' % name for name in trackers)]
    for key, value in list(trackers.values())[0].items():
        if not isinstance(value, dict):
            lines.append('%-22s' % key + ''.join('%20s' % _text(key, scores[key]) for scores in trackers.values()))
    for band, shares in list(trackers.values())[0]['coverage_95_by_range'].items():
        for name in shares:
            values = [scores['coverage_95_by_range'][band][name] for scores in trackers.values()]
            lines.append('%-22s' % ('coverage_95 %s m, %s' % (band, name))
                         + ''.join('%20s' % _text('coverage_95', value) for value in values))
    return lines


def prediction_table(prediction):
    """Format the result of `prediction_benchmark.predictions` as lines of text."""
    rows = (('true positions, constant velocity', 'cv_fde_2s_m'), ('true positions, ours', 'ours_fde_2s_m'),
            ('in the 95 % ellipse', 'ours_coverage_95_2s'))
    lines = ['%-36s' % 'error after 2 s, m' + ''.join('%13s' % name for name in prediction)]
    return lines + ['%-36s' % title + ''.join('%13s' % _text(key, scores[key]) for scores in prediction.values())
                    for title, key in rows]


def _text(key, value):
    """Percentages have one digit, lengths and shares three."""
    if value is None or isinstance(value, int):
        return '-' if value is None else str(value)
    return '%.3f' % value if '_' in key else '%.1f' % value


def bench(arguments):
    """Run the comparison and print it. Returns the settings and the scores of each tracker, as written by --json."""
    if arguments.rates:
        return _bench_rates(arguments)
    if arguments.detections:
        return _bench_detections(arguments)
    sequences = read_sequences(arguments.data) if arguments.data else made_sequences(arguments.seed)
    names = [sequence.name for sequence in sequences]
    print('sequences: %s (%s), seed %d' % (', '.join(names), arguments.data or 'generated; no recordings found',
                                           arguments.seed), flush=True)
    contestants = CONTESTANTS + ((BOUND,) if arguments.bound else ())
    runs = runs_of(sequences, arguments.seed, arguments.repetitions, arguments.seconds)
    trackers = compare(runs, contestants)
    print('\n'.join(table(trackers)))
    prediction = predictions(sequences)
    print('\n'.join(prediction_table(prediction)))
    return {'sequences': names, 'recorded': bool(arguments.data), 'seed': arguments.seed,
            'repetitions': arguments.repetitions, 'seconds': arguments.seconds, 'trackers': trackers,
            'prediction': prediction}


def _bench_detections(arguments):
    """Run the comparison on recorded detections, as `bench`."""
    runs = list(read_recordings(arguments.detections, arguments.every, not arguments.no_odometry))
    contestants = CONTESTANTS_ON_DETECTIONS
    if arguments.error_model:
        model = read_error_model(arguments.error_model)
        runs = [with_error_model(run, model) for run in runs]
        ours = contestants[0]._replace(make=functools.partial(Tracker, detector=model.detector))
        contestants = (ours,) + contestants[1:]
    trackers = compare(runs, contestants)
    print('\n'.join(table(trackers)))
    return {'sequences': [run.name for run in runs], 'every': arguments.every, 'odometry': not arguments.no_odometry,
            'error_model': arguments.error_model, 'trackers': trackers}


def _bench_rates(arguments):
    """Compare our tracker with perfect association by image rate, as `bench`, on the pedestrians, and on the recorded
    detections if there are any."""
    sequences = read_sequences(arguments.data) if arguments.data else made_sequences(arguments.seed)
    runs = list(runs_of(sequences, arguments.seed, arguments.repetitions, arguments.seconds))
    parts = [Part('pedestrians', runs, PEDESTRIANS_EVERY)]
    if arguments.detections:
        recordings = read_recordings(arguments.detections, 1, not arguments.no_odometry)
        parts.append(Part('recorded_detections', [with_sources(run) for run in recordings], RECORDINGS_EVERY))
    return {part.name: scores_by_rate(part, (CONTESTANTS[0], BOUND)) for part in parts}


def main():
    """Run the command `./run bench tracking`."""
    arguments = _arguments()
    write_json(arguments.json, bench(arguments))


def _arguments():
    parser = argparse.ArgumentParser(prog='./run bench tracking', description=__doc__)
    parser.add_argument('--data', default=data_folder('trajectories'), metavar='DIR',
                        help='folder of CSV files with the columns %s (default: $ROS_3D_BB_DATA/data/trajectories if '
                        'it exists, otherwise generated trajectories)' % ','.join(COLUMNS))
    parser.add_argument('--detections', metavar='DIR', help='track recorded 3D detections instead: a folder of '
                        'recordings, see doc/benchmark_methods.md')
    parser.add_argument('--rates', action='store_true', help='compare our tracker with perfect data association by '
                        'image rate instead: the pedestrians, and the recordings of --detections if it is given')
    parser.add_argument('--every', type=int, default=1, metavar='N', help='of --detections: use each N-th image')
    parser.add_argument('--no-odometry', action='store_true',
                        help='of --detections: track in the frame of the camera, as without a pose of the robot')
    parser.add_argument('--error-model', metavar='FILE', help='of --detections: correct the boxes by an error model '
                        '(./run noise --recordings), and give the tracker their covariance (default: none)')
    parser.add_argument('--seed', type=int, default=0, metavar='N', help='random seed (default: 0)')
    parser.add_argument('--repetitions', type=int, default=2, metavar='N',
                        help='runs of each sequence with a standing and with a driving robot (default: 2)')
    parser.add_argument('--seconds', type=float, default=SECONDS, help='duration of a run (default: %g)' % SECONDS)
    parser.add_argument('--bound', action='store_true', help='also score our tracker with perfect data association')
    parser.add_argument('--json', metavar='FILE', help='also write the scores to FILE')
    arguments = parser.parse_args()
    for name in ('repetitions', 'seconds', 'every'):
        if not getattr(arguments, name) > 0:
            parser.error('--%s is %g; more than 0 expected' % (name, getattr(arguments, name)))
    if not 0 <= arguments.seed < 2 ** 32:
        parser.error('--seed is %d; 0 to %d expected' % (arguments.seed, 2 ** 32 - 1))
    return arguments
