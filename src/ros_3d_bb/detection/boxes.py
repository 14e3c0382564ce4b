"""2D boxes: the output of detectors, intersection over union, and non-maximum suppression.

Convention: boxes are (x1, y1, x2, y2) in pixels, x to the right, y down, x2 and y2 exclusive.
"""
from typing import List, NamedTuple

import numpy as np


class Detections(NamedTuple):
    """Boxes (n, 4) in float pixels, scores (n,) in 0..1 and class numbers (n,), in order of decreasing score."""

    boxes: np.ndarray
    scores: np.ndarray
    classes: np.ndarray


def non_maximum_suppression(detections: Detections, iou_limit: float, max_det: int) -> Detections:
    """Remove the Detections that overlap one of the same class and a higher score by more than `iou_limit`, and those
    after the first `max_det`.
    """
    boxes = detections.boxes
    kept: List[int] = []
    remaining = np.ones(len(boxes), bool)
    while remaining.any() and len(kept) < max_det:
        best = int(remaining.argmax())
        kept.append(best)
        overlapping = remaining & (detections.classes == detections.classes[best])
        overlapping[overlapping] = iou(boxes[best], boxes[overlapping]) > iou_limit
        remaining &= ~overlapping
        remaining[best] = False
    return Detections(*(column[kept] for column in detections))


def iou(box: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """Intersection over union of a box (4,) with each of boxes (n, 4); 0 if both are empty."""
    box, boxes = np.asarray(box, float), np.asarray(boxes, float).reshape(-1, 4)
    overlap = np.minimum(box[2:], boxes[:, 2:]) - np.maximum(box[:2], boxes[:, :2])
    intersection = np.clip(overlap, 0, None).prod(axis=1)
    union = (box[2:] - box[:2]).prod() + (boxes[:, 2:] - boxes[:, :2]).prod(axis=1) - intersection
    return np.divide(intersection, union, out=np.zeros_like(intersection), where=union > 0)
