"""Measurements with ground truth, from tables in the format of the thesis or from sessions, and their clusters.

A table is a CSV file in millimetres with the columns `X measured`, `X true`, `Z measured`, `Z true`. Cells of an axis
that was not measured are empty, or its columns are missing. The columns `X error` and `Z error` are checked; other
columns are ignored.
"""
import csv
from typing import NamedTuple

import numpy as np

from ros_3d_bb.estimation.box3d_estimator import estimate_boxes, estimator_named, truncated_edges
from ros_3d_bb.sessions.session_reader import read_depth, read_session

AXES = ('X', 'Z')
LEAST_IN_CLUSTER = 3
ROUNDING_MM = 1.01  # errors may have been computed before the values were rounded


class MeasurementTable(NamedTuple):
    """Positions x, y, z (n, 3) and ground truth x, z (n, 2) in metres, NaN if not measured, and name of the source.

    `cut` (n,) is whether the left or right image border truncates the person, if known.
    """

    name: str
    measured_m: np.ndarray
    truth_m: np.ndarray
    cut: np.ndarray

    def complete(self):
        """Select the measurements with x and z."""
        values_m = np.concatenate((self.measured_m[:, [0, 2]], self.truth_m), axis=1)
        return self._part(np.isfinite(values_m).all(axis=1))

    def whole(self):
        """Select the measurements of people that are not truncated, in clusters of true x with at least 3 of them."""
        whole = self._part(~self.cut)
        values_m, counts = np.unique(whole.truth_m[:, 0], return_counts=True)
        return whole._part(np.isin(whole.truth_m[:, 0], values_m[counts >= LEAST_IN_CLUSTER]))

    def _part(self, mask):
        return self._replace(measured_m=self.measured_m[mask], truth_m=self.truth_m[mask], cut=self.cut[mask])


class Cluster(NamedTuple):
    """Errors (n,), in metres, of all measurements with the same true value on one axis."""

    truth_m: float
    error_m: np.ndarray


def clusters_of(measurements, axis):
    """Group the errors of an axis, 'X' or 'Z', by true value. Raises ValueError if there are too few measurements."""
    number = AXES.index(axis)
    truth_m, measured_m = measurements.truth_m[:, number], measurements.measured_m[:, 2 * number]
    known = np.isfinite(truth_m) & np.isfinite(measured_m)
    if not known.any():
        raise ValueError('%s: no measurement of %s' % (measurements.name, axis))
    truth_m, error_m = truth_m[known], (measured_m - truth_m)[known]
    clusters = [Cluster(float(value), error_m[truth_m == value]) for value in np.unique(truth_m)]
    if len(clusters) == 1:
        raise ValueError('%s: all measurements have %s true = %g m; the error as a function of it needs several values'
                         % (measurements.name, axis, clusters[0].truth_m))
    for cluster in clusters:
        if len(cluster.error_m) < LEAST_IN_CLUSTER:
            raise ValueError('%s: only %d measurements with %s true = %g m; at least %d needed for a variance'
                             % (measurements.name, len(cluster.error_m), axis, cluster.truth_m, LEAST_IN_CLUSTER))
    return clusters


def read_table(path, axis):
    """Read a CSV table that has at least the columns of an axis, 'X' or 'Z', as a MeasurementTable.

    Raises ValueError, with the number of the line, if the table is invalid.
    """
    try:
        with open(path, encoding='utf-8-sig', newline='') as stream:
            reader = csv.DictReader(stream)
            columns = reader.fieldnames = [name.strip() for name in reader.fieldnames or ()]
            for column in (axis + ' measured', axis + ' true'):
                if column not in columns:
                    raise ValueError('%s: no column "%s"; there are: %s' % (path, column, ', '.join(columns) or 'none'))
            rows = [[_axis_of(row, name, '%s, line %d' % (path, reader.line_num)) for name in AXES] for row in reader]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ValueError('%s: cannot be read as a table (%s)' % (path, error))
    if not rows:
        raise ValueError('%s: a table without rows' % path)
    values_m = np.array(rows).reshape(-1, 2, 2) / 1000  # row, axis, (measured, true)
    measured_m = np.stack((values_m[:, 0, 0], np.zeros(len(rows)), values_m[:, 1, 0]), axis=1)
    return MeasurementTable(path, measured_m, values_m[:, :, 1], np.zeros(len(rows), bool))


def read_session_measurements(folder, estimator):
    """Apply an estimator to the frames with ground truth of a measurement session, and return a MeasurementTable.

    `estimator` is a name for `estimator_named`, or 'recorded' for the estimates stored in the session. Raises
    ValueError if the session cannot be read, or none of its frames has ground truth and an estimate.
    """
    session, measured_m, truth_m, cut = read_session(folder), [], [], []
    for frame in session.frames:
        position_m = None if frame.truth_m is None else _estimate(frame, session, estimator)
        if position_m is not None:
            measured_m.append(position_m)
            truth_m.append(frame.truth_m)
            cut.append(_is_cut(frame, session.camera))
    if not measured_m:
        raise ValueError('%s: no frame with ground truth and an estimate (%s)' % (folder, estimator))
    return MeasurementTable(str(folder), np.array(measured_m), np.array(truth_m), np.array(cut))


def _estimate(frame, session, name):
    """Position (3,) of the annotated person of a frame, whose box is the first one, or None."""
    if name == 'recorded':
        return frame.estimate_m
    boxes = estimate_boxes(read_depth(frame, session), frame.boxes_px, session.camera, estimator_named(name))
    return boxes[0].center_m if boxes and boxes[0] is not None else None


def _is_cut(frame, camera):
    if not frame.boxes_px:
        return False
    left, _top, right, _bottom = truncated_edges(frame.boxes_px[0], (0, 0) + camera[:2])
    return left or right


def _axis_of(row, axis, where):
    """(measured, true) of one axis of a row, in millimetres; NaN if the row has no values."""
    measured, true, error = (_number(row.get('%s %s' % (axis, kind)), where, '%s %s' % (axis, kind))
                             for kind in ('measured', 'true', 'error'))
    if np.isnan(measured) != np.isnan(true):
        raise ValueError('%s: "%s measured" is %g and "%s true" is %g; both or none expected'
                         % (where, axis, measured, axis, true))
    if abs(measured - true - error) > ROUNDING_MM:
        raise ValueError('%s: "%s error" is %g, but measured minus true is %g'
                         % (where, axis, error, measured - true))
    return measured, true


def _number(text, where, column):
    if text is None or not text.strip():
        return np.nan
    try:
        number = float(text)
    except ValueError:
        number = np.inf
    if not np.isfinite(number):
        raise ValueError('%s: "%s" is %.40r; a number of millimetres expected' % (where, column, text))
    return number
