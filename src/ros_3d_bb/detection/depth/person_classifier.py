"""Classify clusters of human size by OpenCV's HOG people detector in colour and by their shape in depth.

The HOG detector comes with OpenCV and needs no weights. On whole images it is slow and detects people in furniture.
Here depth gives the position and size of a possible person, so that only a few windows are evaluated.
"""
from typing import NamedTuple

import cv2
import numpy as np

from ros_3d_bb.detection.depth.person_clusters import max_step, quantile_of
from ros_3d_bb.detection.depth.walls import STEREO_NOISE_PER_M

WINDOW_PX = (64, 128)
PERSON_PX = 96  # height of the person in the detector's window
SHIFT_PX = 8  # the window is also evaluated this far to each side, above and below
SCALES = (1.0, 0.88, 1.13)  # in the order of evaluation
LOW_SCORE = -0.5  # lower HOG scores are clipped to this
BEST_HOG = 2.5  # HOG scores rarely exceed this
BESIDE = 2  # cells beyond an outline; the next one may be mixed of both surfaces
HEAD_M = 0.18  # usual width of a head, from the front or the side
HEAD_BELOW_M, SHOULDERS_BELOW_M = (0.03, 0.2), (0.28, 0.6)  # below the crown
# Logistic regression over 928 clusters of human size in the frames of the thesis and in 456 simulated images of random
# rooms with furniture, things on tables and people near walls, each also with the lowest HOG score, as in the dark.
# Weights of: constant, HOG, and the features of `shape_features_of`. If the head is above the image, the last
# two do not apply.
WEIGHTS = np.array([9.7, 3.0, -4.9, 1.3, -6.9, -5.0, -4.6, -3.6])
WEIGHTS_HEADLESS = np.array([3.0, 3.0, -4.8, 3.0, -8.2, -4.4])


class PersonWindow(NamedTuple):
    """Image region of a possible person: middle column, rows of the crown and of the soles, in pixels."""

    middle: float
    crown: float
    soles: float


class PersonHog(object):
    """OpenCV's HOG people detector at known positions. ValueError if this OpenCV has none."""

    def __init__(self):
        if not hasattr(cv2, 'HOGDescriptor'):
            raise ValueError('OpenCV %s has no HOGDescriptor, which moved to the xobjdetect module of opencv_contrib '
                             'in OpenCV 5; install OpenCV 3.2 to 4.x (python3-opencv) or opencv-contrib-python'
                             % cv2.__version__)
        self._hog = cv2.HOGDescriptor(WINDOW_PX, (16, 16), (8, 8), (8, 8), 9)
        self._hog.setSVMDetector(cv2.HOGDescriptor_getDefaultPeopleDetector())

    def scores(self, pyramid, window):
        """Yield the best SVM score near a PersonWindow after each of `SCALES`: positive for a person, at least
        LOW_SCORE.
        """
        best = LOW_SCORE
        for scale in SCALES:
            patch = _patch(pyramid, window, PERSON_PX / ((window.soles - window.crown) * scale))
            weights = self._hog.detect(patch, hitThreshold=LOW_SCORE, winStride=(SHIFT_PX, SHIFT_PX))[1]
            best = max([best] + np.ravel(weights).tolist())
            yield best


def shape_features_of(blob, shape, grid):
    """Features that distinguish people from furniture of the same size.

    Furniture is upright and solid: it fills its rectangle (fill 1), and within an image column its distance varies by
    noise only (relief 1). Fill is at least 0.5, so that structures sparser than a person (a shelf, fragments of a far
    wall) do not score higher than a person. A head has the width of a head, and is narrower than the shoulders.

    Returns fill, relief, thickness in metres, share of the outline beyond which the surface continues, deviation of the
    head from its usual width (0 to 1), and width of the head relative to the shoulders, (6,).
    """
    mask, ahead_m = blob.mask, blob.window(grid.ahead_m)
    columns = mask.sum(axis=0) >= max(4, mask.shape[0] // 4)
    relief_m = 0.0
    if columns.any():
        cells = mask[:, columns]
        rise_m = _above_column_medians(ahead_m[:, columns], cells)
        rows = _above_column_medians(np.arange(len(mask), dtype=float)[:, None], cells)
        slope = rise_m.dot(rows) / max(rows.dot(rows), 1)  # of a wall in the image of a tilted camera
        relief_m = quantile_of(np.abs(rise_m - slope * rows), 0.8)
    noise_m = 0.01 + STEREO_NOISE_PER_M * quantile_of(ahead_m[mask], 0.5) ** 2
    head_m, shoulders_m = _head_and_shoulders_m(mask, shape)
    return np.array([max(mask.mean(), 0.5), min(max(relief_m / noise_m, 0.8), 2.0), shape.thickness_m,
                     _continued_share(blob, grid), min(abs(np.log(head_m / HEAD_M)), 1.0),
                     min(head_m / shoulders_m, 1.2)])


def _continued_share(blob, grid):
    """Share of the left and right outline of a blob beyond which the surface continues, at the same depth."""
    rows = np.flatnonzero(blob.mask.any(axis=1))
    cells, last = blob.mask[rows], grid.depth_m.shape[1] - 1
    left, right = blob.column + cells.argmax(axis=1), blob.column + cells.shape[1] - 1 - cells[:, ::-1].argmax(axis=1)
    rows += blob.row
    continued = 0.0
    for edge, beyond in ((left, left - BESIDE), (right, right + BESIDE)):
        depth_m, other_m = grid.depth_m[rows, edge], grid.depth_m[rows, beyond.clip(0, last)]
        is_same = (other_m > 0) & (np.abs(other_m - depth_m) < max_step(depth_m))
        continued += np.mean(is_same & (beyond >= 0) & (beyond <= last)) / 2
    return continued


def _head_and_shoulders_m(mask, shape):
    """Width of a blob where the head and where the shoulders of a person are; at least one cell."""
    widths_m = mask.sum(axis=1) * shape.cell_m
    below_m = np.linspace(0, shape.top_m - shape.bottom_m, len(mask))
    head, shoulders = (widths_m[(below_m > high) & (below_m < low)] for high, low in (HEAD_BELOW_M, SHOULDERS_BELOW_M))
    return (max(quantile_of(head, 0.5) if len(head) else 0, shape.cell_m),
            max(quantile_of(shoulders, 0.8) if len(shoulders) else 0, shape.cell_m))


def _above_column_medians(values, mask):
    """Values (k,) in the cells of a mask, less the median of those in the same column; each column has some.

    np.nanmedian gives the same medians in twenty times the time.
    """
    ordered = np.sort(np.where(mask, values, np.inf), axis=0)
    count, columns = mask.sum(axis=0), np.arange(mask.shape[1])
    medians = (ordered[(count - 1) // 2, columns] + ordered[count // 2, columns]) / 2
    return (values - medians)[mask]


def person_score(features, hog, headless):
    """Probability that a cluster is a person, from `shape_features_of` and `PersonHog.scores`.

    `headless`: the top of the cluster is cut by the image border.
    """
    weights = WEIGHTS_HEADLESS if headless else WEIGHTS
    return float(1 / (1 + np.exp(-weights.dot(np.hstack((1, hog, features[:len(weights) - 2]))))))


class Pyramid(object):
    """An image (height, width, 3), and its copies at 1/2, 1/4, ... of its size, which are made when they are used."""

    def __init__(self, image):
        self._levels = [np.ascontiguousarray(image)]

    def level(self, number):
        """Number of the smallest copy up to that number, and the copy."""
        while len(self._levels) <= number and min(self._levels[-1].shape[:2]) > 64:
            self._levels.append(cv2.resize(self._levels[-1], None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA))
        number = min(number, len(self._levels) - 1)
        return number, self._levels[number]


def _patch(pyramid, window, scale):
    """Cut out a window with SHIFT_PX more on each side, scaled by `scale`.

    Pixels outside the image replicate its border, because the detector is trained on windows without a border.
    """
    level, image = pyramid.level(max(int(np.floor(-np.log2(scale))), 0))
    size = tuple(side + 2 * SHIFT_PX for side in WINDOW_PX)
    scale *= 2 ** level
    middle = (np.array([window.middle, (window.crown + window.soles) / 2]) + 0.5) / 2 ** level - 0.5
    shift = np.array(size) / 2.0 - scale * middle
    transform = np.array([[scale, 0, shift[0]], [0, scale, shift[1]]])
    return cv2.warpAffine(image, transform, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
