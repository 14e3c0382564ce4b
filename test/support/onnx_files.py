"""ONNX files of detectors with given outputs, and outputs that contain given boxes."""
import numpy as np

from ros_3d_bb.detection.onnx.decoders import grid
from ros_3d_bb.detection.yolov5.onnx_writer import FLOAT, Graph

FLOAT16, UINT8 = 10, 2


def write_constant_network(path, outputs, input_shape=(1, 3, 96, 128), element=FLOAT, metadata=()):
    """Write a network that gives the same outputs, float32 arrays, for each image. Returns the path."""
    graph = Graph()
    values = [graph.node('Identity', [graph.constant(np.asarray(output, np.float32))]) for output in outputs]
    entries = [(name, FLOAT, tuple(output.shape)) for name, output in zip(values, outputs)]
    with open(str(path), 'wb') as stream:
        stream.write(graph.model([('images', element, tuple(input_shape))], entries, dict(metadata)))
    return str(path)


def outputs_of(head, boxes, scores, input_hw, strides=(8, 16, 32)):
    """Outputs of a head that contain boxes (n, 4), x1, y1, x2, y2, with scores (n, classes) in 0..1.

    A box is predicted by the cell of the first stride in which its center is. Other predictions have scores of 0.
    """
    boxes, scores = np.asarray(boxes, float), np.asarray(scores, float)
    center, size = (boxes[:, :2] + boxes[:, 2:]) / 2, boxes[:, 2:] - boxes[:, :2]
    if head == 'end-to-end':
        return [np.hstack((boxes, scores.max(axis=1)[:, None], scores.argmax(axis=1)[:, None]))[None]]
    cells = grid(input_hw, tuple(strides)).astype(float)
    columns, rows = (center // strides[0]).astype(int).T
    used = rows * -(-input_hw[1] // strides[0]) + columns
    cell, stride = cells[used, :2], cells[used, 2:]
    if head in ('yolov5', 'yolov8', 'yolox-decoded'):
        values = np.hstack((center, size, np.ones((len(boxes), 1)), scores))
        all_rows = np.zeros((len(cells) * (3 if head == 'yolov5' else 1), values.shape[1]))
        if head == 'yolox-decoded':
            all_rows[:, :4] = np.hstack((cells[:, :2] * cells[:, 2:], cells[:, [2, 2]]))
        all_rows[used] = values
        return [np.delete(all_rows, 4, axis=1).T[None] if head == 'yolov8' else all_rows[None]]
    all_rows = np.zeros((len(cells), 5 + scores.shape[1]))
    all_rows[used] = np.hstack((center / stride - cell, np.log(size / stride), np.ones((len(boxes), 1)), scores))
    return [all_rows[None]]


def write_mean_network(path, input_shape=(1, 3, 96, 128), element=FLOAT, channels_last=False):
    """Write a network whose only detection (1, 1, 6) is the mean of the channels of its input, twice, but the score 1.
    Returns the path.

    The mean of the third channel is the class.
    """
    graph = Graph()
    mean = graph.node('ReduceMean', [graph.node('Cast', ['images'], to=FLOAT)], keepdims=0,
                      axes=[1, 2] if channels_last else [2, 3])
    row = graph.node('Reshape', [graph.node('Concat', [mean, mean], axis=1),
                                 graph.constant(np.array([1, 1, 6], np.int64))])
    score = np.float32([0, 0, 0, 0, 1, 0])
    row = graph.node('Add', [graph.node('Mul', [row, graph.constant(1 - score)]), graph.constant(score)])
    with open(str(path), 'wb') as stream:
        stream.write(graph.model([('images', element, tuple(input_shape))], [(row, FLOAT, (1, 1, 6))],
                                 {'end2end': 'True'}))
    return str(path)
