"""Export of `ros_3d_bb.detection.yolov5.network.Network` to ONNX.

The input of the model is an RGB image (1, height, width, 3), uint8, whose height and width are multiples of the stride.
The outputs are the heads of the network (see `ros_3d_bb.detection.yolov5.predictions`).
"""
import base64
import json

import numpy as np
from torch import nn

from ros_3d_bb.detection.yolov5 import network as yolov5
from ros_3d_bb.detection.yolov5.onnx_writer import FLOAT, UINT8, Graph
from ros_3d_bb.detection.yolov5.predictions import reference_image
from ros_3d_bb.detection.yolov5.torch_backend import network_of, run


def export(path, digest):
    """Bytes of an ONNX file with the network, class names and anchors of a checkpoint, the SHA-256 (`digest`) of the
    checkpoint, and the output of torch for the reference image.
    """
    network, names = network_of(path)
    detect, stride = network.model[-1], int(network.stride)
    reference = base64.b64encode(run(network, reference_image(stride), -1).astype('<f4').tobytes()).decode()
    return Exporter().model(network, {'about': json.dumps({
        'checkpoint': digest, 'names': names, 'stride': stride, 'strides': detect.strides,
        'anchors_px': detect.anchors_px.tolist(), 'reference': reference})})


class Exporter(object):
    """Adds the layers of a network to a graph; each method returns the name of the layer's output."""

    def __init__(self):
        self._graph = Graph()
        self._pixel_scale = np.float32(1 / 255.0)  # multiplied into the weights of the first convolution
        self._layers = {
            nn.Sequential: self._sequence, yolov5.Conv: self._convolution, yolov5.Bottleneck: self._bottleneck,
            yolov5.C3: self._c3, yolov5.Focus: self._focus, yolov5.SPP: self._spp, yolov5.SPPF: self._sppf,
            yolov5.Concat: lambda _layer, inputs: self._concat(inputs),
            nn.Upsample: lambda layer, x: self._graph.node(
                'Resize', [x, '', self._graph.constant(np.float32([1, 1, layer.scale_factor, layer.scale_factor]))],
                mode='nearest', coordinate_transformation_mode='asymmetric', nearest_mode='floor'),
            nn.MaxPool2d: lambda layer, x: self._graph.node(
                'MaxPool', [x], kernel_shape=[layer.kernel_size] * 2, pads=[layer.padding] * 4),
            yolov5.Detect: lambda layer, inputs: [self._conv2d(head, x) for head, x in zip(layer.m, inputs)],
            nn.SiLU: lambda _layer, x: self._graph.node('Mul', [x, self._graph.node('Sigmoid', [x])]),
            nn.ReLU: lambda _layer, x: self._graph.node('Relu', [x]),
            nn.LeakyReLU: lambda layer, x: self._graph.node('LeakyRelu', [x], alpha=layer.negative_slope),
            nn.Hardswish: lambda _layer, x: self._graph.node(
                'Mul', [x, self._graph.node('HardSigmoid', [x], alpha=1 / 6.0, beta=0.5)])}

    def model(self, network, metadata):
        """Bytes of an ONNX file with a fused float32 network on the CPU, and {key: text}."""
        x = self._graph.node('Cast', [self._graph.node('Transpose', ['image'], perm=[0, 3, 1, 2])], to=FLOAT)
        outputs = []
        for inputs, layer in zip(network.inputs, network.model):
            x = self._add(layer, [outputs[i] for i in inputs] if isinstance(inputs, list)
                          else outputs[inputs] if outputs else x)
            outputs.append(x)
        heads = [(name, FLOAT, (1, head.out_channels, 'lines%d' % scale, 'columns%d' % scale))
                 for scale, (name, head) in enumerate(zip(x, network.model[-1].m))]
        return self._graph.model([('image', UINT8, (1, 'height', 'width', 3))], heads, metadata)

    def _add(self, layer, inputs):
        return self._layers[type(layer)](layer, inputs)

    def _sequence(self, layers, x):
        for layer in layers:
            x = self._add(layer, x)
        return x

    def _concat(self, inputs):
        return self._graph.node('Concat', inputs, axis=1)

    def _convolution(self, layer, x):
        return self._add(layer.act, self._conv2d(layer.conv, x))

    def _conv2d(self, layer, x):
        weight, self._pixel_scale = layer.weight.detach().numpy() * self._pixel_scale, np.float32(1)
        return self._graph.node('Conv', [x, self._graph.constant(weight),
                                         self._graph.constant(layer.bias.detach().numpy())],
                                strides=list(layer.stride), pads=list(layer.padding) * 2)

    def _bottleneck(self, layer, x):
        y = self._add(layer.cv2, self._add(layer.cv1, x))
        return self._graph.node('Add', [x, y]) if layer.shortcut else y

    def _c3(self, layer, x):
        return self._add(layer.cv3, self._concat([self._add(layer.m, self._add(layer.cv1, x)),
                                                  self._add(layer.cv2, x)]))

    def _focus(self, layer, x):
        starts, ends, axes, steps = [0, 1], [2 ** 31 - 1] * 2, [2, 3], [2, 2]
        parts = [self._graph.node('Slice', [x] + [self._graph.constant(np.array(values, np.int64))
                                                  for values in ([line, column], ends, axes, steps)])
                 for column in starts for line in starts]
        return self._add(layer.conv, self._concat(parts))

    def _spp(self, layer, x):
        x = self._add(layer.cv1, x)
        return self._add(layer.cv2, self._concat([x] + [self._add(pool, x) for pool in layer.m]))

    def _sppf(self, layer, x):
        levels = [self._add(layer.cv1, x)]
        for _ in range(3):
            levels.append(self._add(layer.m, levels[-1]))
        return self._add(layer.cv2, self._concat(levels))
