"""Detector that runs a network: resizing, conversion to a batch, network, class filter, non-maximum suppression.

Convention: boxes are (x1, y1, x2, y2) in pixels of the image, x to the right, y down, x2 and y2 exclusive.
"""
from typing import Any, List, NamedTuple, Optional, Sequence, Tuple

import cv2
import numpy as np

from ros_3d_bb.core.detection_pace import SIZES
from ros_3d_bb.core.object_classes import ObjectClasses
from ros_3d_bb.core.params import LARGEST, Param, parameters
from ros_3d_bb.detection.boxes import Detections, non_maximum_suppression

RGB, BGR = (0, 1, 2), (2, 1, 0)  # orders of the channels of an RGB image
GREY = 114  # of the padding
MAX_INPUT_PX = 4096  # larger inputs exhaust the memory
MAX_CANDIDATES = 30000  # maximum number of boxes before suppression, as in ultralytics


@parameters('Detector yolov5')
class DetectionParams(NamedTuple):
    classes: list = Param(('person',), 'Classes to detect: names or numbers of the model.', live=True)
    confidence: float = Param(
        0.25, 'Smallest score of a detection (of YOLOv5 and YOLOX, objectness times class score).', limits=(0, 1),
        live=(0, 1))
    iou: float = Param(
        0.45, 'Two boxes of a class that overlap by more than this (intersection over union) are one object.',
        limits=(0, 1), live=(0, 1))
    max_det: int = Param(
        100, 'Largest number of detections in an image; the best ones are kept.', limits=(1, LARGEST), live=(1, 300))
    detection_range: float = Param(
        8.0, 'Range within which people should be detected. It limits how far the node reduces the input of the '
        'network: larger ranges take more CPU time.', 'm', limits=(0.5, 100), live=(1, 20))
    image_size: int = Param(
        0, "Longer side of the network's input, rounded up to its stride (32, P6 models 64). 0: the node chooses "
        'the largest of 320, 384, 448, 512, 576 and 640 that keeps up with the images, but none that is too small for '
        'detection_range; bags use 640. Exports with a fixed size ignore it.', 'pixels',
        limits=(0, MAX_INPUT_PX), live=(0, 1280))


class Placement(NamedTuple):
    """Scale, and shift in x and y, from an image to the network's input."""

    scale: float
    shift: Tuple[int, int]

    def undo(self, boxes: np.ndarray, image_hw: Sequence[int]) -> np.ndarray:
        """Convert boxes from input pixels to image pixels, clipped to the image."""
        boxes = (boxes - np.tile(self.shift, 2)) / self.scale
        height, width = image_hw
        return np.clip(boxes, 0, [width, height, width, height])


class NetworkDetector(object):
    """Detector that runs a network.

    `network` is a backend of `detection.yolov5.backends` or an `onnx.onnx_model.OnnxModel`. Its method `candidates`
    takes an RGB image (height, width, 3), uint8, and a confidence, and returns the Detections above it in pixels of
    this image, in any order. Its attributes are `names`, the class names; `stride`, of which height and width must be
    multiples; `input_hw`, the only (height, width) that it accepts, or None if it accepts any; `padding`, see
    `fit_image`; `suppressed`, whether it suppresses overlapping boxes itself; and `description`, a text for logs.
    Raises ValueError if there is no class to detect, or the model does not have one of the classes.
    """

    def __init__(self, network: Any, params: DetectionParams = DetectionParams()) -> None:
        if not params.classes:
            raise ValueError('classes is empty; at least one class expected, such as person')
        self._network, self._params = network, params
        self.names, self.description = network.names, network.description  # class names by number; text for logs
        self._classes = [number for entry in params.classes for number in class_numbers(entry, network.names)]
        size = int(np.ceil((params.image_size or max(SIZES)) / float(network.stride))) * network.stride
        self._input_hw = network.input_hw or (size, size)
        self._stride = network.stride if network.input_hw is None else None

    @property
    def has_fixed_size(self) -> bool:
        """Whether the network accepts only one size, so that `image_size` has no effect."""
        return self._network.input_hw is not None

    @property
    def input_px(self) -> int:
        """Longer side of the network's input, pixels."""
        return max(self._input_hw)

    def with_params(self, params: DetectionParams) -> 'NetworkDetector':
        """Return a detector with the same network and other parameters. Raises ValueError like the constructor."""
        return NetworkDetector(self._network, params)

    def detect(self, image: np.ndarray) -> Detections:
        """Return the Detections in an RGB image (height, width, 3), uint8."""
        scaled, placement = fit_image(image, self._input_hw, self._stride, self._network.padding)
        candidates = ranked(self._network.candidates(scaled, self._params.confidence), self._classes)
        iou_limit = 1 if self._network.suppressed else self._params.iou
        detections = non_maximum_suppression(candidates, iou_limit, self._params.max_det)
        return detections._replace(boxes=placement.undo(detections.boxes, image.shape[:2]))


def class_numbers(entry: Any, names: List[str]) -> List[int]:
    """Numbers of a class that is given by name or number; if no name is equal, those of other names of people.

    Raises ValueError if the model does not have it.
    """
    if entry in names:
        return [names.index(entry)]
    if str(entry).isdigit() and int(entry) < len(names):
        return [int(entry)]
    standard_name = ObjectClasses().standard_name
    numbers = [number for number, name in enumerate(names) if standard_name(name) == standard_name(str(entry))]
    if numbers:
        return numbers
    if names == [str(number) for number in range(len(names))]:
        raise ValueError('class %r is unknown: the model has no names of its %d classes; list them in a '
                         'YAML file beside an ONNX file, see doc/onnx.md' % (entry, len(names)))
    raise ValueError('class %r (~classes) is not among the %d classes of the model: %s'
                     % (entry, len(names), ', '.join(names)))


def fit_image(image: np.ndarray, input_hw: Tuple[int, int], stride: Optional[int] = None,
              padding: str = 'center') -> Tuple[np.ndarray, Placement]:
    """Scale an image to the network's input and pad it, on two sides (`center`) or at the right and at the bottom.

    It is padded to `input_hw`, or to the next multiple of a stride. Returns the image, which is the given one if it
    already has this size, and its Placement.
    """
    height, width = image.shape[:2]
    scale = min(input_hw[0] / float(height), input_hw[1] / float(width))
    scaled_hw = max(int(round(height * scale)), 1), max(int(round(width * scale)), 1)
    if scaled_hw != (height, width):
        image = cv2.resize(image, scaled_hw[::-1], interpolation=cv2.INTER_LINEAR)
    pad_y, pad_x = (outer - inner for outer, inner in zip(input_hw, scaled_hw))
    if stride is not None:
        pad_y, pad_x = pad_y % stride, pad_x % stride
    top, left = (pad_y // 2, pad_x // 2) if padding == 'center' else (0, 0)
    if pad_x or pad_y:
        image = cv2.copyMakeBorder(image, top, pad_y - top, left, pad_x - left, cv2.BORDER_CONSTANT, value=(GREY,) * 3)
    return image, Placement(scale, (left, top))


def batch_of(image: np.ndarray, order: Sequence[int] = RGB, scale: float = 255.0,
             dtype: Any = np.float32) -> np.ndarray:
    """Convert an RGB image (height, width, 3), uint8, to a batch (1, 3, height, width) of the channels in an order,
    divided by a scale.
    """
    batch, channels = np.empty((1, 3) + image.shape[:2], dtype), cv2.split(image)
    for plane, number in zip(batch[0], order):
        plane[...] = channels[number]
    if scale != 1:
        batch /= dtype(scale)
    return batch


def ranked(detections: Detections, classes: Sequence[int]) -> Detections:
    """Detections of some classes with finite boxes, in order of decreasing score; at most MAX_CANDIDATES."""
    boxes, scores, numbers = detections
    kept = np.flatnonzero(np.isin(numbers, classes) & np.isfinite(boxes).all(axis=1))
    kept = kept[np.argsort(-scores[kept], kind='mergesort')[:MAX_CANDIDATES]]
    return Detections(boxes[kept], scores[kept], numbers[kept])
