"""Tracks at lower image rates, of our tracker and of the same tracker with perfect association.

The difference between the two is the loss by data association. What perfect association lacks, boxes do not show, or
the birth of tracks delays.
"""
from typing import Any, NamedTuple, Tuple

import numpy as np

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.association import assign, plane_distances
from ros_3d_bb_lab.evaluation.tracking.detection_generator import FALSE
from ros_3d_bb_lab.evaluation.tracking.metrics import MATCHED_M, score_run, scores_of

SCORES = 'hota', 'idf1', 'id_switches'
PEDESTRIANS_EVERY = 1, 2, 3, 6, 10  # 30, 15, 10, 5 and 3 Hz
RECORDINGS_EVERY = 1, 2, 3  # 10, 5 and 3.3 Hz in KITTI


class Part(NamedTuple):
    """Part of the benchmark: its name, its runs, and which n-th images of them are used, for each n of `every`."""

    name: str
    runs: Any
    every: Tuple[int, ...]


def scores_by_rate(part, contestants):
    """Score each tracker on every n-th image of the runs. Returns {rate in Hz: {name of the tracker: scores}}."""
    scores = {}
    for every in part.every:
        runs = [run._replace(images=run.images[::every]) for run in part.runs]
        of_trackers = {contestant.name: scores_of([score_run(run, contestant.outputs(contestant.make, run))
                                                   for run in runs]) for contestant in contestants}
        rate_hz = '%.1f' % _rate_hz(runs)
        scores[rate_hz] = {name: {key: value[key] for key in SCORES} for name, value in of_trackers.items()}
        print('\n'.join(row(part.name, rate_hz, scores[rate_hz])), flush=True)
    return scores


def row(name, rate_hz, scores):
    """Format the scores of the trackers at one rate as lines of text."""
    return ['%-20s %5s Hz  %-20s HOTA %5.1f  IDF1 %5.1f  ID switches %5d'
            % ((name, rate_hz, tracker) + tuple(of_tracker[key] for key in SCORES))
            for tracker, of_tracker in scores.items()]


def _rate_hz(runs):
    """Median rate of the images of runs."""
    return NS / np.median(np.concatenate([np.diff([image.stamp_ns for image in run.images]) for run in runs]))


def with_sources(run):
    """The RecordedRun with the person that each box shows, for perfect association: people and boxes within `MATCHED_M`
    are matched one to one, as many as possible, with the least sum of distances. The other boxes are false."""
    return run._replace(images=tuple(image._replace(sources=_sources(image)) for image in run.images))


def _sources(image):
    sources = np.full(len(image.detections), FALSE)
    if len(sources) and len(image.truth.ids):
        places_m = np.array([detection.position_m for detection in image.detections])
        distances_m = plane_distances(places_m, image.truth.position_m)
        rows, columns = assign(np.where(distances_m <= MATCHED_M, distances_m, np.inf))
        sources[rows] = image.truth.ids[columns]
    return sources.tolist()
