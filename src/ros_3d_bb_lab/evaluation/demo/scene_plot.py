"""Image of a tracked scene: camera images with detections, and a top view of the paths."""
import matplotlib
matplotlib.use('Agg')
from matplotlib import gridspec, pyplot  # noqa: E402 (the backend must be selected first)

COLUMNS = 3
SIZE_IN, LINE_IN, DPI = (14.56, 14.5), 0.17, 100
TRUTH_COLOR, ROBOT_COLOR = '#aaaaaa', '#141414'


def draw_scene(path, panels, people, tracks, robot, lines):
    """Write the image of a scene; the suffix of its path selects the format.

    Parameters
    ----------
    path : str
    panels : list of numpy.ndarray
        Images (h, w, 3), uint8, RGB; three in a row.
    people, tracks : dict
        Paths (n, 2) in the map, metres, by ground-truth ID and by track ID.
    robot : numpy.ndarray, (n, 2)
        Path of the robot.
    lines : list of str
        Text below the images.
    """
    rows = (len(panels) + COLUMNS - 1) // COLUMNS
    text_share = LINE_IN * (len(lines) + 3) / SIZE_IN[1]  # with the labels of the axis
    grid = gridspec.GridSpec(rows + 1, COLUMNS, height_ratios=[1] * rows + [1.8], left=0.03, right=0.99, top=0.99,
                             bottom=text_share, wspace=0.02, hspace=0.08)
    figure = pyplot.figure(figsize=SIZE_IN, dpi=DPI)
    for number, panel in enumerate(panels):
        axes = figure.add_subplot(grid[divmod(number, COLUMNS)])
        axes.imshow(panel)
        axes.set_axis_off()
    _draw_paths(figure.add_subplot(grid[rows, :]), people, tracks, robot)
    figure.text(0.03, 0.01, '\n'.join(lines), family='monospace')
    figure.savefig(path, dpi=DPI)
    pyplot.close(figure)


def _draw_paths(axes, people, tracks, robot):
    for number, path in sorted(people.items()):
        axes.plot(*zip(*path), color=TRUTH_COLOR, linewidth=6)
        axes.annotate('person %d' % number, path[-1])
    for number, path in sorted(tracks.items()):
        line, = axes.plot(*zip(*path))
        axes.annotate(str(number), path[0], color=line.get_color(), weight='bold')
    axes.plot(robot[:, 0], robot[:, 1], color=ROBOT_COLOR, marker='o', markevery=[-1] if len(robot) else [])
    axes.set_aspect('equal', 'datalim')
    axes.grid(True)
    axes.set(title='map in metres: true paths (grey), tracks with their IDs (colour), robot (black)')
