"""The noise analysis as one value: statistics of both axes, the theory, and the error models that come of them."""
import datetime
import os
from typing import Any, NamedTuple, Optional

import numpy as np

from ros_3d_bb.estimation.error_model import ErrorModel, MeasuredRange, Provenance, Spread, XBias, checked
from ros_3d_bb_lab.evaluation.error_model_fit import GROWTH_OUTSIDE, LEAST_SIGMA_M, Y_SIGMA_M, fit_error_model
from ros_3d_bb_lab.evaluation.noise import theory
from ros_3d_bb_lab.evaluation.noise.statistics import AxisStatistics, axis_statistics, share_between_positions
from ros_3d_bb_lab.evaluation.noise.tables import MeasurementTable, clusters_of

Z_DEGREE, X_DEGREE = 2, 1
RMS_FIT_FROM_M = 1.5  # nearer, the error does not go with the square of the distance (thesis 5.2)


class Inputs(NamedTuple):
    """Measurements for z, for x, and for the variance of x (the thesis leaves out people cut by the image's edge), and
    who made them."""

    z: MeasurementTable
    x: MeasurementTable
    x_variance: MeasurementTable
    estimator: str
    camera: str


class Analysis(NamedTuple):
    """What `./run noise` found. `x` has the mean error, `x_variance` the variances; `rms_poly` is the curve through the
    RMS of z from RMS_FIT_FROM_M on, or None; `z_between`, `x_between` see `share_between_positions`.

    `model` is the cross-validated error model, None where `no_model` says why; `thesis_form` is the one of the thesis'
    form: the same polynomials, the largest variance everywhere; None where its bias has no inverse.
    """

    inputs: Inputs
    z: AxisStatistics
    x: AxisStatistics
    x_variance: AxisStatistics
    rms_poly: Any
    z_between: Optional[float]
    x_between: Optional[float]
    thesis_form: Optional[ErrorModel]
    model: Optional[ErrorModel]
    no_model: str


def analyse(inputs):
    """Do the analysis. Raises ValueError where there is too little to analyse."""
    z, x, x_variance = (axis_statistics(clusters_of(measurements, axis), degree) for measurements, axis, degree in (
        (inputs.z, 'Z', Z_DEGREE), (inputs.x, 'X', X_DEGREE), (inputs.x_variance, 'X', X_DEGREE)))
    thesis_form, reason = _or_reason(_thesis_form, inputs, z, x, x_variance)
    known, (source, camera, date) = inputs.x.complete(), _origin(inputs)
    model, reason = _or_reason(fit_error_model, known.measured_m, known.truth_m, source, inputs.estimator, camera, date)
    return Analysis(inputs, z, x, x_variance, _rms_poly(z), share_between_positions(inputs.z, 'Z'),
                    share_between_positions(inputs.x_variance, 'X'), thesis_form, model, reason)


def summary_of(analysis):
    """The analysis as a dictionary, see design section 8: lengths in metres."""
    x = dict(_axis_summary(analysis.x), max_variance_m2=analysis.x_variance.max_variance_m2,
             max_sigma_m=analysis.x_variance.max_sigma_m,
             variance_clusters=_axis_summary(analysis.x_variance)['clusters'])
    scores = None if analysis.model is None else dict(analysis.model.cross_validated._asdict())
    return {'z': _axis_summary(analysis.z), 'x': x, 'cross_validated': scores, 'theory': {
        'subpixel_px': theory.SUBPIXEL_PX, 'focal_times_baseline_px_m': theory.STEREO_PX_M,
        'color_focal_px': theory.COLOR_FOCAL_PX,
        'thesis_focal_px': theory.focal_px(theory.THESIS_FOV_DEG, theory.THESIS_WIDTH_PX)}}


def _axis_summary(axis):
    return {'poly': list(axis.poly), 'max_variance_m2': axis.max_variance_m2, 'max_sigma_m': axis.max_sigma_m,
            'clusters': [dict(cluster._asdict()) for cluster in axis.clusters]}


def _or_reason(function, *arguments):
    """(what a function returns, '') or (None, why it refuses)."""
    try:
        return function(*arguments), ''
    except ValueError as error:
        return None, str(error)


def _origin(inputs):
    """Source, camera and date for the provenance."""
    paths = [measurements.name for measurements in (inputs.z, inputs.x, inputs.x_variance)]
    names = set(os.path.basename(os.path.abspath(path)) for path in paths)
    return ', '.join(sorted(names)), inputs.camera, datetime.date.today().isoformat()


def _thesis_form(inputs, z, x, x_variance):
    """The error model that the thesis would publish of these statistics."""
    source, camera, date = _origin(inputs)
    z_m, x_m = ([cluster.truth_m for cluster in axis.clusters] for axis in (z, x))
    count = sum(cluster.count for cluster in z.clusters)
    return checked(ErrorModel(
        z.poly, XBias(x.poly[0], 0.0, x.poly[1]), Spread(max(z.max_sigma_m, LEAST_SIGMA_M), 0.0, 0.0),
        Spread(max(x_variance.max_sigma_m, LEAST_SIGMA_M), 0.0, 0.0), Y_SIGMA_M,
        MeasuredRange(min(z_m), max(z_m), max(abs(value) for value in x_m), min(z_m)), GROWTH_OUTSIDE,
        Provenance(source, inputs.estimator, camera, date, count, len(z_m)), None))


def _rms_poly(z):
    far = [cluster for cluster in z.clusters if cluster.truth_m >= RMS_FIT_FROM_M]
    if len(far) <= Z_DEGREE:
        return None
    return np.polyfit([cluster.truth_m for cluster in far], [cluster.rms_m for cluster in far], Z_DEGREE)
