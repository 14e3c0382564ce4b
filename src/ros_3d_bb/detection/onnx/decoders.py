"""Decoders: from the outputs of a network to Detections in pixels of its input.

A decoder is called with the outputs, the (height, width) of the input, the number of classes, a confidence and the
strides of the grid. It returns the Detections whose score is above the confidence, in any order, with the best class of
each prediction. Predictions of a grid are ordered by stride (pixels per cell), row and column.
"""
import functools

import numpy as np

from ros_3d_bb.detection.boxes import Detections


def decode_rows(outputs, _input_hw, classes, confidence, _strides=()):
    """YOLOv5, YOLOv7 and decoded YOLOX: rows of x, y, width, height, objectness, class scores; (1, n, 5 + classes)."""
    rows = outputs[0][0]
    rows = rows[rows[:, 4] > confidence]
    above, best, scores = _best(rows[:, 5:5 + classes] * rows[:, 4:5], confidence)
    return Detections(_corners(rows[above, :4]), scores, best)


def decode_yolox(outputs, input_hw, classes, confidence, strides):
    """YOLOX before decoding: as `decode_rows`, with offsets from cells, and the logarithm of width and height."""
    rows, cells = outputs[0][0], grid(input_hw, strides)
    above = rows[:, 4] > confidence
    rows, cells = rows[above].astype(np.float32, copy=True), cells[above]
    rows[:, :2] = (rows[:, :2] + cells[:, :2]) * cells[:, 2:]
    with np.errstate(over='ignore'):  # infinite boxes are dropped
        rows[:, 2:4] = np.exp(rows[:, 2:4]) * cells[:, 2:]
    return decode_rows([rows[None]], input_hw, classes, confidence)


def decode_columns(outputs, _input_hw, classes, confidence, _strides=()):
    """YOLOv8, 11 and 26: columns of x, y, width, height, class scores and, for tasks such as segmentation, more;
    (1, 4 + classes + ..., n).
    """
    rows = outputs[0][0].T
    above, best, scores = _best(rows[:, 4:4 + classes], confidence)
    return Detections(_corners(rows[above, :4]), scores, best)


def decode_final(outputs, _input_hw, _classes, confidence, _strides=()):
    """Networks that include the suppression: rows of x1, y1, x2, y2, score, class number; (1, n, 6 + ...)."""
    rows = outputs[0][0]
    rows = rows[rows[:, 4] > confidence]
    return Detections(rows[:, :4], rows[:, 4], rows[:, 5].astype(int))


@functools.lru_cache(maxsize=8)
def grid(input_hw, strides):
    """Column, row and stride of the cells of an input (height, width), as an array (n, 3)."""
    levels = []
    for stride in strides:
        rows, columns = np.indices([-(-size // stride) for size in input_hw])
        levels.append(np.stack((columns, rows, np.full_like(rows, stride)), axis=-1).reshape(-1, 3))
    return np.concatenate(levels).astype(np.float32)


def cell_count(input_hw, strides):
    return sum(-(-input_hw[0] // stride) * -(-input_hw[1] // stride) for stride in strides)


def is_probability(scores):
    return not scores.size or (scores.min() >= 0 and scores.max() <= 1)


def _best(scores, confidence):
    """Indices of the predictions with a score (n, classes) above the confidence, their best classes and scores."""
    best_scores = scores.max(axis=1)
    above = np.flatnonzero(best_scores > confidence)
    return above, scores[above].argmax(axis=1), best_scores[above]


def _corners(boxes):
    center, half = boxes[:, :2], boxes[:, 2:] / 2
    return np.hstack((center - half, center + half))
