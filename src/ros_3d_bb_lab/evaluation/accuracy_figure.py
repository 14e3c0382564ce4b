"""Figure of the accuracy in a session: positions with their 95 % ellipses from above, and errors by range."""
import matplotlib
import numpy as np

matplotlib.use('Agg')
from matplotlib import patches, pyplot  # noqa: E402 (the backend must be selected first)

RADIUS_95 = np.sqrt(5.991)  # of the 95 % ellipse of a 2D Gaussian, in standard deviations
RANGE_STEP_M = 0.5
MEASURED, EXPECTED, TRUE = '#d55e00', '#0072b2', '0.3'


def draw(path, truth_m, position_m, covariances):
    """Write the figure of corrected positions (n, 3) with their covariances (n, 3, 3) and the truth (n, 2), X and Z.

    Rows with NaN have no estimate. The suffix of the file selects its format.
    """
    seen = np.isfinite(position_m[:, 0])
    truth_m, measured_m = truth_m[seen], position_m[seen][:, [0, 2]]
    plane = covariances[seen][:, [[0], [2]], [0, 2]]
    figure, (above, by_range) = pyplot.subplots(1, 2, figsize=(11, 5.2))
    _draw_positions(above, truth_m, measured_m, plane)
    draw_errors(by_range, truth_m, measured_m, plane)
    figure.tight_layout()
    figure.savefig(str(path), dpi=100)
    pyplot.close(figure)


def _draw_positions(axes, truth_m, measured_m, covariances):
    for place_m in np.unique(truth_m, axis=0):
        here = (truth_m == place_m).all(axis=1)
        variances, directions = np.linalg.eigh(covariances[here].mean(axis=0))
        width, height = 2 * RADIUS_95 * np.sqrt(variances)
        angle = np.degrees(np.arctan2(directions[1, 0], directions[0, 0]))
        axes.add_patch(patches.Ellipse(place_m, width, height, angle=angle, facecolor=EXPECTED, alpha=0.3))
    axes.plot(*truth_m.T, 'x', color=TRUE, markersize=5, label='true position')
    axes.plot(*measured_m.T, '.', color=MEASURED, markersize=4, label='corrected measurement')
    axes.plot([], [], 'o', color=EXPECTED, alpha=0.3, label='95 % ellipse')
    axes.plot(0, 0, '^', color=TRUE, markersize=10, label='camera')
    axes.set_aspect('equal', 'datalim')
    axes.set(xlabel='X [m]', ylabel='Z [m]', title='from above')
    axes.legend(fontsize=8, loc='lower right')
    axes.grid(alpha=0.25)


def draw_errors(axes, truth_m, measured_m, covariances):
    """Root mean squares of the errors in the plane by range, beside those that the covariances predict."""
    numbers = np.floor(np.hypot(*truth_m.T) / RANGE_STEP_M).astype(int)
    ranges = np.unique(numbers)
    squares_m2 = np.sum((measured_m - truth_m) ** 2, axis=1)
    for values_m2, color, shift, label in ((squares_m2, MEASURED, -0.2, 'measured'),
                                           (np.trace(covariances, axis1=1, axis2=2), EXPECTED, 0.2, 'predicted')):
        rms_m = [np.sqrt(values_m2[numbers == number].mean()) for number in ranges]
        axes.bar(np.arange(len(ranges)) + shift, rms_m, 0.4, color=color, label=label)
    axes.set_xticks(np.arange(len(ranges)))
    axes.set_xticklabels([
        '%.1f–%.1f m\nn=%d' % (RANGE_STEP_M * number, RANGE_STEP_M * (number + 1), np.count_nonzero(numbers == number))
        for number in ranges], fontsize=8)
    axes.set(xlabel='distance from the camera, number of measurements', ylabel='error in the plane, RMS [m]',
             title='by range')
    axes.legend(fontsize=8)
    axes.grid(alpha=0.25, axis='y')
