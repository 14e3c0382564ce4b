"""Classify clusters of human size by OpenCV's HOG people detector in colour and by their shape in depth.

The HOG detector comes with OpenCV and needs no weights. On whole images it is slow and detects people in furniture.
Here depth gives the position and size of a possible person, so that only a few windows are evaluated.
"""
from typing import NamedTuple

import cv2
import numpy as np

from ros_3d_bb.detection.depth.person_clusters import quantile_of

WINDOW_PX = (64, 128)
PERSON_PX = 96  # height of the person in the detector's window
SHIFT_PX = 8  # the window is also evaluated this far to each side, above and below
SCALES = (1.0, 0.88, 1.13)  # in the order of evaluation
LOW_SCORE = -0.5  # lower HOG scores are clipped to this
BEST_HOG = 2.5  # HOG scores rarely exceed this
STEREO_NOISE_PER_M = 0.0034  # depth noise is this * depth**2; Intel RealSense D435: 0.065 px at 19 px*m
# Logistic regression over 2269 clusters of human size in real and simulated rooms. Weights of: constant, HOG, fill,
# relief, thickness in metres. If the head is above the image, HOG is less informative and shape has more weight.
WEIGHTS = np.array([6.9, 3.1, -13.5, 3.2, -8.3])
WEIGHTS_HEADLESS = np.array([5.3, 1.7, -13.5, 5.6, -10.4])


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
        LOW_SCORE. See `pyramid_of`.
        """
        best = LOW_SCORE
        for scale in SCALES:
            patch = _patch(pyramid, window, PERSON_PX / ((window.soles - window.crown) * scale))
            weights = self._hog.detect(patch, hitThreshold=LOW_SCORE, winStride=(SHIFT_PX, SHIFT_PX))[1]
            best = max([best] + np.ravel(weights).tolist())
            yield best


def shape_features_of(mask, ahead_m, thickness_m):
    """Features that distinguish people from furniture of the same size.

    Furniture is upright and solid: it fills its rectangle (fill 1), and within an image column its distance varies by
    noise only (relief 1). Fill is at least 0.5, so that structures sparser than a person (a shelf, fragments of a far
    wall) do not score higher than a person.

    `mask` are the cells of the cluster in its rectangle, `ahead_m` the distance of the surface along the floor there,
    and `thickness_m` the extent along the line of sight. Returns fill, relief, and thickness in metres, (3,).
    """
    columns = mask.sum(axis=0) >= max(4, mask.shape[0] // 4)
    relief_m = 0.0
    if columns.any():
        cells = mask[:, columns]
        rise_m = _above_column_medians(ahead_m[:, columns], cells)
        rows = _above_column_medians(np.arange(len(mask), dtype=float)[:, None], cells)
        slope = rise_m.dot(rows) / max(rows.dot(rows), 1)  # of a wall in the image of a tilted camera
        relief_m = quantile_of(np.abs(rise_m - slope * rows), 0.8)
    noise_m = 0.01 + STEREO_NOISE_PER_M * quantile_of(ahead_m[mask], 0.5) ** 2
    return np.array([max(mask.mean(), 0.5), min(max(relief_m / noise_m, 0.8), 2.0), thickness_m])


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
    return float(1 / (1 + np.exp(-weights.dot(np.hstack((1, hog, features))))))


def pyramid_of(image):
    """Image pyramid: the image (height, width, 3), and its copies at 1/2, 1/4, ... of its size."""
    pyramid = [np.ascontiguousarray(image)]
    while min(pyramid[-1].shape[:2]) > 64:
        pyramid.append(cv2.resize(pyramid[-1], None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA))
    return pyramid


def _patch(pyramid, window, scale):
    """Cut out a window with SHIFT_PX more on each side, scaled by `scale`.

    Pixels outside the image replicate its border, because the detector is trained on windows without a border.
    """
    level = int(np.clip(np.floor(-np.log2(scale)), 0, len(pyramid) - 1))
    size = tuple(side + 2 * SHIFT_PX for side in WINDOW_PX)
    scale *= 2 ** level
    middle = (np.array([window.middle, (window.crown + window.soles) / 2]) + 0.5) / 2 ** level - 0.5
    shift = np.array(size) / 2.0 - scale * middle
    transform = np.array([[scale, 0, shift[0]], [0, scale, shift[1]]])
    return cv2.warpAffine(pyramid[level], transform, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
