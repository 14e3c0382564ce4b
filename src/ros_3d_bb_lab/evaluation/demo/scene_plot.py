"""Image of a tracked scene: camera images with detections, and a top view of the paths."""
from typing import NamedTuple

import cv2
import numpy as np

PANEL_WIDTH_PX, GAP_PX = 480, 8
TOP_VIEW_SIZE_PX, MARGIN_M = (1456, 620), 0.6
PAPER, GRID, INK = (255, 255, 255), (228, 228, 228), (60, 60, 60)
TRUTH_COLOR, ROBOT_COLOR = (170, 170, 170), (20, 20, 20)
TRACK_COLORS = ((31, 119, 180), (255, 127, 14), (44, 160, 44), (214, 39, 40), (148, 103, 189), (140, 86, 75),
                (227, 119, 194), (188, 189, 34), (23, 190, 207))
FONT = cv2.FONT_HERSHEY_SIMPLEX


class Paths(NamedTuple):
    """Paths in the map from above, (n, 2) each, metres.

    `people` by ground-truth ID, `tracks` by track ID, and `robot`.
    """

    people: dict
    tracks: dict
    robot: np.ndarray


def scene_picture(panels, paths, lines):
    """Compose the report.

    Parameters
    ----------
    panels : list of numpy.ndarray
        Images (h, w, 3), uint8, RGB; three in a row.
    paths : Paths
    lines : list of str
        Text below the images.

    Returns
    -------
    numpy.ndarray, (height, width, 3), uint8
        RGB.
    """
    rows = [_row(panels[first:first + 3]) for first in range(0, len(panels), 3)]
    rows += [top_view(paths), _text(lines)]
    return np.concatenate([np.pad(row, ((0, GAP_PX), (0, 0), (0, 0)), 'constant', constant_values=255)
                           for row in rows])


def top_view(paths):
    """Top view of the map, x to the right and y up, with a grid of 1 m: ground truth in grey, tracks in colour."""
    points = [np.reshape(path, (-1, 2)) for path in list(paths.people.values()) + list(paths.tracks.values())
              + [paths.robot]]
    points = np.concatenate(points + [np.zeros((1, 2))])
    low, high = points.min(axis=0) - MARGIN_M, points.max(axis=0) + MARGIN_M
    width, height = TOP_VIEW_SIZE_PX
    ppm = min(width / (high[0] - low[0]), height / (high[1] - low[1]))

    def pixels(path):
        xy = (np.reshape(path, (-1, 2)) - (low + high) / 2) * ppm
        return np.rint(xy * [1, -1] + [width / 2, height / 2]).astype(np.int32)

    image = np.full((height, width, 3), PAPER, np.uint8)
    _draw_grid(image, pixels, low, high)
    for number, path in sorted(paths.people.items()):
        corners = pixels(path)
        cv2.polylines(image, [corners], False, TRUTH_COLOR, 7, cv2.LINE_AA)
        cv2.putText(image, 'person %d' % number, tuple((corners[-1] + [8, 18]).tolist()), FONT, 0.5, INK, 1,
                    cv2.LINE_AA)
    for number, path in sorted(paths.tracks.items()):
        color = TRACK_COLORS[number % len(TRACK_COLORS)]
        corners = pixels(path)
        cv2.polylines(image, [corners], False, color, 2, cv2.LINE_AA)
        cv2.putText(image, str(number), tuple((corners[0] + [6, -6]).tolist()), FONT, 0.7, color, 2, cv2.LINE_AA)
    _draw_robot(image, pixels(paths.robot))
    cv2.putText(image, 'from above, 1 m grid; grey: true paths; colour: tracks with their numbers', (10, height - 10),
                FONT, 0.5, INK, 1, cv2.LINE_AA)
    return image


def _draw_grid(image, pixels, low, high):
    for x in range(int(np.ceil(low[0])), int(high[0]) + 1):
        column = int(pixels([x, 0])[0, 0])
        cv2.line(image, (column, 0), (column, image.shape[0]), GRID, 1)
    for y in range(int(np.ceil(low[1])), int(high[1]) + 1):
        row = int(pixels([0, y])[0, 1])
        cv2.line(image, (0, row), (image.shape[1], row), GRID, 1)


def _draw_robot(image, corners):
    if len(corners):
        cv2.polylines(image, [corners], False, ROBOT_COLOR, 2, cv2.LINE_AA)
        cv2.circle(image, tuple(corners[-1].tolist()), 7, ROBOT_COLOR, cv2.FILLED)
        cv2.putText(image, 'robot', tuple((corners[0] + [-20, 22]).tolist()), FONT, 0.5, ROBOT_COLOR, 1, cv2.LINE_AA)


def _row(panels):
    scaled = [cv2.resize(panel, (PANEL_WIDTH_PX, panel.shape[0] * PANEL_WIDTH_PX // panel.shape[1]),
                         interpolation=cv2.INTER_AREA) for panel in panels]
    row = np.full((max(panel.shape[0] for panel in scaled), TOP_VIEW_SIZE_PX[0], 3), PAPER, np.uint8)
    for number, panel in enumerate(scaled):
        left = number * (PANEL_WIDTH_PX + GAP_PX)
        row[:panel.shape[0], left:left + PANEL_WIDTH_PX] = panel
    return row


def _text(lines):
    image = np.full((22 * len(lines) + 16, TOP_VIEW_SIZE_PX[0], 3), PAPER, np.uint8)
    for number, line in enumerate(lines):
        for column, word in _words(line):
            cv2.putText(image, word, (12 + 11 * column, 22 * (number + 1)), FONT, 0.5, INK, 1, cv2.LINE_AA)
    return image


def _words(line):
    """Yield (column, word), which keeps tables aligned, because OpenCV's fonts are not monospaced."""
    column = 0
    for word in line.split(' '):
        if word:
            yield column, word
        column += len(word) + 1
