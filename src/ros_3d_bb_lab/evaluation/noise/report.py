"""HTML report of the noise analysis."""
from ros_3d_bb_lab.evaluation.noise import theory
from ros_3d_bb_lab.evaluation.noise.figures import RMS_FIT_FROM_M, polynomial_text
from ros_3d_bb_lab.evaluation.noise.html_page import figure, heading, page, paragraph, table
from ros_3d_bb_lab.evaluation.noise.statistics import DISTRIBUTIONS, LEAST_TO_TEST

SIMILAR = 0.05  # log-likelihood per measurement; smaller differences are not significant


def report_of(analysis):
    """Report as HTML. It refers to the files of `figures.write_figures` in the same folder."""
    return page('Noise analysis', _summary(analysis) + _theory(analysis) + _z(analysis) + _x(analysis)
                + _distributions(analysis) + _model(analysis))


def _summary(analysis):
    inputs = analysis.inputs
    far = max(analysis.z.clusters, key=lambda cluster: abs(cluster.mean_m))
    clusters, gaussian = _gaussian_count(analysis)
    return [
        paragraph('How far 3D boxes are from where people really stood. Error is what was measured minus the truth; X '
                  'is to the right of the camera, Z ahead of it. A cluster is all measurements with one true value.'),
        table(('', 'X', 'Z'), (
            ('measurements of the mean', _count(analysis.x), _count(analysis.z)),
            ('measurements of the variance', _count(analysis.x_variance), _count(analysis.z)),
            ('mean error f', polynomial_text(analysis.x.poly, 'x'), polynomial_text(analysis.z.poly, 'z')),
            ('largest variance σ² [m²]', '%.5f' % analysis.x_variance.max_variance_m2,
             '%.5f' % analysis.z.max_variance_m2),
            ('largest standard deviation σ [m]', '%.4f' % analysis.x_variance.max_sigma_m,
             '%.4f' % analysis.z.max_sigma_m))),
        paragraph('What this means:',
                  'At Z = %.2f m the mean error is %+.3f m, %.1f times the standard deviation there: a planner that '
                  'only widens obstacles by σ is wrong by that much.' % (
                      far.truth_m, far.mean_m, abs(far.mean_m) / max(far.sigma_m, 1e-6))
                  if abs(far.mean_m) > far.sigma_m else 'The mean error nowhere exceeds the standard deviation.',
                  'The mean error can be taken out; the error model at the end of this page does.',
                  '%d of %d tested clusters pass for a Gaussian.' % (gaussian, clusters)),
        paragraph('Measured by: %s. Camera: %s. Z: %s. X: %s. Variance of X: %s.' % (
            inputs.estimator, inputs.camera, inputs.z.name, inputs.x.name, inputs.x_variance.name))]


def _theory(analysis):
    far = analysis.z.clusters[-1]
    return [
        heading('Depth error and the theory of stereo cameras'),
        paragraph('A stereo camera that matches to s pixels has a depth error of d² · s / (f · b) at distance d, '
                  'for one pixel that shows a flat plane. That a person is round, and found by a detector, adds to it; '
                  'that a position is made of many pixels takes away from it.',
                  'The measured RMS holds the mean error too; the standard deviation is what is left without it.',
                  'Where the RMS is far above the standard deviation, most of the error is bias.',
                  'Here, at %.2f m: RMS %.4f m, standard deviation %.4f m, theory %.4f m.' % (
                      far.truth_m, far.rms_m, far.sigma_m, theory.stereo_rms_m(far.truth_m, theory.STEREO_PX_M))),
        figure('figure_5_2.png', 'Figure 5.2: depth error by distance.' + (
            '' if analysis.rms_poly is None else ' The fit begins at %.1f m.' % RMS_FIT_FROM_M))] + _focal_lengths()


def _focal_lengths():
    thesis_px = theory.focal_px(theory.THESIS_FOV_DEG, theory.THESIS_WIDTH_PX)
    color_deg = theory.fov_deg(theory.COLOR_FOCAL_PX, theory.THESIS_WIDTH_PX)
    stereo_px = theory.STEREO_PX_M / theory.THESIS_BASELINE_M
    rows = [(name, '%.0f' % focal, '%.1f' % theory.fov_deg(focal, theory.THESIS_WIDTH_PX),
             '%.4f' % theory.stereo_rms_m(3.0, focal * theory.THESIS_BASELINE_M))
            for name, focal in (("thesis: from the colour camera's 69°", thesis_px),
                                ('colour intrinsics', theory.COLOR_FOCAL_PX), ('stereo pair (used here)', stereo_px))]
    return [
        table(('focal length f', 'f [px]', 'field of view at 640 px [°]', 'theory at 3 m [m]'), rows),
        paragraph("Which f? The thesis takes %.0f px from the data sheet's 69°. That is the whole 16:9 colour sensor; "
                  'its images have 640×480 pixels (4:3), cut from the middle: the intrinsics that the camera reports '
                  'say f = %.1f px, %.1f°. So 69° does not fit them: with 69° theory is %.0f %% above what they give.'
                  % (thesis_px, theory.COLOR_FOCAL_PX, color_deg, 100 * (theory.COLOR_FOCAL_PX / thesis_px - 1)),
                  'Yet depth is not measured by the colour camera. Its error is that of the infrared stereo pair, and '
                  "aligning it to colour does not change it. The pair's f · b can be read from the thesis' depth "
                  'images: their depths are all 610.14 m / n with whole n (1/32 pixel of disparity), so f · b is %.3f '
                  'px·m, and f is %.0f px with the baseline of 50 mm. That is used here, with s = %.2f px as Intel '
                  'recommends.' % (theory.STEREO_PX_M, stereo_px, theory.SUBPIXEL_PX))]


def _z(analysis):
    return [heading('Z'), figure('figure_5_3.png', 'Figure 5.3: Z error by true Z.'), _cluster_table(analysis.z, 'Z'),
            figure('figure_5_4.png', 'Figure 5.4: variance of the Z error in each cluster.'),
            paragraph('The polynomial goes through the mean errors of the clusters, each of the same weight.',
                      _between_text(analysis.z_between, 'Z', 'X'))]


def _x(analysis):
    pieces = [heading('X'), figure('figure_5_5.png', 'Figure 5.5: X error by true X.'),
              _cluster_table(analysis.x, 'X')]
    if analysis.x_variance != analysis.x:
        pieces += [paragraph('The mean error is that of all measurements. Variance and distribution are those of %s '
                             'measurements without people who are cut by the edge of the image:'
                             % _count(analysis.x_variance)), _cluster_table(analysis.x_variance, 'X')]
    return pieces + [figure('figure_5_6.png', 'Figure 5.6: variance of the X error in each cluster.'),
                     paragraph(_between_text(analysis.x_between, 'X', 'Z'))]


def _distributions(analysis):
    clusters, gaussian = _gaussian_count(analysis)
    header = ('cluster', 'n', 'Shapiro–Wilk p', 'Anderson–Darling', 'critical at 5 %', 'Gaussian?')
    header += tuple(name for name, _fit in DISTRIBUTIONS)
    rows = [_distribution_row(name, cluster) for name, cluster in _all_clusters(analysis)]
    return [
        heading('Are the errors Gaussian?'),
        figure('figure_5_7.png', 'Figure 5.7: Z error in each cluster, as a density, and the best Gaussian.'),
        figure('figure_5_8.png', 'Figure 5.8: X error in each cluster, as a density, and the best Gaussian.'),
        paragraph('Two tests: Shapiro–Wilk rejects a Gaussian where p is below 0.05, Anderson–Darling where its '
                  'statistic is above the critical value. %d of %d clusters are rejected by neither.' % (
                      gaussian, clusters),
                  'A small cluster is hard to reject; that it is not does not make it Gaussian. With fewer than %d '
                  'measurements, or all equal, it is not tested.' % LEAST_TO_TEST),
        paragraph('The last columns compare distributions by what they say of measurements that they were not fitted '
                  'to: the mean log density in five-fold cross-validation; ★ marks the largest, the best.',
                  _best_text(analysis)),
        table(header, rows)]


def _model(analysis):
    pieces = [heading('The error model')]
    if analysis.model is None:
        pieces.append(paragraph('No cross-validated model: %s. error_model.yaml has the form of the thesis instead.'
                                % analysis.no_model))
    else:
        pieces += _model_pieces(analysis.model)
    return pieces + [paragraph(
        "error_model_thesis_form.yaml has the thesis' form: the polynomials of the first table, and the largest "
        'standard deviation everywhere.' if analysis.thesis_form is not None
        else "There is none of the thesis' form: the polynomials of the first table cannot be undone.",
        'The keys of both are explained in config/error_models/README.md.')]


def _model_pieces(model):
    scores, bias, limits = model.cross_validated, model.x_bias, model.measured_range
    return [
        paragraph('error_model.yaml is for bbox3d_node. It is fitted to the %d measurements with both X and Z, at %d '
                  'positions; each position has the same weight. The form was chosen by cross-validation.'
                  % (model.provenance.measurements, model.provenance.positions)),
        table(('part', 'value'), (
            ('bias of Z', ' '.join('%+.4f%s' % (value, _power_text('z', len(model.z_bias) - 1 - number))
                                   for number, value in enumerate(model.z_bias))),
            ('bias of X', '%+.4f x %+.4f x/z %+.4f' % bias),
            ('σ of Z [m]', _spread_text(model.z_sigma)), ('σ of X [m]', _spread_text(model.x_sigma)),
            ('measured for', 'Z from %.2f to %.2f m, |X| to %.2f m'
             % (limits.z_min_m, limits.z_max_m, limits.x_max_m)))),
        paragraph('How good it is, at positions that it never saw (each corrected by a model of all others): RMSE '
                  '%.3f m in X, %.3f m in Z, %.3f m in the plane. The ellipse of 68 %% holds %.0f %% of the '
                  'measurements, the one of 95 %% holds %.0f %%.' % (
                      scores.rmse_x_m, scores.rmse_z_m, scores.rmse_plane_m,
                      100 * scores.coverage_68, 100 * scores.coverage_95),
                  'Outside of the measured range the bias is kept as at its end, and the covariance grows: %.1f m of '
                  'standard deviation for each metre.' % model.growth_outside)]


def _cluster_table(axis, name):
    return table(('true %s [m]' % name, 'n', 'mean error [m]', 'standard deviation [m]', 'variance [m²]', 'RMS [m]'),
                 [('%.2f' % cluster.truth_m, '%d' % cluster.count, '%+.4f' % cluster.mean_m, '%.4f' % cluster.sigma_m,
                   '%.6f' % cluster.variance_m2, '%.4f' % cluster.rms_m) for cluster in axis.clusters])


def _distribution_row(name, cluster):
    row = ('%s = %.2f m' % (name, cluster.truth_m), '%d' % cluster.count)
    if not cluster.tested:
        return row + ('not tested', '', '', '') + ('',) * len(DISTRIBUTIONS)
    best = max(cluster.log_likelihoods.values())
    return row + (
        '%.4f' % cluster.shapiro_p, '%.2f' % cluster.anderson, '%.2f' % cluster.anderson_critical,
        'may be' if cluster.looks_gaussian else 'no') + tuple(
            '%.2f%s' % (cluster.log_likelihoods[kind], ' ★' if cluster.log_likelihoods[kind] == best else '')
            for kind, _fit in DISTRIBUTIONS)


def _best_text(analysis):
    """Distribution with the highest log-likelihood over all clusters, weighted by their number of measurements."""
    clusters = [cluster for _name, cluster in _all_clusters(analysis) if cluster.tested]
    if not clusters:
        return ''
    count = float(sum(cluster.count for cluster in clusters))
    means = {name: sum(cluster.count * cluster.log_likelihoods[name] for cluster in clusters) / count
             for name, _fit in DISTRIBUTIONS}
    best = max(means, key=means.get)
    gain = means[best] - means['Gaussian']
    text = 'Over all clusters: ' + ', '.join('%s %.3f' % (name, means[name]) for name, _fit in DISTRIBUTIONS) + '. '
    if gain < SIMILAR:
        return text + 'None is better than the Gaussian by more than %.2f: little is lost by using it.' % SIMILAR
    return text + '%s predict%s best, by %.3f a measurement over the Gaussian.' % (
        best, '' if best.endswith('s') else 's', gain)


def _between_text(share, axis, other):
    if share is None:
        return ''
    return ('A cluster of %s has people at several places in %s: %.0f %% of the variance within clusters is between '
            'those places, not between repeated measurements at one place%s.' % (
                axis, other, 100 * share, ', so it is bias more than noise' if share > 0.5 else ''))


def _all_clusters(analysis):
    return [('Z', cluster) for cluster in analysis.z.clusters] + [('X', cluster)
                                                                  for cluster in analysis.x_variance.clusters]


def _gaussian_count(analysis):
    """Number of tested clusters, and number of those for which neither test rejects a Gaussian."""
    tested = [cluster for _name, cluster in _all_clusters(analysis) if cluster.tested]
    return len(tested), sum(cluster.looks_gaussian for cluster in tested)


def _spread_text(spread):
    if spread.growth == 0:
        return '%.4f' % spread.constant_m
    return '√(%.4f² + (%.4f z²)² + (%.4f / z)²)' % spread


def _power_text(variable, power):
    return {-1: ' / %s', 0: '', 1: ' %s', 2: ' %s²', 3: ' %s³'}[power].replace('%s', variable)


def _count(axis):
    return str(sum(cluster.count for cluster in axis.clusters))
