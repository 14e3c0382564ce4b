"""Families of detection heads, and their recognition by the outputs of a network."""
from typing import Callable, NamedTuple, Tuple

from ros_3d_bb.core.object_classes import COCO
from ros_3d_bb.detection.onnx.decoders import (cell_count, decode_columns, decode_final, decode_rows, decode_yolox,
                                               is_probability)
from ros_3d_bb.detection.weights import MAX_CLASSES

P3, P6 = (8, 16, 32), (8, 16, 32, 64)
GRIDS = (P3, P6, (4, 8, 16, 32))
TASKS = ('detect', 'segment', 'pose')  # of ultralytics, whose outputs contain boxes
YOLOV5_ANCHORS = 3  # predictions of each cell


class Head(NamedTuple):
    """A family of heads, with the input on which its networks are trained."""

    decode: Callable  # a function of `decoders`
    shape: str  # of its outputs, for messages
    suppressed: bool = False  # whether the network suppresses overlapping boxes
    color: str = 'rgb'  # order of the channels
    scale: float = 255.0  # by which the channels, 0..255, are divided
    padding: str = 'center'  # a mode of `network_detector.fit_image`


HEADS = {
    'yolov5': Head(decode_rows, '(1, n, 5 + classes)'),
    'yolov8': Head(decode_columns, '(1, 4 + classes, n)'),
    'end-to-end': Head(decode_final, '(1, n, 6)', suppressed=True),
    'yolox': Head(decode_yolox, '(1, n, 5 + classes)', color='bgr', scale=1.0, padding='corner'),
    'yolox-decoded': Head(decode_rows, '(1, n, 5 + classes)', color='bgr', scale=1.0, padding='corner')}


class Layout(NamedTuple):
    """How the outputs of one network are decoded."""

    head: str  # a key of HEADS
    classes: int  # number of classes
    strides: Tuple[int, ...] = ()  # of the grid


def layout_of(outputs, input_hw, metadata, names=()):
    """Recognise a network by its outputs for any image (height, width), the metadata of the file, {key: text}, and the
    names of its classes, if they are known. Returns its Layout.

    Raises ValueError if the outputs are not those of a known head, or do not fit the names.
    """
    if metadata.get('task', 'detect') not in TASKS:
        raise ValueError('its task is %.40r; %s expected' % (metadata['task'], ', '.join(TASKS)))
    shapes = [output.shape for output in outputs]
    if not shapes or len(shapes[0]) != 3 or shapes[0][0] != 1:
        raise ValueError('its first output is not (1, n, m)')
    grid = next((grid for grid in GRIDS if _matches(shapes[0], cell_count(input_hw, grid))), ())
    if grid and any(len(shape) == 3 and _matches(shape, cell_count(input_hw, grid)) for shape in shapes[1:]):
        raise ValueError('scores and boxes are separate outputs, %s, which no known head has'
                         % ' and '.join('%s x %s' % shape[1:] for shape in shapes if len(shape) == 3))
    head = _head_of(outputs[0], input_hw, grid, metadata)
    return Layout(head, _class_count(head, shapes, metadata, names), grid)


def _matches(shape, cells):
    return cells in (shape[1], shape[2]) or shape[1] == YOLOV5_ANCHORS * cells


def _head_of(output, input_hw, grid, metadata):
    rows, columns = output.shape[1:]
    if columns >= 6 and (metadata.get('end2end') == 'True' or "'nms': True" in metadata.get('args', '')):
        return _checked_final(output[0])
    cells = cell_count(input_hw, grid)
    if grid and columns == cells:
        return 'yolov8'
    if grid and rows == YOLOV5_ANCHORS * cells:
        return 'yolov5'
    if grid and rows == cells and columns > 5 and is_probability(output[0, :, 4:]):
        if (output[0, :, 4] == 1).all():  # YOLOv6 has no objectness
            return 'yolov5'
        return 'yolox-decoded' if output[0, :, 0].max() > input_hw[1] / 2 else 'yolox'
    if columns == 6 and not (output[0, :, 5] % 1).any():  # class numbers; else scores of two classes
        return _checked_final(output[0])
    raise ValueError('its outputs are those of no known head')


def _checked_final(rows):
    """Name of the head whose rows contain a box, its score and its class number. Raises ValueError if boxes are not in
    pixels, as those of RT-DETR."""
    boxes = rows[rows[:, 4] > 0, :4]  # other rows are padding
    if len(boxes) and boxes.max() <= 1 and (boxes[:, 2:] != boxes[:, :2]).any():
        raise ValueError('its boxes are from 0 to 1; corners in pixels of its input expected')
    return 'end-to-end'


def _class_count(head, shapes, metadata, names):
    _one, rows, columns = shapes[0]
    if HEADS[head].suppressed:
        return len(names) or len(COCO)
    channels = rows - 4 if head == 'yolov8' else columns - 5
    if metadata.get('task') == 'pose' and 0 < len(names) < channels:  # key points follow the scores
        return len(names)
    masks = shapes[1][1] if len(shapes) > 1 and len(shapes[1]) == 4 else 0
    classes = channels - masks
    if not 0 < classes <= MAX_CLASSES:
        raise ValueError('it has %d classes; 1 to %d expected' % (classes, MAX_CLASSES))
    if names and len(names) != classes:
        raise ValueError('there are %d names for its %d classes' % (len(names), classes))
    return classes
