"""Output of the noise analysis: a folder with a report, its figures, a summary and an error model, and a short text."""
import json

from ros_3d_bb.estimation.error_model import write_error_model
from ros_3d_bb.sessions.plausibility import position_text
from ros_3d_bb_lab.evaluation.html_report import figure, heading, html_report, paragraph, table
from ros_3d_bb_lab.evaluation.noise.analysis import LEAST_IN_CLUSTER, summary_of
from ros_3d_bb_lab.evaluation.noise.figures import depth_rms, error_by_truth, histograms, sigmas
from ros_3d_bb_lab.evaluation.noise.tables import LEAST_TO_TEST

SIGNIFICANCE = 0.05  # of the normality test
TITLE = 'Position errors of a depth camera'
ESTIMATORS = {'foreground': 'foreground (that of bbox3d_node)', 'median': 'median (that of the thesis)',
              'recorded': 'recorded (as stored with the measurements)', '': 'unknown'}


def write_results(folder, analysis):
    """Write the report as HTML, its figures, summary.json and the error model into a folder (pathlib.Path).

    The folder is created if it does not exist. The error model of an earlier analysis does not remain. Raises OSError.
    """
    folder.mkdir(parents=True, exist_ok=True)

    def drawn(name, caption, draw, *arguments):
        draw(folder / name, *arguments)
        return figure(folder / name, caption)

    sections = _summary, _setup, _left_out, _z, _x, _model, _distributions
    elements = [element for section in sections for element in section(analysis, drawn)]
    (folder / 'report.html').write_text(html_report(TITLE, elements), encoding='utf-8')
    (folder / 'summary.json').write_text(json.dumps(summary_of(analysis), indent=1), encoding='utf-8')
    model_path = folder / 'error_model.yaml'
    if analysis.model is not None:
        write_error_model(model_path, analysis.model)
    elif model_path.exists():
        model_path.unlink()


def _summary(analysis, _drawn):
    model = analysis.model
    rows = [('measurements (mean error)', _count(analysis.x), _count(analysis.z)),
            ('measurements (variance)', _count(analysis.x_variance), _count(analysis.z)),
            ('mean error f [m]', analysis.x.poly_text('x'), analysis.z.poly_text('z')),
            ('largest variance σ² [m²]', '%.5f' % analysis.x_variance.max_variance_m2,
             '%.5f' % analysis.z.max_variance_m2),
            ('largest standard deviation σ [m]', '%.4f' % analysis.x_variance.max_sigma_m,
             '%.4f' % analysis.z.max_sigma_m)]
    header = '', 'X', 'Z'
    if model is not None:
        rows.append(('RMSE after correction, positions left out [m]', '%.3f' % model.cross_validated.rmse_x_m,
                     '%.3f' % model.cross_validated.rmse_z_m))
    pieces = [
        paragraph('This report describes how far positions of people, as measured by a depth camera, are from their '
                  'true positions, and a model of these errors. Error is measured minus true. X is to the right of the '
                  'camera and Z ahead of it, in its optical frame.'), table('main results', header, rows)]
    if model is None:
        return pieces
    return pieces + [paragraph(
        'Validated at positions that were not used for the fit, the 95 %% ellipse of the model contains %.0f %% of the '
        'measurements, and the remaining error in the plane is %.3f m (RMSE).'
        % (100 * model.cross_validated.coverage_95, model.cross_validated.rmse_plane_m))]


def _setup(analysis, _drawn):
    inputs = analysis.inputs
    complete = inputs.z.complete()
    positions = len(set(map(tuple, complete.truth_m.tolist())))
    rows = [('date of the analysis', analysis.date),
            ('dates of the measurements (UTC)', inputs.z.dates or 'not stored'),
            ('camera', inputs.camera), ('estimator', ESTIMATORS.get(inputs.estimator, inputs.estimator)),
            ('measurements from', ', '.join(sorted(set(
                str(source.name) for source in (inputs.z, inputs.x, inputs.x_variance))))),
            ('measurements', '%d used with X and Z, at %d positions' % (len(complete.truth_m), positions)),
            ('left out', 'rejected or unusable: %d, outliers: %d' % (len(inputs.z.left_out), len(inputs.outliers)))]
    return [heading('Measurements and camera'), table('measurements and camera', ('', 'value'), rows),
            paragraph('A cluster is the set of all measurements with one true value of X, or of Z. Clusters of fewer '
                      'than %d measurements are left out of the statistics of that axis.' % LEAST_IN_CLUSTER)]


def _left_out(analysis, _drawn):
    inputs = analysis.inputs
    reasons = {}
    for name, reason in inputs.z.left_out:
        reasons.setdefault(reason, []).append(name)
    rows = [(str(len(names)), reason, ', '.join(names)) for reason, names in sorted(reasons.items())]
    rows += [(str(cluster.count), 'fewer than %d with %s = %.2f m' % (LEAST_IN_CLUSTER, axis, cluster.truth_m),
              'statistics of %s only' % axis) for axis, found in (('Z', analysis.z), ('X', analysis.x_variance))
             for cluster in found.small]
    pieces = [heading('Measurements that were left out')]
    pieces.append(table('rejected and unusable measurements', ('number', 'reason', 'measurements'), rows) if rows
                  else paragraph('No measurement was rejected, and none was unusable.'))
    if not inputs.outliers:
        return pieces + [paragraph('There are no outliers: no true position is implausible.')]
    return pieces + [
        paragraph('Outliers have a true position whose error is far from what the other measurements make likely: '
                  'probably a slip in the entry, or the box of another person. They are left out of all results.'),
        table('outliers', ('measurement', 'true', 'estimate'), [
            (outlier.name, position_text(outlier.truth_m), position_text(outlier.measured_m))
            for outlier in inputs.outliers])]


def _z(analysis, drawn):
    return [heading('Errors in Z, the distance ahead'),
            paragraph('f(z) = %s metres, fitted to the mean errors of the clusters with equal weights.'
                      % analysis.z.poly_text('z')),
            drawn('z_error.png', 'error in Z by true Z, and f(z)', error_by_truth, analysis.z, 'Z'),
            _cluster_table(analysis.z, 'Z', 'errors in Z by true Z'),
            drawn('z_rms.png', 'RMS error in Z by true Z, measured and theoretical (as Fig. 5.2 of the thesis)',
                  depth_rms, analysis.z, analysis.inputs.z.camera)]


def _x(analysis, drawn):
    pieces = [heading('Errors in X, to the side'),
              paragraph('f(x) = %s metres.' % analysis.x.poly_text('x')),
              drawn('x_error.png', 'error in X by true X, and f(x)', error_by_truth, analysis.x, 'X'),
              _cluster_table(analysis.x, 'X', 'errors in X by true X')]
    if analysis.x_variance.poly != analysis.x.poly:
        pieces += [paragraph('The mean error is that of all measurements. Variance and distribution are those of the '
                             '%s measurements of people who are not truncated by the image border.'
                             % _count(analysis.x_variance)),
                   _cluster_table(analysis.x_variance, 'X', 'errors in X of people who are not truncated')]
    return pieces


def _distributions(analysis, drawn):
    z_clusters, x_clusters = analysis.z.clusters, analysis.x_variance.clusters
    tests = [cluster.shapiro_p for cluster in z_clusters + x_clusters if cluster.shapiro_p is not None]
    return [
        heading('Distribution of the errors'),
        paragraph('The Shapiro–Wilk test accepts a Gaussian for %d of %d tested clusters. It rejects a Gaussian if p '
                  '(in the tables of the clusters) is below 0.05. Small clusters are seldom rejected, which does not '
                  'prove that they are Gaussian. Clusters with fewer than %d measurements, or with equal errors, are '
                  'not tested.' % (sum(p >= SIGNIFICANCE for p in tests), len(tests), LEAST_TO_TEST)),
        drawn('z_distribution.png', 'density of the error in Z, and the fitted Gaussian', histograms, z_clusters, 'Z'),
        drawn('x_distribution.png', 'density of the error in X, and the fitted Gaussian', histograms, x_clusters, 'X')]


def _model(analysis, drawn):
    model, title = analysis.model, heading('Error model and its validation')
    if model is None:
        return [title, paragraph('%s%s.' % (analysis.model_note[:1].upper(), analysis.model_note[1:]))]
    scores, limits = model.cross_validated, model.measured_range
    z_bias = ' '.join('%+.4f%s' % (value, {0: '', 1: ' z', 2: ' z²', 3: ' z³'}[len(model.z_bias) - 1 - number])
                      for number, value in enumerate(model.z_bias))
    return [
        title,
        paragraph('error_model.yaml, in the folder of this report, is for bbox3d_node (error_model:=FILE), which '
                  'removes the bias and sets the covariance of positions. It is fitted to the %d measurements with '
                  'X and Z, at %d positions with equal weights. Its number of coefficients was selected by '
                  'cross-validation. x and z are the true position in metres.' % model.provenance[-2:]),
        table('error model', ('part', 'value'), (
            ('bias of Z [m]', z_bias), ('bias of X [m]', '%+.4f x %+.4f x/z %+.4f' % model.x_bias),
            ('σ of Z [m]', _spread_text(model.z_sigma)), ('σ of X [m]', _spread_text(model.x_sigma)),
            ('measured range', 'Z from %.2f to %.2f m, |X| to %.2f m'
             % (limits.z_min_m, limits.z_max_m, limits.x_max_m)),
            ('outside of it', 'bias as at its limit; σ grows by %.1f m per metre' % model.growth_outside))),
        drawn('sigma.png', 'standard deviation of the error model by range, and remaining errors of the positions',
              sigmas, analysis),
        paragraph('Leave-one-position-out cross-validation: the measurements of each position are corrected by a model '
                  'of all other positions. The coverage is the share of them inside the ellipse of that model; ideally '
                  'it is that of the ellipse. σ is widened until the 95 %% ellipse contains 95 %%, because errors have '
                  'longer tails than a Gaussian; the 68 %% ellipse then contains more, here %.0f %%.'
                  % (100 * scores.coverage_68))]


def _cluster_table(axis, name, caption):
    header = ('true %s [m]' % name, 'n', 'mean error [m]', 'standard deviation [m]', 'variance [m²]', 'RMS [m]',
              'Shapiro–Wilk p')
    return table(caption, header, [
        ('%.2f' % cluster.truth_m, '%d' % cluster.count, '%+.4f' % cluster.mean_m, '%.4f' % cluster.sigma_m,
         '%.6f' % cluster.variance_m2, '%.4f' % cluster.rms_m,
         'not tested' if cluster.shapiro_p is None else '%.4f' % cluster.shapiro_p) for cluster in axis.clusters])


def _spread_text(spread):
    if spread.growth == spread.near_m2 == 0:
        return '%.4f' % spread.constant_m
    return '√(%.4f² + (%.5f z²)² + (%.4f / z)²)' % spread


def _count(axis):
    return str(sum(cluster.count for cluster in axis.clusters))
