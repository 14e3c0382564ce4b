"""Plot of the results of `./run bench speed`, as in Fig. 4.2 of the thesis."""
import matplotlib
matplotlib.use('Agg')
from matplotlib import pyplot  # noqa: E402 (the backend must be selected first)
import numpy as np  # noqa: E402

TITLES = (('ours', 'this package'), ('thesis', "the thesis' algorithms"))
CURVES = (('both', 'both', 'tab:green'), ('estimation', '3D boxes', 'tab:blue'),
          ('tracking', 'tracking and prediction', 'tab:orange'))


def draw_speed(result, path):
    """Plot the mean and the standard deviation of the CPU time by the number of people.

    Parameters
    ----------
    result : dict
        Result of `speed.speed`.
    path : str
        Image file; its suffix selects the format.
    """
    figure, panels = pyplot.subplots(1, 2, sharey=True, figsize=(9, 4))
    for panel, (name, title) in zip(panels, TITLES):
        for stage, label, color in CURVES:
            mean_ms, sd_ms = (np.array(result[name][stage + suffix]) for suffix in ('_mean_ms', '_sd_ms'))
            panel.plot(result['objects'], mean_ms, 'o-', markersize=3, color=color, label=label)
            low_ms = np.maximum(mean_ms - sd_ms, mean_ms / 10)  # positive, for the logarithmic axis
            panel.fill_between(result['objects'], low_ms, mean_ms + sd_ms, color=color, alpha=0.2, linewidth=0)
        panel.set(title=title, xlabel='people', xscale='log', yscale='log')
        panel.set_xticks(result['objects'])
        panel.set_xticklabels(result['objects'])
        panel.minorticks_off()
        panel.yaxis.set_major_formatter(pyplot.FuncFormatter(lambda time_ms, _number: '%g' % time_ms))
        panel.grid(True, alpha=0.3)
    panels[0].set_ylabel('CPU time of an image, ms')
    panels[0].legend(loc='upper left')
    figure.text(0.5, 0.01, result['machine'], ha='center', fontsize=7, color='gray')
    figure.tight_layout(rect=(0, 0.03, 1, 1))
    figure.savefig(path, dpi=120)
    pyplot.close(figure)
