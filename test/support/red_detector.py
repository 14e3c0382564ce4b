"""An ONNX file of a network that detects red objects: weights that a test can write."""
import numpy as np

from ros_3d_bb.detection.yolov5.onnx_writer import FLOAT, Graph


def write_red_detector(path, size=640):
    """Write a network whose only row is the bounding box of all red pixels, as class 0 of 80. Returns the path."""
    graph = Graph()

    def number(value):
        return graph.constant(np.float32([[value]]))
    red, green, blue = (graph.node('Gather', ['images', graph.constant(np.int64(channel))], axis=1)
                        for channel in range(3))
    least = graph.node('Min', [graph.node('Sub', [red, number(0.6)]), graph.node('Sub', [number(0.4), green]),
                               graph.node('Sub', [number(0.4), blue])])
    is_red = graph.node('Cast', [graph.node('Greater', [least, number(0.0)])], to=FLOAT)
    edges = []
    for last in (0, 1):
        for axis in (1, 2):  # columns, then rows
            occupied = graph.node('ReduceMax', [is_red], axes=[axis], keepdims=0)
            edge = graph.node('Cast', [graph.node('ArgMax', [occupied], axis=1, select_last_index=last)], to=FLOAT)
            edges.append(graph.node('Add', [edge, number(last)]))
    found = graph.node('Reshape', [graph.node('ReduceMax', [is_red], keepdims=0),
                                   graph.constant(np.array([1, 1], np.int64))])
    row = graph.node('Concat', edges + [graph.node('Mul', [found, number(0.93)]), number(0.0)], axis=1)
    row = graph.node('Reshape', [row, graph.constant(np.array([1, 1, 6], np.int64))])
    names = ['person'] + ['thing %d' % n for n in range(1, 80)]
    with open(path, 'wb') as stream:
        stream.write(graph.model([('images', FLOAT, (1, 3, size, size))], [(row, FLOAT, (1, 1, 6))],
                                 {'end2end': 'True', 'names': str(names)}))
    return path
