"""Comparison of our tracker, the thesis' and Norfair on the same detections from robots among pedestrians."""
from typing import Any, NamedTuple

from ros_3d_bb.tracking.thesis_tracker import ThesisTracker
from ros_3d_bb.tracking.tracker import Tracker
from ros_3d_bb_lab.evaluation.baselines.norfair_baseline import Norfair
from ros_3d_bb_lab.evaluation.baselines.oracle_association import outputs_with_perfect_association
from ros_3d_bb_lab.evaluation.baselines.original_tracker import OriginalTracker, as_it_arrived
from ros_3d_bb_lab.evaluation.tracking.metrics import score_run, scores_of
from ros_3d_bb_lab.evaluation.tracking.robot_motion import DRIVING, STANDING
from ros_3d_bb_lab.evaluation.tracking.run_generator import SECONDS, simulate
from ros_3d_bb_lab.evaluation.tracking.timing import PEOPLE, cpu_ms

ROWS = (('hota', '%.1f'), ('assa', '%.1f'), ('deta', '%.1f'), ('mota', '%.1f'), ('idf1', '%.1f'),
        ('id_switches', '%d'), ('fragmentations', '%d'), ('recall', '%.1f'), ('precision', '%.1f'),
        ('position_rmse_m', '%.3f'), ('velocity_rmse_mps', '%.3f'), ('ade_1s_m', '%.3f'), ('fde_1s_m', '%.3f'),
        ('ade_2s_m', '%.3f'), ('fde_2s_m', '%.3f'), ('coverage_95_position', '%.3f'),
        ('coverage_95_velocity', '%.3f'), ('coverage_95_1s', '%.3f'), ('coverage_95_2s', '%.3f'))


class Contestant(NamedTuple):
    """Tracker to be compared.

    `name` is its name in the results, `make` creates a tracker, and `outputs(make, run)` returns what it publishes on a
    run.
    """

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
BOUND = Contestant('perfect_association', Tracker, outputs_with_perfect_association)


def runs_of(sequences, seed, repetitions, seconds=SECONDS):
    """Yield the runs of a benchmark: each sequence with a standing and with a driving robot."""
    for sequence in sequences:
        for motion in (STANDING, DRIVING):
            for repetition in range(repetitions):
                yield simulate(sequence, motion, (seed, repetition), seconds=seconds)


def compare(runs, contestants, on_run=None):
    """Score each tracker on all runs. Returns {name: scores}, without `cpu_ms`.

    Parameters
    ----------
    runs : iterable of run_generator.Run
    contestants : sequence of Contestant
    on_run : callable, optional
        Called after each run with the run and its {name: scores}.

    Raises
    ------
    ValueError
        If there are no runs, or an optional library is not installed.
    """
    scores = {contestant.name: [] for contestant in contestants}
    for run in runs:
        for contestant in contestants:
            scores[contestant.name].append(score_run(run, contestant.outputs(contestant.make, run)))
        if on_run is not None:
            on_run(run, {name: scores_of(run_scores[-1:]) for name, run_scores in scores.items()})
    return {name: scores_of(run_scores) for name, run_scores in scores.items()}


def cpu_times(contestants):
    """Median CPU time of an update in milliseconds, {name: {number of people as text: time}}."""
    return {contestant.name: {'%d' % people: cpu_ms(contestant.make, people) for people in PEOPLE}
            for contestant in contestants}


def table(trackers):
    """Format {name: scores} as lines of text."""
    lines = ['%-22s' % '' + ''.join('%20s' % name for name in trackers)]
    rows = [(key, [form % scores[key] if scores[key] is not None else '-' for scores in trackers.values()])
            for key, form in ROWS]
    rows += [('cpu_ms, %s people' % people, ['%.2f' % scores['cpu_ms'][people] for scores in trackers.values()])
             for people in list(trackers.values())[0]['cpu_ms']]
    return lines + ['%-22s' % key + ''.join('%20s' % value for value in values) for key, values in rows]
