"""What a YOLOv5 network must put out: recorded from the official code, or computed here in plain numpy."""
import os

import cv2
import numpy as np

from support.checkpoints import write_checkpoint
from support.layouts import layout


def recorded(data):
    """The recorded output: (checkpoint, [(RGB image, rows, values (rows, 85))])."""
    values = np.load(os.path.join(data, 'weights', 'yolov5n_reference.npz'))
    cases = []
    for name in sorted(set(key.split('/')[0] for key in values.files)):
        image = cv2.imread(os.path.join(data, 'data', 'thesis', 'color', name + '.png'))[..., ::-1]
        cases.append((image, values[name + '/rows'], values[name + '/values']))
    return os.path.join(data, 'weights', 'yolov5n.pt'), cases


def made(path, given=None):
    """A checkpoint of random weights and the output that numpy computes for two small images."""
    network = write_checkpoint(path, given or layout('6.0', 'n'))
    random = np.random.RandomState(2)
    cases = []
    for height, width in ((64, 96), (96, 64)):
        image = random.randint(0, 256, (height, width, 3)).astype(np.uint8)
        output = _forward(network, image.transpose(2, 0, 1) / 255.0)
        rows = random.choice(len(output), 60, replace=False)
        cases.append((image, rows, output[rows]))
    return path, cases


def _forward(network, x):
    outputs = []
    for inputs, layer in zip(network.inputs, network.model):
        kind = type(layer).__name__
        given = [outputs[i] for i in inputs] if isinstance(inputs, list) else outputs[-1] if outputs else x
        if kind == 'Concat':
            given = np.concatenate(given)
        elif kind == 'Upsample':
            given = given.repeat(2, axis=1).repeat(2, axis=2)
        elif kind == 'Detect':
            return np.concatenate([_decoded(layer, scale, y) for scale, y in enumerate(given)])
        else:
            given = {'Conv': _conv, 'C3': _c3, 'SPPF': _sppf, 'Focus': _focus, 'SPP': _spp}[kind](layer, given)
        outputs.append(given)


def _conv(layer, x):
    """Convolution, batch normalisation (epsilon 1e-3), SiLU."""
    norm = layer.bn
    scale = _array(norm.weight) / np.sqrt(_array(norm.running_var) + 1e-3)
    x = _convolved(x, _array(layer.conv.weight), layer.conv.stride[0], layer.conv.padding[0])
    x = (x - _array(norm.running_mean)[:, None, None]) * scale[:, None, None] + _array(norm.bias)[:, None, None]
    return x / (1 + np.exp(-x))


def _convolved(x, weight, stride, padding):
    size = weight.shape[2]
    x = np.pad(x, ((0, 0), (padding, padding), (padding, padding)))
    windows = np.lib.stride_tricks.sliding_window_view(x, (size, size), axis=(1, 2))[:, ::stride, ::stride]
    return np.einsum('chwij,ocij->ohw', windows, weight, optimize=True)


def _c3(layer, x):
    y = _conv(layer.cv1, x)
    for bottleneck in layer.m:
        z = _conv(bottleneck.cv2, _conv(bottleneck.cv1, y))
        y = y + z if bottleneck.shortcut else z
    return _conv(layer.cv3, np.concatenate((y, _conv(layer.cv2, x))))


def _focus(layer, x):
    """Rows and columns: both even, odd rows, odd columns, both odd."""
    return _conv(layer.conv, np.concatenate([x[:, row::2, column::2] for column in (0, 1) for row in (0, 1)]))


def _sppf(layer, x):
    levels = [_conv(layer.cv1, x)]
    for _ in range(3):
        levels.append(_pooled(levels[-1], 5))
    return _conv(layer.cv2, np.concatenate(levels))


def _spp(layer, x):
    x = _conv(layer.cv1, x)
    return _conv(layer.cv2, np.concatenate([x] + [_pooled(x, size) for size in (5, 9, 13)]))


def _pooled(x, size):
    """The largest of each window."""
    half = size // 2
    padded = np.pad(x, ((0, 0), (half, half), (half, half)), constant_values=-np.inf)
    return np.lib.stride_tricks.sliding_window_view(padded, (size, size), axis=(1, 2)).max(axis=(3, 4))


def _decoded(detect, scale, x):
    """Rows by anchor, line, column, as the official code orders them."""
    stride, layer = detect.strides[scale], detect.m[scale]
    y = _convolved(x, _array(layer.weight), 1, 0) + _array(layer.bias)[:, None, None]
    y = 1 / (1 + np.exp(-y.reshape(3, -1, *y.shape[1:])))
    rows = []
    for anchor, size in zip(y, _array(detect.anchors)[scale] * stride):
        for line in range(y.shape[2]):
            for column in range(y.shape[3]):
                cell = anchor[:, line, column]
                x_y = (2 * cell[:2] - 0.5 + [column, line]) * stride
                rows.append(np.concatenate((x_y, (2 * cell[2:4]) ** 2 * size, cell[4:])))
    return np.array(rows)


def _array(tensor):
    return tensor.detach().numpy().astype(float)
