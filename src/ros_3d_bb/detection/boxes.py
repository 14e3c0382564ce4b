"""2D boxes: what a detector finds, how much two overlap, and which of those that do are one object.

Convention: boxes are (x1, y1, x2, y2) in pixels, x to the right, y down, x2 and y2 exclusive.
"""
from typing import NamedTuple

import numpy as np


class Detections(NamedTuple):
    """Boxes (n, 4) float pixels, scores (n,) 0..1 and class numbers (n,), best first."""

    boxes: np.ndarray
    scores: np.ndarray
    classes: np.ndarray


def suppressed(detections, iou_limit, max_det):
    """Non-maximum suppression: of boxes of one class that overlap by more than `iou_limit`, the best stays.

    Parameters
    ----------
    detections : Detections
        Best first.
    """
    boxes, kept = detections.boxes, []
    alive = np.ones(len(boxes), bool)
    while alive.any() and len(kept) < max_det:
        best = int(alive.argmax())
        kept.append(best)
        rivals = alive & (detections.classes == detections.classes[best])
        rivals[rivals] = iou(boxes[best], boxes[rivals]) > iou_limit
        alive &= ~rivals
        alive[best] = False
    return Detections(*(column[kept] for column in detections))


def iou(box, boxes):
    """Intersection over union of one box (4,) with each of boxes (n, 4); 0 where both are empty."""
    box, boxes = np.asarray(box, float), np.asarray(boxes, float).reshape(-1, 4)
    overlap = np.minimum(box[2:], boxes[:, 2:]) - np.maximum(box[:2], boxes[:, :2])
    intersection = np.clip(overlap, 0, None).prod(axis=1)
    union = (box[2:] - box[:2]).prod() + (boxes[:, 2:] - boxes[:, :2]).prod(axis=1) - intersection
    return np.divide(intersection, union, out=np.zeros_like(intersection), where=union > 0)
