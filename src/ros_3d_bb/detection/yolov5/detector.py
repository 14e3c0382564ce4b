"""YOLOv5 detector: letterbox, network, decoding, non-maximum suppression.

Convention: boxes are (x1, y1, x2, y2) in pixels of the image, x to the right, y down, x2 and y2 exclusive.
"""
from typing import NamedTuple

import cv2
import numpy as np

from ros_3d_bb.core.params import LARGEST, Param, parameters
from ros_3d_bb.detection.boxes import Detections, non_maximum_suppression

GREY = (114, 114, 114)  # padding colour of letterboxed images in the training of YOLOv5
MAX_INPUT_PX = 4096  # larger inputs exhaust the memory
MAX_CANDIDATES = 5000  # maximum number of boxes before suppression; a useful confidence gives fewer


@parameters()
class DetectionParams(NamedTuple):
    """What counts as a detection."""

    classes: list = Param(('person',), 'Classes to detect: names or numbers of the model.', live=True)
    confidence: float = Param(
        0.25, 'Smallest score (objectness times class score) of a detection.', limits=(0, 1), live=(0, 1))
    iou: float = Param(
        0.45, 'Two boxes of a class that overlap by more than this (intersection over union) are one object.',
        limits=(0, 1), live=(0, 1))
    max_det: int = Param(
        100, 'Largest number of detections in an image; the best ones are kept.', limits=(1, LARGEST), live=(1, 300))
    image_size: int = Param(
        640, "Longer side of the network's input, rounded up to its stride (32, P6 models 64). Smaller is faster and "
        'misses people farther away. Exports with a fixed size ignore it.', 'pixels', limits=(1, MAX_INPUT_PX),
        live=(160, 1280))


class Letterbox(NamedTuple):
    """Scale and shift from an image to the network's input."""

    scale: float
    left: int
    top: int

    def undo(self, boxes, image_hw):
        """Convert boxes from input pixels to image pixels, clipped to the image."""
        boxes = (boxes - np.array([self.left, self.top] * 2)) / self.scale
        height, width = image_hw
        return np.clip(boxes, 0, [width, height, width, height])


class Yolov5(object):
    """YOLOv5 detector. `runtime` is a backend, see `ros_3d_bb.detection.yolov5.backends`.

    Raises ValueError if there is no class to detect, or the model does not have one of the classes.
    """

    def __init__(self, runtime, params=DetectionParams()):
        if not params.classes:
            raise ValueError('classes is empty; at least one class expected, such as person')
        self._runtime, self._params = runtime, params
        self.names, self.description = runtime.names, runtime.description  # class names by number; text for logs
        self._classes = [class_number(entry, runtime.names) for entry in params.classes]
        size = int(np.ceil(params.image_size / float(runtime.stride))) * runtime.stride
        self._input_hw = runtime.input_hw or (size, size)
        self._stride = runtime.stride if runtime.input_hw is None else None

    def with_params(self, params):
        """Return a detector with the same network and other parameters. Raises ValueError like the constructor."""
        return Yolov5(self._runtime, params)

    def detect(self, image):
        """Return the Detections in an RGB image (height, width, 3), uint8."""
        scaled, letterbox = apply_letterbox(image, self._input_hw, self._stride)
        rows = self._runtime(scaled, self._params.confidence)
        candidates = filter_predictions(rows, self._params.confidence, self._classes)
        detections = non_maximum_suppression(candidates, self._params.iou, self._params.max_det)
        return detections._replace(boxes=letterbox.undo(detections.boxes, image.shape[:2]))


def class_number(entry, names):
    """Number of a class that is given by name or number. Raises ValueError if the model does not have it."""
    if entry in names:
        return names.index(entry)
    if str(entry).isdigit() and int(entry) < len(names):
        return int(entry)
    raise ValueError('class %r is not among the %d classes of the model: %s' % (entry, len(names), ', '.join(names)))


def apply_letterbox(image, input_hw, stride=None):
    """Scale an image to the network's input and pad it, keeping the aspect ratio.

    It is padded to `input_hw`, or to the next multiple of a stride. Returns the image, which is the given one if it
    already has this size, and its Letterbox.
    """
    height, width = image.shape[:2]
    scale = min(input_hw[0] / float(height), input_hw[1] / float(width))
    scaled_hw = max(int(round(height * scale)), 1), max(int(round(width * scale)), 1)
    if scaled_hw != (height, width):
        image = cv2.resize(image, scaled_hw[::-1], interpolation=cv2.INTER_LINEAR)
    pad_y, pad_x = (outer - inner for outer, inner in zip(input_hw, scaled_hw))
    if stride is not None:
        pad_y, pad_x = pad_y % stride, pad_x % stride
    top, left = pad_y // 2, pad_x // 2
    if pad_x or pad_y:
        image = cv2.copyMakeBorder(image, top, pad_y - top, left, pad_x - left, cv2.BORDER_CONSTANT, value=GREY)
    return image, Letterbox(scale, left, top)


def filter_predictions(rows, confidence, classes):
    """Select the predictions of a backend whose best class is in `classes` with a score above `confidence`.

    Returns at most MAX_CANDIDATES Detections, boxes in pixels of the network's input.
    """
    rows = rows[rows[:, 4] > confidence]
    best = rows[:, 5:].argmax(axis=1)
    scores = rows[np.arange(len(rows)), 5 + best] * rows[:, 4]
    keep = (scores > confidence) & np.isin(best, classes) & np.isfinite(rows[:, :4]).all(axis=1)
    rows, scores, best = rows[keep], scores[keep], best[keep]
    order = np.argsort(-scores, kind='mergesort')[:MAX_CANDIDATES]
    center, half = rows[order, :2], rows[order, 2:4] / 2
    return Detections(np.hstack((center - half, center + half)), scores[order], best[order])
