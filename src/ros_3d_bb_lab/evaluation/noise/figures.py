"""Figures of the noise analysis, each drawn to a PNG file."""
import matplotlib
import numpy as np
from scipy import stats

matplotlib.use('Agg')  # works without a display
import matplotlib.pyplot as plt  # noqa: E402

SIZE_IN, DPI = (7.2, 4.2), 110
COLUMNS = 3
# Smallest RMS error of the depth of a plane: z² s / (f b), with the subpixel accuracy s and the baseline b of a D435
# (Intel's values, thesis 5.2). The curve is fitted from 1.5 m on, as in the thesis.
SUBPIXEL_PX, BASELINE_M, QUADRATIC_FROM_M = 0.08, 0.050, 1.5
MEASURED, FITTED = '#0072b2', '#d55e00'  # different for all colour vision


def sigmas(path, analysis):
    """Standard deviations of the model by range, and the remaining mean errors of the positions."""
    model, complete = analysis.model, analysis.inputs.z.complete()
    error_m = model.corrected(complete.measured_m)[:, [0, 2]] - complete.truth_m
    places_m, place = np.unique(complete.truth_m, axis=0, return_inverse=True)
    place = place.reshape(-1)
    range_m = np.linspace(model.measured_range.z_min_m, model.measured_range.z_max_m, 100)
    figure, axes = plt.subplots(figsize=SIZE_IN)
    for axis, name, spread, color, marker in ((0, 'X', model.x_sigma, FITTED, 's'),
                                              (1, 'Z', model.z_sigma, MEASURED, 'o')):
        axes.plot(range_m, spread.at(range_m), color=color, label='σ of %s, model' % name)
        rms_m = np.sqrt(np.bincount(place, error_m[:, axis] ** 2) / np.bincount(place))
        axes.plot(places_m[:, 1], rms_m, marker, color=color, alpha=0.6,
                  label='remaining RMS error in %s, positions' % name)
    axes.set_ylim(bottom=0)
    _finish(figure, axes, path, 'true Z [m]', 'error [m]')


def error_by_truth(path, axis, name):
    """Mean error by true value, with bars of one standard deviation, and the fitted polynomial."""
    truth_m = np.array([cluster.truth_m for cluster in axis.clusters])
    figure, axes = plt.subplots(figsize=SIZE_IN)
    axes.axhline(0, color='0.8', linewidth=1)
    axes.errorbar(truth_m, [cluster.mean_m for cluster in axis.clusters],
                  [cluster.sigma_m for cluster in axis.clusters], fmt='o', capsize=4, color=MEASURED,
                  label='mean ± one standard deviation')
    line_m = np.linspace(truth_m.min(), truth_m.max(), 100)
    axes.plot(line_m, np.polyval(axis.poly, line_m), color=FITTED,
              label='f(%s) = %s' % (name.lower(), axis.poly_text(name.lower())))
    _finish(figure, axes, path, 'true %s [m]' % name, '%s error [m]' % name)


def depth_rms(path, axis, camera):
    """RMS error of Z by true Z, and a quadratic curve, as Fig. 5.2 of the thesis; with the theoretical error of a D435
    unless the camera is None."""
    truth_m, rms_m = np.array([(cluster.truth_m, cluster.rms_m) for cluster in axis.clusters]).T
    line_m, far = np.linspace(truth_m.min(), truth_m.max(), 100), truth_m >= QUADRATIC_FROM_M
    figure, axes = plt.subplots(figsize=SIZE_IN)
    axes.plot(truth_m, rms_m, 'o', color=MEASURED, label='measured')
    if far.any():
        factor = (rms_m[far] * truth_m[far] ** 2).sum() / (truth_m[far] ** 4).sum()
        fitted_m = line_m[line_m >= QUADRATIC_FROM_M]
        axes.plot(fitted_m, factor * fitted_m ** 2, color=FITTED, label='fit: %.4f z²' % factor)
    if camera is not None:
        axes.plot(line_m, SUBPIXEL_PX / (camera.fx * BASELINE_M) * line_m ** 2, '--', color='0.3',
                  label='theory: plane before a D435 (%g pixels, %g mm)' % (SUBPIXEL_PX, 1000 * BASELINE_M))
    axes.set_ylim(bottom=0)
    _finish(figure, axes, path, 'true Z [m]', 'RMS of the Z error [m]')


def histograms(path, clusters, name):
    """Density of the errors of each cluster, with the fitted Gaussian."""
    rows = -(-len(clusters) // COLUMNS)
    figure, grid = plt.subplots(rows, COLUMNS, figsize=(9, 2.4 * rows), squeeze=False)
    for axes, cluster in zip(grid.ravel(), clusters):
        mean_m, sigma_m = cluster.mean_m, max(cluster.sigma_m, 1e-6)
        axes.hist(cluster.error_m, bins='sturges', density=True, color=MEASURED, alpha=0.6)
        line_m = mean_m + sigma_m * np.linspace(-3.5, 3.5, 100)
        axes.plot(line_m, stats.norm(mean_m, sigma_m).pdf(line_m), color=FITTED)
        axes.set_title('%s = %.2f m, n = %d' % (name, cluster.truth_m, cluster.count), fontsize=9)
        axes.tick_params(labelsize=8)
        axes.locator_params(axis='x', nbins=5)
    for axes in grid.ravel()[len(clusters):]:
        axes.set_visible(False)
    for axes in grid[:, 0]:
        axes.set_ylabel('density [1/m]', fontsize=8)
    for axes in grid.ravel()[max(0, len(clusters) - COLUMNS):len(clusters)]:
        axes.set_xlabel('%s error [m]' % name, fontsize=8)
    _save(figure, path)


def _finish(figure, axes, path, x_label, y_label):
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)
    axes.legend(fontsize=8)
    axes.grid(alpha=0.25)
    _save(figure, path)


def _save(figure, path):
    figure.tight_layout()
    figure.savefig(str(path), dpi=DPI)
    plt.close(figure)
