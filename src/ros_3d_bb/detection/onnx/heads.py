"""Families of detection heads, and their recognition by the outputs of a network."""
import functools
from typing import Callable, NamedTuple, Tuple

from ros_3d_bb.core.object_classes import COCO
from ros_3d_bb.detection.onnx.decoders import (cell_count, decode_columns, decode_distances, decode_final,
                                               decode_relative, decode_rows, decode_yolox, is_probability)
from ros_3d_bb.detection.weights import MAX_CLASSES

P3, P6 = (8, 16, 32), (8, 16, 32, 64)
GRIDS = (P3, P6, (4, 8, 16, 32))
TASKS = ('detect', 'segment', 'pose')  # of ultralytics, whose outputs contain boxes
RTDETR = 'RTDETRDecoder'  # in the metadata of ultralytics
YOLOV5_ANCHORS = 3  # predictions of each cell
USUAL_CHANNELS = 32, 44, 68  # of four distributions of distances, of 8 bins as in most networks, 11 or 17
IMAGENET_MEAN, IMAGENET_STD = (123.675, 116.28, 103.53), (58.395, 57.12, 57.375)  # red, green, blue
BLUE_FIRST = {'color': 'bgr', 'mean': IMAGENET_MEAN[::-1], 'std': IMAGENET_STD[::-1]}


class Head(NamedTuple):
    """A family of heads, with the input on which its networks are trained."""

    decode: Callable  # a function of `decoders`
    shape: str  # of its outputs, for messages
    strides: Tuple[int, ...] = ()  # of the grid, if the decoder needs it
    suppressed: bool = False  # whether the network suppresses overlapping boxes
    color: str = 'rgb'  # order of the channels
    mean: Tuple[float, ...] = (0.0, 0.0, 0.0)  # subtracted from the channels, 0..255, in this order
    std: Tuple[float, ...] = (255.0, 255.0, 255.0)  # by which they are then divided
    resize: str = 'center'  # a mode of `network_detector.fit_image`
    padding: int = 114


HEADS = {
    'yolov5': Head(decode_rows, '(1, n, 5 + classes)'),
    'yolov8': Head(decode_columns, '(1, 4 + classes, n)'),
    'end-to-end': Head(decode_final, '(1, n, 6)', suppressed=True),
    'rtdetr': Head(decode_relative, '(1, n, 6), relative to the input', suppressed=True, resize='stretch'),
    'yolox': Head(decode_yolox, '(1, n, 5 + classes)', P3, color='bgr', std=(1.0, 1.0, 1.0), resize='corner'),
    'yolox-decoded': Head(decode_rows, '(1, n, 5 + classes)', color='bgr', std=(1.0, 1.0, 1.0), resize='corner'),
    'nanodet': Head(decode_distances, '(1, n, classes + 4 * bins), or (1, n, classes) and (1, n, 4 * bins) by stride',
                    P3, padding=0, **BLUE_FIRST),
    'nanodet-plus': Head(functools.partial(decode_distances, offset=0.0), '(1, n, classes + 4 * bins)', P6,
                         resize='stretch', **BLUE_FIRST),
    'picodet': Head(decode_distances, '(1, n, classes) and (1, n, 4 * bins) by stride', P6, mean=IMAGENET_MEAN,
                    std=IMAGENET_STD, resize='stretch')}


class Layout(NamedTuple):
    """How the outputs of one network are decoded."""

    head: str  # a key of HEADS
    classes: int  # number of classes
    strides: Tuple[int, ...] = ()  # of the grid
    order: Tuple[int, ...] = (0,)  # indices of the outputs for the decoder


def layout_of(outputs, input_hw, metadata, head='', strides=(), names=()):
    """Recognise a network by its outputs. Returns its Layout.

    Parameters
    ----------
    outputs : list of ndarray
        Outputs for any image.
    input_hw : tuple of int
        Height and width of that image.
    metadata : dict
        Metadata of the file, {key: text}.
    head, strides, names : optional
        Name of the head, strides of its grid and names of its classes, where they are given.

    Raises
    ------
    ValueError
        If the outputs are not those of a known head, or not of what is given.
    """
    if metadata.get('task', 'detect') not in TASKS:
        raise ValueError('its task is %.40r; %s expected' % (metadata['task'], ', '.join(TASKS)))
    shapes = [output.shape for output in outputs]
    grids = [tuple(strides)] if strides else GRIDS
    for grid in grids:
        order = _order_by_stride(shapes, input_hw, grid)
        channels = [_rows_and_channels(shapes[index])[1] for index in order]
        if order and (head in ('nanodet', 'picodet') or not head and channels[-1] in USUAL_CHANNELS):
            classes = channels[0]
            return Layout(head or ('picodet' if len(grid) > 3 else 'nanodet'), _checked(classes, names), grid, order)
    if not shapes or len(shapes[0]) != 3 or shapes[0][0] != 1:
        raise ValueError('its first output is not (1, n, m)')
    grid = next((grid for grid in grids if _matches(shapes[0], cell_count(input_hw, grid))), ())
    if strides and not grid:
        raise ValueError('strides in the YAML file is %s, a grid of %d cells, which the %d x %d values of its first '
                         'output do not fit; without this key, strides are recognised' % (
                             list(strides), cell_count(input_hw, strides), shapes[0][1], shapes[0][2]))
    if grid and not head and any(len(shape) == 3 and _matches(shape, cell_count(input_hw, grid))
                                 for shape in shapes[1:]):
        raise ValueError('scores and boxes are separate outputs, %s, which no known head has'
                         % ' and '.join('%s x %s' % shape[1:] for shape in shapes if len(shape) == 3))
    head = head or _head_of(outputs[0], input_hw, grid, metadata)
    if HEADS[head].strides and not (grid and shapes[0][1] == cell_count(input_hw, grid)):
        raise ValueError('its first output has %d rows, which are not the cells of strides %s; the key strides in the '
                         'YAML file gives others' % (shapes[0][1], list(strides or HEADS[head].strides)))
    return Layout(head, _class_count(head, shapes, metadata, names), grid)


def _order_by_stride(shapes, input_hw, grid):
    """Indices of the scores of each stride, followed by those of the distances; () if the outputs are not these."""
    if len(shapes) != 2 * len(grid) or any(len(shape) not in (3, 4) or shape[0] != 1 for shape in shapes):
        return ()
    scores, distances = [], []
    for stride in grid:
        pair = [index for index, shape in enumerate(shapes)
                if _rows_and_channels(shape)[0] == cell_count(input_hw, (stride,))]
        if len(pair) != 2:
            return ()
        # The sort is stable: otherwise, the scores are first.
        pair.sort(key=lambda index: _rows_and_channels(shapes[index])[1] == USUAL_CHANNELS[0])
        scores.append(pair[0])
        distances.append(pair[1])
        if not _are_bins(_rows_and_channels(shapes[pair[1]])[1]):
            return ()
    return tuple(scores + distances)


def _rows_and_channels(shape):
    """Numbers of cells and channels of an output (1, n, channels) or (1, channels, height, width)."""
    return (shape[1], shape[2]) if len(shape) == 3 else (shape[2] * shape[3], shape[1])


def _are_bins(channels):
    """Whether channels may be four distributions, and not four distances."""
    return channels % 4 == 0 and channels >= 8


def _matches(shape, cells):
    return cells in (shape[1], shape[2]) or shape[1] == YOLOV5_ANCHORS * cells


def _head_of(output, input_hw, grid, metadata):
    """Name of the head with one output (1, n, m). Raises ValueError if it is unknown."""
    rows, columns = output.shape[1:]
    if columns >= 6 and (metadata.get('end2end') == 'True' or "'nms': True" in metadata.get('args', '')):
        return _head_of_final(output[0], metadata)
    cells = cell_count(input_hw, grid)
    if grid and columns == cells:
        return 'yolov8'
    if grid and rows == YOLOV5_ANCHORS * cells:
        return 'yolov5'
    if grid and rows == cells and columns > 5:
        if not is_probability(output[0, :, 4:]):  # the distributions of distances are before the softmax
            return 'nanodet' if len(grid) == 3 else 'nanodet-plus'
        if (output[0, :, 4] == 1).all():  # YOLOv6 has no objectness
            return 'yolov5'
        return 'yolox-decoded' if output[0, :, 0].max() > input_hw[1] / 2 else 'yolox'
    if columns == 6 and not (output[0, :, 5] % 1).any():  # class numbers; else scores, as of RT-DETR with two classes
        return _head_of_final(output[0], metadata)
    raise ValueError('its outputs are those of no known head')


def _head_of_final(rows, metadata):
    """Name of the head whose rows contain a box, its score and its class number. Raises ValueError if it is unknown."""
    if rows.shape[1] == 6 and metadata.get('head') == RTDETR:
        return 'rtdetr'
    boxes = rows[rows[:, 4] > 0, :4]  # other rows are padding
    if not len(boxes) or boxes.max() > 1:  # pixels
        return 'end-to-end'
    sides = boxes[:, 2:] - boxes[:, :2]
    if (sides > 0).all():
        raise ValueError('its boxes are from 0 to 1; corners in pixels of its input, or centres, widths and heights '
                         'relative to it expected')
    return 'rtdetr' if (sides < 0).any() else 'end-to-end'  # corners are in order, width and height are not


def _class_count(head, shapes, metadata, names):
    """Number of classes of a head with one output. Raises ValueError if it does not fit the names."""
    _one, rows, columns = shapes[0]
    if HEADS[head].suppressed:
        return len(names) or len(COCO)
    if head.startswith(('nanodet', 'picodet')):
        count = len(names) or (len(COCO) if columns - len(COCO) in USUAL_CHANNELS else columns - USUAL_CHANNELS[0])
        if not _are_bins(columns - count):
            raise ValueError('its %d columns are not the scores of %d classes and 4 distances' % (columns, count))
        return _checked(count, names)
    channels = rows - 4 if head == 'yolov8' else columns - 5
    if metadata.get('task') == 'pose' and 0 < len(names) < channels:  # key points follow the scores
        return len(names)
    masks = shapes[1][1] if len(shapes) > 1 and len(shapes[1]) == 4 else 0
    return _checked(channels - masks, names)


def _checked(classes, names):
    if not 0 < classes <= MAX_CLASSES:
        raise ValueError('it has %d classes; 1 to %d expected' % (classes, MAX_CLASSES))
    if names and len(names) != classes:
        raise ValueError('there are %d names for its %d classes' % (len(names), classes))
    return classes
