"""Noise analysis: moments and a normality test of clusters of errors, and the resulting error model."""
import datetime
import os
import sys
from typing import NamedTuple, Optional, Tuple

import numpy as np

from ros_3d_bb.estimation.error_model import ErrorModel
from ros_3d_bb.sessions.plausibility import Outlier
from ros_3d_bb_lab.evaluation.error_model_fit import fit_error_model
from ros_3d_bb_lab.evaluation.noise.tables import MeasurementTable, clusters_of

Z_DEGREE, X_DEGREE = 2, 1
LEAST_IN_CLUSTER = 3  # measurements
SUMMARY = 'truth_m', 'count', 'mean_m', 'variance_m2', 'rms_m', 'shapiro_p'  # of a cluster


class AxisStatistics(NamedTuple):
    """Clusters of one axis, and the polynomial of their mean error by true value, highest power first.

    It is fitted with equal weights of the clusters, as in the thesis. `small` clusters are left out.
    """

    poly: tuple
    clusters: tuple
    small: tuple

    @property
    def max_variance_m2(self):
        return max(cluster.variance_m2 for cluster in self.clusters)

    @property
    def max_sigma_m(self):
        return float(np.sqrt(self.max_variance_m2))

    def poly_text(self, variable):
        """The polynomial in mathematical notation: −0.040 z² + 0.060 z + 0.008."""
        text = ''
        for power, value in zip(range(len(self.poly) - 1, -1, -1), self.poly):
            sign = ('−' if value < 0 else '+') if text else ('−' if value < 0 else '')
            term = ('%.3f' % abs(value)) + {0: '', 1: ' ' + variable, 2: ' %s²' % variable}[power]
            text += (' %s ' % sign if text else sign) + term
        return text


def axis_statistics(table, axis, degree):
    """Statistics of an axis, 'X' or 'Z'. Raises ValueError if there are too few clusters."""
    found = clusters_of(table, axis)
    clusters = tuple(cluster for cluster in found if cluster.count >= LEAST_IN_CLUSTER)
    if len(clusters) <= degree:
        raise ValueError('%s: at least %d measurements at each of %d values of %s true needed; there are %s' % (
            table.name, LEAST_IN_CLUSTER, degree + 1, axis, ', '.join(
                '%d at %g m' % (cluster.count, cluster.truth_m) for cluster in found) or 'none'))
    poly = np.polyfit([cluster.truth_m for cluster in clusters], [cluster.mean_m for cluster in clusters], degree)
    return AxisStatistics(tuple(poly.tolist()), clusters,
                          tuple(cluster for cluster in found if cluster.count < LEAST_IN_CLUSTER))


class Inputs(NamedTuple):
    """Measurements for z, for x, and for its variance (no truncated people, as in the thesis), and their origin.

    `outliers` are left out of all tables.
    """

    z: MeasurementTable
    x: MeasurementTable
    x_variance: MeasurementTable
    estimator: str
    camera: str
    outliers: Tuple[Outlier, ...] = ()

    @classmethod
    def of(cls, z, x, x_variance, estimator, camera):
        """Inputs without the outliers of the tables, which may be the same table, and for the variance without
        truncated people."""
        found = [table.outliers() for table in (z, x, x_variance)]
        unique = {(table.name, outlier.name, *outlier.truth_m.tolist()): outlier
                  for table, outliers in zip((z, x, x_variance), found) for outlier in outliers}
        z, x, x_variance = (table.without(outliers) for table, outliers in zip((z, x, x_variance), found))
        return cls(z, x, x_variance.whole(), estimator, camera, tuple(unique.values()))


class Analysis(NamedTuple):
    """Results of `./run noise`.

    `x` contains the mean errors, and `x_variance` the variances. `model` is the cross-validated error model; if it is
    None, `no_model` is the reason. `date` is that of the analysis.
    """

    inputs: Inputs
    z: AxisStatistics
    x: AxisStatistics
    x_variance: AxisStatistics
    model: Optional[ErrorModel]
    no_model: str
    date: str

    @property
    def model_note(self):
        """Why there is no error model; '' if there is one."""
        return '' if self.model is not None else 'no error_model.yaml is written: %s' % self.no_model

    def print_results(self, folder):
        """Print mean error and standard deviation of both axes, what is left out, and the path of the report."""
        for outlier in self.inputs.outliers:
            print('left out of the analysis:', outlier, file=sys.stderr)
        for name, axis, spread in (('z', self.z, self.z), ('x', self.x, self.x_variance)):
            print('f(%s) = %s, largest variance %.5f m², standard deviation %.4f m' % (
                name, axis.poly_text(name), spread.max_variance_m2, spread.max_sigma_m))
        if self.model_note:
            print('note:', self.model_note, file=sys.stderr)
        print('detector: not measured, default values; ./run noise --recordings measures it')
        print('report: %s' % (folder / 'report.html'))


def analyse(inputs):
    """Analyse `inputs`, and return an Analysis. Raises ValueError if there are too few measurements."""
    z, x = axis_statistics(inputs.z, 'Z', Z_DEGREE), axis_statistics(inputs.x, 'X', X_DEGREE)
    try:
        x_variance = axis_statistics(inputs.x_variance, 'X', X_DEGREE)
    except ValueError as error:
        raise ValueError('%s, without people who are truncated by the left or right image border' % error)
    names = set(os.path.basename(os.path.abspath(table.name)) for table in (inputs.z, inputs.x, inputs.x_variance))
    known, today = inputs.x.complete(), datetime.date.today().isoformat()
    model, reason = None, ''
    try:
        model = fit_error_model(known.measured_m, known.truth_m, ', '.join(sorted(names)), inputs.estimator,
                                inputs.camera, today)
    except ValueError as error:
        reason = str(error)
    return Analysis(inputs, z, x, x_variance, model, reason, today)


def summary_of(analysis):
    """Summary of the analysis as a dictionary, as stored in summary.json. Lengths are in metres."""
    x, variance = _axis_summary(analysis.x), _axis_summary(analysis.x_variance)
    x.update(max_variance_m2=variance['max_variance_m2'], max_sigma_m=variance['max_sigma_m'],
             variance_clusters=variance['clusters'])
    scores = None if analysis.model is None else dict(analysis.model.cross_validated._asdict())
    outliers = [{'name': outlier.name, 'measured_m': outlier.measured_m.tolist(), 'truth_m': outlier.truth_m.tolist()}
                for outlier in analysis.inputs.outliers]
    return {'z': _axis_summary(analysis.z), 'x': x, 'cross_validated': scores, 'outliers': outliers,
            'left_out': [list(pair) for pair in analysis.inputs.z.left_out]}


def _axis_summary(axis):
    return {'poly': list(axis.poly), 'max_variance_m2': axis.max_variance_m2, 'max_sigma_m': axis.max_sigma_m,
            'clusters': [{name: getattr(cluster, name) for name in SUMMARY} for cluster in axis.clusters]}
