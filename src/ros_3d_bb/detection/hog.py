"""Whether a thing of human size is a person: OpenCV's HOG people detector in colour, and the shape in depth.

The detector that comes with OpenCV needs no weights of ours. Run over a whole image it is slow and sees people in
furniture; here depth says where and how large a person would be, so it looks at a few windows only.
"""
from typing import NamedTuple

import cv2
import numpy as np

WINDOW_PX = (64, 128)
PERSON_PX = 96  # height of the person in the detector's window
SHIFT_PX = 8  # the window is tried where depth says, and this far off to each side, above and below
SCALES = (0.88, 1.0, 1.13)
LOW_SCORE = -0.5  # what looks less like a person than this is all the same
BEST_HOG = 2.5  # rarely surpassed
STEREO_NOISE_PER_M = 0.0034  # depth noise is this * depth**2; Intel RealSense D435: 0.065 px at 19 px*m
# Logistic regression over 2269 things of human size in real and simulated rooms: constant, HOG, fill, relief, thickness
# in metres. Where the head lies above the image HOG says little, and shape counts for more.
WEIGHTS = np.array([6.9, 3.1, -13.5, 3.2, -8.3])
WEIGHTS_HEADLESS = np.array([5.3, 1.7, -13.5, 5.6, -10.4])


class Figure(NamedTuple):
    """Where a person would stand in the image: middle column, rows of the crown and of the soles, pixels."""

    middle: float
    crown: float
    soles: float


class PersonHog(object):
    """OpenCV's HOG people detector for given places.

    Raises
    ------
    ValueError
        If this OpenCV has no HOG detector.
    """

    def __init__(self):
        if not hasattr(cv2, 'HOGDescriptor'):
            raise ValueError('this OpenCV %s has no HOGDescriptor, which moved to the xobjdetect module of '
                             'opencv_contrib in OpenCV 5: install OpenCV 3.2 to 4.x (python3-opencv), or '
                             'opencv-contrib-python' % cv2.__version__)
        self._hog = cv2.HOGDescriptor(WINDOW_PX, (16, 16), (8, 8), (8, 8), 9)
        self._hog.setSVMDetector(cv2.HOGDescriptor_getDefaultPeopleDetector())

    def score(self, pyramid, figure):
        """Distance from the detector's margin, above 0 for a person, of the best of the windows around a figure.

        Parameters
        ----------
        pyramid : list of numpy.ndarray
            See `pyramid_of`.
        figure : Figure
        """
        scores = [LOW_SCORE]
        for scale in SCALES:
            patch = _patch(pyramid, figure, PERSON_PX / ((figure.soles - figure.crown) * scale))
            weights = self._hog.detect(patch, hitThreshold=LOW_SCORE, winStride=(SHIFT_PX, SHIFT_PX))[1]
            scores.extend(np.ravel(weights))
        return float(max(scores))


def evidence_of(mask, ahead_m, thickness_m):
    """What in depth tells a person from furniture of the same size: fill, relief and thickness, (3,).

    Furniture is upright and solid: it fills its rectangle (fill 1), and one column of the image shows it as far ahead
    at all heights but for noise (relief 1). What is looser than a person (a shelf, rags of a far wall) gains
    nothing by it.

    Parameters
    ----------
    mask : numpy.ndarray, (rows, columns), bool
        The thing in its rectangle.
    ahead_m : numpy.ndarray, (rows, columns)
        Distance of the surface, along the floor.
    thickness_m : float
        Along the line of sight.
    """
    columns = mask.sum(axis=0) >= max(4, mask.shape[0] // 4)
    relief_m = 0.0
    if columns.any():
        rows = np.arange(mask.shape[0], dtype=float)[:, None]
        rise_m, rows = (values - np.nanmedian(values, axis=0)
                        for values in (np.where(mask, values, np.nan)[:, columns] for values in (ahead_m, rows)))
        lean = np.nansum(rise_m * rows) / max(np.nansum(rows ** 2), 1)  # of a wall seen by a tilted camera
        relief_m = np.nanpercentile(np.abs(rise_m - lean * rows), 80)
    noise_m = 0.01 + STEREO_NOISE_PER_M * np.median(ahead_m[mask]) ** 2
    return np.array([max(mask.mean(), 0.5), np.clip(relief_m / noise_m, 0.8, 2.0), thickness_m])


def person_score(evidence, hog, headless):
    """How sure it is that a thing is a person, 0..1, of its evidence in depth and its score in HOG.

    Parameters
    ----------
    headless : bool
        The image ends below its top.
    """
    weights = WEIGHTS_HEADLESS if headless else WEIGHTS
    return float(1 / (1 + np.exp(-weights.dot(np.hstack((1, hog, evidence))))))


def pyramid_of(image):
    """The image (height, width, 3), and it at a half, a quarter, ... of its size."""
    pyramid = [np.ascontiguousarray(image)]
    while min(pyramid[-1].shape[:2]) > 64:
        pyramid.append(cv2.resize(pyramid[-1], None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA))
    return pyramid


def _patch(pyramid, figure, scale):
    """The window around a figure and SHIFT_PX more on each side, `scale` times the size it has in the image.

    What lies outside the image repeats its border, as it would look to a detector trained on whole people.
    """
    level = int(np.clip(np.floor(-np.log2(scale)), 0, len(pyramid) - 1))
    size = tuple(side + 2 * SHIFT_PX for side in WINDOW_PX)
    scale *= 2 ** level
    middle = (np.array([figure.middle, (figure.crown + figure.soles) / 2]) + 0.5) / 2 ** level - 0.5
    shift = np.array(size) / 2.0 - scale * middle
    transform = np.array([[scale, 0, shift[0]], [0, scale, shift[1]]])
    return cv2.warpAffine(pyramid[level], transform, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
