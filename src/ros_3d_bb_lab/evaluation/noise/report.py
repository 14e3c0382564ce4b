"""Output of the noise analysis: a folder with an HTML report, figures, summary and error models, and a short text."""
import html
import json

from ros_3d_bb.estimation.error_model import write_error_model
from ros_3d_bb_lab.evaluation.noise import theory
from ros_3d_bb_lab.evaluation.noise.analysis import RMS_FIT_FROM_M, summary_of
from ros_3d_bb_lab.evaluation.noise.figures import polynomial_text, write_figures
from ros_3d_bb_lab.evaluation.noise.statistics import DISTRIBUTIONS, LEAST_TO_TEST

SIMILAR = 0.05  # log-likelihood per measurement; smaller differences are not significant
PAGE = '''<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>Noise analysis</title><style>
body { font: 16px/1.5 sans-serif; max-width: 54em; margin: 2em auto; padding: 0 1em; color: #222; }
table { border-collapse: collapse; margin: 1em 0; } td, th { padding: 0.15em 0.8em; text-align: right; }
th { border-bottom: 1px solid #888; } td:first-child, th:first-child { text-align: left; padding-left: 0; }
img { max-width: 100%%; } figure { margin: 1.5em 0; } figcaption { color: #555; font-size: 0.9em; }
</style></head><body>
<h1>Noise analysis</h1>
%s
</body></html>
'''


def write_results(folder, analysis):
    """Write the report with its figures, summary.json and the error models into a folder (pathlib.Path).

    The folder is created if it does not exist. Raises OSError.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_figures(folder, analysis)
    sections = _summary, _theory, _focal_lengths, _z, _x, _distributions, _model
    page = PAGE % '\n'.join(piece for section in sections for piece in section(analysis))
    (folder / 'report.html').write_text(page, encoding='utf-8')
    (folder / 'summary.json').write_text(json.dumps(summary_of(analysis), indent=1), encoding='utf-8')
    for name, model in (('error_model_thesis_form.yaml', analysis.thesis_form),
                        ('error_model.yaml', analysis.model or analysis.thesis_form)):
        if model is not None:
            write_error_model(folder / name, model)


def text_of(analysis):
    """Mean error and standard deviation of both axes as text, one line per axis."""
    return '\n'.join(
        'f(%s) = %s, largest variance %.5f m², standard deviation %.4f m'
        % (name, polynomial_text(axis.poly, name), variances.max_variance_m2, variances.max_sigma_m)
        for name, axis, variances in (('z', analysis.z, analysis.z), ('x', analysis.x, analysis.x_variance)))


def _summary(analysis):
    inputs = analysis.inputs
    far = max(analysis.z.clusters, key=lambda cluster: abs(cluster.mean_m))
    tested = [cluster for _name, cluster in analysis.variance_clusters if cluster.tested]
    gaussian = sum(cluster.looks_gaussian for cluster in tested)
    return [
        _paragraph('Errors of the measured positions of people. Error is measured minus true; X is to the right of the '
                   'camera, Z ahead of it. A cluster is the set of all measurements with one true value.'),
        _table(('', 'X', 'Z'), (
            ('measurements of the mean', _count(analysis.x), _count(analysis.z)),
            ('measurements of the variance', _count(analysis.x_variance), _count(analysis.z)),
            ('mean error f', polynomial_text(analysis.x.poly, 'x'), polynomial_text(analysis.z.poly, 'z')),
            ('largest variance σ² [m²]', '%.5f' % analysis.x_variance.max_variance_m2,
             '%.5f' % analysis.z.max_variance_m2),
            ('largest standard deviation σ [m]', '%.4f' % analysis.x_variance.max_sigma_m,
             '%.4f' % analysis.z.max_sigma_m))),
        _paragraph('At Z = %.2f m the mean error is %+.3f m, %.1f times the standard deviation there: inflating '
                   'obstacles by σ alone does not cover it.' % (
                       far.truth_m, far.mean_m, abs(far.mean_m) / max(far.sigma_m, 1e-6))
                   if abs(far.mean_m) > far.sigma_m else 'The mean error never exceeds the standard deviation.',
                   'The error model at the end of this page corrects the mean error.',
                   'Both tests accept a Gaussian for %d of %d tested clusters.' % (gaussian, len(tested))),
        _paragraph('Estimator: %s. Camera: %s. Z: %s. X: %s. Variance of X: %s.' % (
            inputs.estimator, inputs.camera, inputs.z.name, inputs.x.name, inputs.x_variance.name))]


def _theory(analysis):
    far = analysis.z.clusters[-1]
    return [
        _heading('Depth error and the theory of stereo cameras'),
        _paragraph('A stereo camera with a matching error of s pixels has a depth error of d² · s / (f · b) at '
                   'distance d, for one pixel on a plane. The curved surface of a person and the detector increase '
                   'the error; averaging over many pixels decreases it.',
                   'The measured RMS includes the mean error; the standard deviation does not.',
                   'If the RMS is much larger than the standard deviation, most of the error is bias.',
                   'At %.2f m: RMS %.4f m, standard deviation %.4f m, theory %.4f m.' % (
                       far.truth_m, far.rms_m, far.sigma_m, theory.stereo_rms_m(far.truth_m, theory.STEREO_PX_M))),
        _figure('figure_5_2.png', 'Figure 5.2: depth error by distance.' + (
            '' if analysis.rms_poly is None else ' The fit begins at %.1f m.' % RMS_FIT_FROM_M))]


def _focal_lengths(_analysis):
    thesis_px = theory.focal_px(theory.THESIS_FOV_DEG, theory.THESIS_WIDTH_PX)
    color_deg = theory.fov_deg(theory.COLOR_FOCAL_PX, theory.THESIS_WIDTH_PX)
    stereo_px = theory.STEREO_PX_M / theory.THESIS_BASELINE_M
    return [
        _paragraph('The thesis derives f = %.0f px from the 69° of the data sheet. These are the field of view of the '
                   'whole 16:9 colour sensor, but the images of 640×480 pixels (4:3) are cropped: the intrinsics of '
                   'the camera are f = %.1f px, %.1f°. With 69° the theoretical error is %.0f %% too large.'
                   % (thesis_px, theory.COLOR_FOCAL_PX, color_deg, 100 * (theory.COLOR_FOCAL_PX / thesis_px - 1)),
                   'Depth is measured by the infrared stereo pair, not by the colour camera, and aligning it to colour '
                   "does not change its error. The pair's f · b follows from the depth images of the thesis: all "
                   'depths are 610.14 m / n with integer n (1/32 pixel of disparity), so f · b is %.3f px·m, and f is '
                   '%.0f px with the baseline of 50 mm. This f is used here, with s = %.2f px as recommended by Intel.'
                   % (theory.STEREO_PX_M, stereo_px, theory.SUBPIXEL_PX))]


def _z(analysis):
    return [_heading('Z'), _figure('figure_5_3.png', 'Figure 5.3: Z error by true Z.'),
            _cluster_table(analysis.z, 'Z'),
            _figure('figure_5_4.png', 'Figure 5.4: variance of the Z error in each cluster.'),
            _paragraph('The polynomial is fitted to the mean errors of the clusters, with equal weights.',
                       _between_text(analysis.z_between, 'Z', 'X'))]


def _x(analysis):
    pieces = [_heading('X'), _figure('figure_5_5.png', 'Figure 5.5: X error by true X.'),
              _cluster_table(analysis.x, 'X')]
    if analysis.x_variance != analysis.x:
        pieces += [_paragraph('The mean error is that of all measurements. Variance and distribution are those of %s '
                              'measurements without people who are truncated by the image border:'
                              % _count(analysis.x_variance)), _cluster_table(analysis.x_variance, 'X')]
    return pieces + [_figure('figure_5_6.png', 'Figure 5.6: variance of the X error in each cluster.'),
                     _paragraph(_between_text(analysis.x_between, 'X', 'Z'))]


def _distributions(analysis):
    header = ('cluster', 'n', 'Shapiro–Wilk p', 'Anderson–Darling', 'critical at 5 %', 'Gaussian?')
    return [
        _heading('Distribution of the errors'),
        _figure('figure_5_7.png', 'Figure 5.7: density of the Z error in each cluster, and the fitted Gaussian.'),
        _figure('figure_5_8.png', 'Figure 5.8: density of the X error in each cluster, and the fitted Gaussian.'),
        _paragraph('Shapiro–Wilk rejects a Gaussian if p is below 0.05, Anderson–Darling if its statistic exceeds the '
                   'critical value. Small clusters are seldom rejected, which does not prove that they are Gaussian. '
                   'Clusters with fewer than %d measurements, or with equal errors, are not tested.' % LEAST_TO_TEST),
        _paragraph('The last columns compare distributions by the mean log density of held-out measurements in '
                   'five-fold cross-validation; ★ marks the largest value, the best distribution.',
                   _best_text(analysis)),
        _table(header + tuple(name for name, _fit in DISTRIBUTIONS),
               [_distribution_row(name, cluster) for name, cluster in analysis.variance_clusters])]


def _model(analysis):
    if analysis.model is None:
        pieces = [_paragraph('No cross-validated model: %s. error_model.yaml has the form of the thesis instead.'
                             % analysis.no_model)]
    else:
        pieces = _model_pieces(analysis.model)
    return [_heading('Error model')] + pieces + [_paragraph(
        'error_model_thesis_form.yaml has the form of the thesis: the polynomials of the first table, and the largest '
        'standard deviation at all positions.' if analysis.thesis_form is not None
        else 'There is no model in the form of the thesis: the polynomials of the first table are not invertible.',
        'The keys of both are explained in config/error_models/README.md.')]


def _model_pieces(model):
    scores, limits = model.cross_validated, model.measured_range
    z_bias = ' '.join('%+.4f%s' % (value, {0: '', 1: ' z', 2: ' z²', 3: ' z³'}[len(model.z_bias) - 1 - number])
                      for number, value in enumerate(model.z_bias))
    return [
        _paragraph('error_model.yaml is for bbox3d_node. It is fitted to the %d measurements with both X and Z, at %d '
                   'positions with equal weights. Its number of coefficients was selected by cross-validation.'
                   % (model.provenance.measurements, model.provenance.positions)),
        _table(('part', 'value'), (
            ('bias of Z', z_bias), ('bias of X', '%+.4f x %+.4f x/z %+.4f' % model.x_bias),
            ('σ of Z [m]', _spread_text(model.z_sigma)), ('σ of X [m]', _spread_text(model.x_sigma)),
            ('measured range', 'Z from %.2f to %.2f m, |X| to %.2f m'
             % (limits.z_min_m, limits.z_max_m, limits.x_max_m)))),
        _paragraph('Cross-validation, each position corrected by a model of all others: RMSE %.3f m in X, %.3f m in Z, '
                   '%.3f m in the plane. The 68 %% ellipse contains %.0f %% of the measurements, the 95 %% ellipse '
                   '%.0f %%.' % (scores.rmse_x_m, scores.rmse_z_m, scores.rmse_plane_m,
                                 100 * scores.coverage_68, 100 * scores.coverage_95),
                   'Outside the measured range the bias is that at its limit, and the standard deviation grows by '
                   '%.1f m per metre.' % model.growth_outside)]


def _cluster_table(axis, name):
    return _table(('true %s [m]' % name, 'n', 'mean error [m]', 'standard deviation [m]', 'variance [m²]', 'RMS [m]'),
                  [('%.2f' % cluster.truth_m, '%d' % cluster.count, '%+.4f' % cluster.mean_m, '%.4f' % cluster.sigma_m,
                    '%.6f' % cluster.variance_m2, '%.4f' % cluster.rms_m) for cluster in axis.clusters])


def _distribution_row(name, cluster):
    row = ('%s = %.2f m' % (name, cluster.truth_m), '%d' % cluster.count)
    if not cluster.tested:
        return row + ('not tested', '', '', '') + ('',) * len(DISTRIBUTIONS)
    best = max(cluster.log_likelihoods.values())
    return row + (
        '%.4f' % cluster.shapiro_p, '%.2f' % cluster.anderson, '%.2f' % cluster.anderson_critical,
        'not rejected' if cluster.looks_gaussian else 'no') + tuple(
            '%.2f%s' % (cluster.log_likelihoods[kind], ' ★' if cluster.log_likelihoods[kind] == best else '')
            for kind, _fit in DISTRIBUTIONS)


def _best_text(analysis):
    """Distribution with the highest log-likelihood over all clusters, weighted by their number of measurements."""
    clusters = [cluster for _name, cluster in analysis.variance_clusters if cluster.tested]
    if not clusters:
        return ''
    count = float(sum(cluster.count for cluster in clusters))
    means = {name: sum(cluster.count * cluster.log_likelihoods[name] for cluster in clusters) / count
             for name, _fit in DISTRIBUTIONS}
    best = max(means, key=means.get)
    gain = means[best] - means['Gaussian']
    text = 'Over all clusters: ' + ', '.join('%s %.3f' % (name, means[name]) for name, _fit in DISTRIBUTIONS) + '. '
    if gain < SIMILAR:
        return text + 'No distribution exceeds the Gaussian by more than %.2f.' % SIMILAR
    return text + 'Best: %s, %.3f per measurement above the Gaussian.' % (best, gain)


def _between_text(share, axis, other):
    if share is None:
        return ''
    return ('%.0f %% of the variance within the %s clusters is between positions of different %s, not between '
            'repetitions at one position%s.' % (100 * share, axis, other,
                                                '; it is bias rather than noise' if share > 0.5 else ''))


def _spread_text(spread):
    if spread.growth == 0:
        return '%.4f' % spread.constant_m
    return '√(%.4f² + (%.4f z²)² + (%.4f / z)²)' % spread


def _count(axis):
    return str(sum(cluster.count for cluster in axis.clusters))


def _heading(text):
    return '<h2>%s</h2>' % html.escape(text)


def _paragraph(*sentences):
    return '<p>%s</p>' % html.escape(' '.join(sentence for sentence in sentences if sentence))


def _table(header, rows):
    lines = [_row('th', header)] + [_row('td', row) for row in rows]
    return '<table>\n%s\n</table>' % '\n'.join(lines)


def _row(cell, texts):
    return '<tr>%s</tr>' % ''.join('<%s>%s</%s>' % (cell, html.escape(text), cell) for text in texts)


def _figure(name, caption):
    return '<figure><img src="%s" alt="%s"><figcaption>%s</figcaption></figure>' % (name, caption, caption)
