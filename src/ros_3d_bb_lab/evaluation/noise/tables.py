"""Measurements with ground truth, from tables in the format of the thesis or from sessions, and their clusters.

A table is a CSV file in millimetres with the columns `X measured`, `X true`, `Z measured`, `Z true`. Cells of an axis
that was not measured are empty, or its columns are missing. The columns `X error` and `Z error` are checked; other
columns are ignored.
"""
import csv
import datetime
from typing import Any, NamedTuple, Tuple

import numpy as np
from scipy import stats

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.estimation.box3d_estimator import estimator_named
from ros_3d_bb.estimation.error_model import RECORDED
from ros_3d_bb.sessions.plausibility import outliers_of
from ros_3d_bb.sessions.session_reader import SessionError, annotated_people, read_depth, read_session

AXES = ('X', 'Z')
LEAST_TO_TEST = 8  # measurements, for the normality test
LEAST_EXTENT_M = 0.05  # tables of less are in metres
ROUNDING_MM = 1.01  # errors may have been computed before the values were rounded


class MeasurementTable(NamedTuple):
    """Positions x, y, z (n, 3) and ground truth x, z (n, 2) in metres, NaN if not measured, and name of the source.

    `cut` (n,) is whether the left or right image border truncates the person, if known. `ids` are the names of the
    measurements, and `left_out` pairs (name, reason) of those that are not in the table. `camera` (a Camera) and
    `dates` are those of a session; None and '' if unknown.
    """

    name: str
    measured_m: np.ndarray
    truth_m: np.ndarray
    cut: np.ndarray
    ids: Tuple[str, ...]
    left_out: Tuple[Tuple[str, str], ...] = ()
    camera: Any = None
    dates: str = ''

    def complete(self):
        return self._part(np.isfinite(np.c_[self.measured_m[:, [0, 2]], self.truth_m]).all(axis=1))

    def whole(self):
        return self._part(~self.cut)

    def outliers(self):
        """Outliers of the table, see `plausibility`. Measurements of one axis are not checked."""
        complete = self.complete()
        return tuple(filter(None, outliers_of(complete.ids, complete.measured_m[:, [0, 2]], complete.truth_m)))

    def without(self, outliers):
        """Select the measurements that are not among the outliers. Others of the same image remain."""
        found = set((outlier.name, *outlier.truth_m.tolist()) for outlier in outliers)
        return self._part(np.array([(name, *truth_m) not in found
                                    for name, truth_m in zip(self.ids, self.truth_m.tolist())]))

    def _part(self, mask):
        return self._replace(measured_m=self.measured_m[mask], truth_m=self.truth_m[mask], cut=self.cut[mask],
                             ids=tuple(name for name, selected in zip(self.ids, mask) if selected))


class Cluster(NamedTuple):
    """Errors (n,), in metres, of all measurements with the same true value on one axis."""

    truth_m: float
    error_m: np.ndarray

    @property
    def count(self):
        return len(self.error_m)

    @property
    def mean_m(self):
        return float(self.error_m.mean())

    @property
    def variance_m2(self):
        """Variance, divided by n, as in the thesis."""
        return float(self.error_m.var())

    @property
    def sigma_m(self):
        return float(np.sqrt(self.variance_m2))

    @property
    def rms_m(self):
        return float(np.sqrt((self.error_m ** 2).mean()))

    @property
    def shapiro_p(self):
        """Result of the Shapiro-Wilk test; None if all errors are equal, or there are fewer than LEAST_TO_TEST."""
        if self.count < LEAST_TO_TEST or np.ptp(self.error_m) == 0:
            return None
        return float(stats.shapiro(self.error_m)[1])


def clusters_of(measurements, axis):
    """Group the errors of an axis, 'X' or 'Z', by true value. Returns Clusters."""
    number = AXES.index(axis)
    truth_m, measured_m = measurements.truth_m[:, number], measurements.measured_m[:, 2 * number]
    known = np.isfinite(truth_m) & np.isfinite(measured_m)
    truth_m, error_m = truth_m[known], (measured_m - truth_m)[known]
    return [Cluster(float(value), error_m[truth_m == value]) for value in np.unique(truth_m)]


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
            rows, lines = [], []
            for row in reader:
                lines.append('line %d' % reader.line_num)
                rows.append([_axis_of(row, name, '%s, %s' % (path, lines[-1])) for name in AXES])
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ValueError('%s: cannot be read as a table (%s)' % (path, error))
    if not rows:
        raise ValueError('%s: a table without rows' % path)
    values_m = np.array(rows).reshape(-1, 2, 2) / 1000  # row, axis, (measured, true)
    extent_m = np.abs(np.nan_to_num(values_m[:, AXES.index(axis), 1])).max()
    if 0 < extent_m < LEAST_EXTENT_M:
        raise ValueError('%s: "%s true" is %g mm at most; the values seem to be metres, and millimetres are expected'
                         % (path, axis, 1000 * extent_m))
    measured_m = np.stack((values_m[:, 0, 0], np.zeros(len(rows)), values_m[:, 1, 0]), axis=1)
    return MeasurementTable(path, measured_m, values_m[:, :, 1], np.zeros(len(rows), bool), tuple(lines))


def read_session_measurements(folder, estimator):
    """Apply an estimator to the frames with ground truth of a measurement session, and return a MeasurementTable.

    `estimator` is a name for `estimator_named`, or 'recorded' for the estimates stored in the session. Measurements
    that cannot be used are `left_out`, as are rejected ones. Raises ValueError if the session cannot be read, or no
    measurement can be used.
    """
    left_out, rows = [], []
    session = read_session(folder, lambda name, reason: left_out.append((name, reason)))
    for frame in annotated_people(session.frames):
        try:
            rows.append((_estimate(frame, session, estimator), frame))
        except SessionError as error:
            left_out.append((frame.name, str(error)))
    left_out += [(frame.name, 'no estimate (%s)' % estimator) for position_m, frame in rows if position_m is None]
    left_out += [(frame.name, 'no ground truth') for frame in session.frames if not any(annotated_people([frame]))]
    used = [(position_m, frame) for position_m, frame in rows if position_m is not None]
    if not used:
        raise ValueError('%s: no frame with ground truth and an estimate (%s)' % (folder, estimator))
    positions_m, frames = zip(*used)
    return MeasurementTable(str(folder), np.array(positions_m), np.array([frame.truth_m[::2] for frame in frames]),
                            np.array([any(frame.truncated_edges(session.camera)[::2]) for frame in frames]),
                            tuple(frame.name for frame in frames), tuple(left_out), session.camera, _dates_of(frames))


def _dates_of(frames):
    days = [datetime.datetime.fromtimestamp(frame.stamp_ns // NS, datetime.timezone.utc).date().isoformat()
            for frame in frames if frame.stamp_ns is not None]
    return ' to '.join(sorted({min(days), max(days)})) if days else ''


def _estimate(frame, session, name):
    if name == RECORDED:
        return frame.estimate_m
    box = frame.estimate(read_depth(frame, session), session.camera, estimator_named(name))
    return None if box is None else box.center_m


def _axis_of(row, axis, where):
    """(measured, true) of one axis of a row, in millimetres; NaN if the row has no values."""
    measured, true, error = (_number(row.get('%s %s' % (axis, kind)), where, '%s %s' % (axis, kind))
                             for kind in ('measured', 'true', 'error'))
    if np.isnan(measured) != np.isnan(true):
        raise ValueError('%s: "%s measured" is %g and "%s true" is %g; both or none expected'
                         % (where, axis, measured, axis, true))
    if abs(measured - true - error) > ROUNDING_MM:
        raise ValueError('%s: "%s error" is %g, but measured minus true is %g' % (where, axis, error, measured - true))
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
