"""Trajectories of pedestrians in the plane: smoothed recordings, or generated trajectories if there are no recordings.
"""
import csv
import os
from typing import Any, NamedTuple, Tuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.sparse import csc_matrix, diags
from scipy.sparse.linalg import spsolve

COLUMNS = ('t_s', 'id', 'x_m', 'y_m')
SMOOTHING = 0.004  # s^3; keeps the head motion of a step, removes the error of manual annotation in video
LONGEST_GAP_S = 1.3  # a longer gap splits a trajectory into two people
FEWEST_POINTS = 6  # minimum number of points of a person for fitting a curve
PERIOD_S = 0.4  # of generated trajectories, as in common recordings


class Pedestrian(NamedTuple):
    """Person with a position and a velocity (n, 2) as functions of times (n,) from `start_s` to `end_s`."""

    start_s: float
    end_s: float
    position_m: Any
    velocity_mps: Any


class Sequence(NamedTuple):
    """Recording: name, people, and all recorded points (n, 2)."""

    name: str
    pedestrians: Tuple[Pedestrian, ...]
    points_m: np.ndarray

    @property
    def span_s(self):
        """Start of the first and end of the last trajectory, (2,)."""
        return (min(person.start_s for person in self.pedestrians), max(person.end_s for person in self.pedestrians))


def read_sequences(folder):
    """Read the recordings in a folder: all `.csv` files, sorted by name. Raises ValueError if there are none."""
    names = sorted(name for name in os.listdir(folder) if name.endswith('.csv'))
    if not names:
        raise ValueError('%s has no .csv file; files with the columns %s expected' % (folder, ','.join(COLUMNS)))
    return [read_sequence(os.path.join(folder, name)) for name in names]


def read_sequence(path):
    """Read a recording: CSV with the columns t_s, id, x_m, y_m.

    Points that are not finite are treated as missing. Of several points of a person at the same time, the first one is
    used. Segments between gaps with fewer than `FEWEST_POINTS` points are left out. Raises ValueError if a
    column is missing, a line cannot be parsed, or no person has enough points; the message names the file.
    """
    rows = [tuple(row[name] for name in ('id', 't_s', 'x_m', 'y_m')) for row in read_rows(path, COLUMNS, ('id',))]
    return _sequence(path, os.path.splitext(os.path.basename(path))[0], rows)


def _sequence(source, name, rows):
    points = {}
    for identity, time_s, x_m, y_m in rows:
        if np.isfinite([time_s, x_m, y_m]).all():
            points.setdefault(identity, {}).setdefault(time_s, (x_m, y_m))
    people, all_points = [], []
    for identity in sorted(points):
        times_s = np.array(sorted(points[identity]))
        points_m = np.array([points[identity][time_s] for time_s in times_s])
        cuts = np.flatnonzero(np.diff(times_s) > LONGEST_GAP_S) + 1
        for part_s, part_m in zip(np.split(times_s, cuts), np.split(points_m, cuts)):
            if len(part_s) >= FEWEST_POINTS:
                people.append(pedestrian_of(part_s, part_m))
                all_points.append(part_m)
    if not people:
        raise ValueError('%s: no person has %d points without a gap of more than %g s'
                         % (source, FEWEST_POINTS, LONGEST_GAP_S))
    return Sequence(name, tuple(people), np.concatenate(all_points))


def pedestrian_of(times_s, points_m):
    """Fit a smooth curve through points (n, 2) at increasing times (n,), n > 1. Returns a Pedestrian."""
    curve = CubicSpline(times_s, _smoothed(times_s, points_m), bc_type='natural')
    return Pedestrian(float(times_s[0]), float(times_s[-1]), curve, curve.derivative())


def _smoothed(times_s, points_m):
    """Values of the cubic smoothing spline at the given times.

    It minimises the sum of squares + SMOOTHING * the integral of the acceleration squared. Reinsch's algorithm; Green
    and Silverman, Nonparametric Regression and Generalized Linear Models (1994), 2.3.
    """
    if len(times_s) < 3:
        return points_m
    steps = np.diff(times_s)
    inner = len(steps) - 1
    differences = diags([1 / steps[:-1], -1 / steps[:-1] - 1 / steps[1:], 1 / steps[1:]], [0, -1, -2],
                        shape=(inner + 2, inner), format='csr')
    bending = diags([steps[1:-1] / 6, (steps[:-1] + steps[1:]) / 3, steps[1:-1] / 6], [-1, 0, 1])
    accelerations = spsolve(csc_matrix(bending + SMOOTHING * differences.T.dot(differences)),
                            differences.T.dot(points_m))
    return points_m - SMOOTHING * differences.dot(accelerations.reshape(inner, -1))


def made_sequences(seed, seconds=90):
    """Generate sequences with few and many people, some in pairs, some standing. They do not avoid each other."""
    return [_made('made_%s' % name, np.random.RandomState([seed, people]), people, seconds)
            for name, people in (('sparse', 30), ('dense', 90))]


def _made(name, random, people, seconds):
    rows = []
    for number in range(people):
        start_s = random.uniform(-10, seconds)
        times_s = start_s + np.arange(0, random.uniform(10, 25), PERIOD_S)
        if random.uniform() < 0.15:
            points_m = np.tile(random.uniform((-5, -4), (5, 4)), (len(times_s), 1))
        else:
            heading = random.uniform(-np.pi, np.pi) + random.normal(0, 0.03) * (times_s - start_s)
            steps_m = random.normal(1.2, 0.2) * PERIOD_S * np.c_[np.cos(heading), np.sin(heading)]
            middle_m = random.uniform((-5, -4), (5, 4))
            points_m = middle_m + np.cumsum(steps_m, axis=0) - steps_m.sum(axis=0) / 2
        companions = 2 if random.uniform() < 0.3 else 1
        for companion in range(companions):
            shifted_m = points_m + companion * random.uniform(0.5, 0.9, 2) + random.normal(0, 0.02, points_m.shape)
            rows += [('%d.%d' % (number, companion), time_s) + tuple(point_m)
                     for time_s, point_m in zip(times_s, shifted_m) if 0 <= time_s <= seconds]
    return _sequence(name, name, rows)


def read_rows(path, columns, texts=()):
    """Rows of a CSV file as dictionaries with these columns, numbers except for `texts`. Other columns are ignored.

    Raises ValueError if a column is missing or a value is not a number; the message names the file and the line.
    """
    with open(path, newline='', encoding='utf-8-sig') as stream:
        reader = csv.DictReader(stream)
        try:
            if not set(columns) <= set(reader.fieldnames or ()):
                raise ValueError('%s has the columns %s; %s expected'
                                 % (path, ','.join(reader.fieldnames or ()), ','.join(columns)))
            return [_row(path, reader.line_num, line, columns, texts) for line in reader]
        except csv.Error as error:
            raise ValueError('%s cannot be read as a table (%s)' % (path, error))


def _row(path, number, line, columns, texts):
    try:
        return {key: line[key] if key in texts else float(line[key]) for key in columns}
    except (TypeError, ValueError):
        raise ValueError('%s, line %d: %s; a number in each column expected'
                         % (path, number, ','.join(str(line[key]) for key in columns)))
