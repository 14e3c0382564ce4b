"""What a YOLOv5 network must put out: recorded from the official code, or computed here independently of network.py."""
import os

import cv2
import numpy as np
import torch
from torch.nn import functional

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
    """A checkpoint of random weights, and its output in double precision for two small images."""
    network = write_checkpoint(path, given or layout('6.0', 'n')).double()
    random = np.random.RandomState(2)
    cases = []
    for height, width in ((64, 96), (96, 64)):
        image = random.randint(0, 256, (height, width, 3)).astype(np.uint8)
        with torch.no_grad():
            output = _forward(network, torch.from_numpy(image.transpose(2, 0, 1)[None] / 255.0)).numpy()
        rows = random.choice(len(output), 60, replace=False)
        cases.append((image, rows, output[rows]))
    return path, cases


def _forward(network, x):
    outputs = []
    for inputs, layer in zip(network.inputs, network.model):
        kind = type(layer).__name__
        given = [outputs[i] for i in inputs] if isinstance(inputs, list) else outputs[-1] if outputs else x
        if kind == 'Concat':
            given = torch.cat(given, 1)
        elif kind == 'Upsample':
            given = given.repeat_interleave(2, dim=2).repeat_interleave(2, dim=3)
        elif kind == 'Detect':
            return torch.cat([_decoded(layer, scale, y) for scale, y in enumerate(given)])
        else:
            given = {'Conv': _conv, 'C3': _c3, 'SPPF': _spp, 'Focus': _focus, 'SPP': _spp}[kind](layer, given)
        outputs.append(given)


def _conv(layer, x):
    """Convolution, batch normalisation (epsilon 1e-3), SiLU."""
    x, norm = functional.conv2d(x, layer.conv.weight, None, layer.conv.stride, layer.conv.padding), layer.bn
    x = functional.batch_norm(x, norm.running_mean, norm.running_var, norm.weight, norm.bias, eps=1e-3)
    return functional.silu(x)


def _c3(layer, x):
    y = _conv(layer.cv1, x)
    for bottleneck in layer.m:
        z = _conv(bottleneck.cv2, _conv(bottleneck.cv1, y))
        y = y + z if bottleneck.shortcut else z
    return _conv(layer.cv3, torch.cat((y, _conv(layer.cv2, x)), 1))


def _focus(layer, x):
    """Rows and columns: both even, odd rows, odd columns, both odd."""
    return _conv(layer.conv, torch.cat([x[:, :, row::2, column::2] for column in (0, 1) for row in (0, 1)], 1))


def _spp(layer, x):
    """Also SPPF, whose repeated maxima over 5 cells are the maxima over 9 and 13."""
    x = _conv(layer.cv1, x)
    pooled = [functional.max_pool2d(x, size, 1, size // 2) for size in (5, 9, 13)]
    return _conv(layer.cv2, torch.cat([x] + pooled, 1))


def _decoded(detect, scale, x):
    """Rows by anchor, line, column, as the official code orders them."""
    stride, layer = detect.strides[scale], detect.m[scale]
    y = torch.sigmoid(functional.conv2d(x, layer.weight, layer.bias))
    y = y.reshape(3, -1, *x.shape[2:]).permute(0, 2, 3, 1)
    columns, lines = np.meshgrid(np.arange(y.shape[2]), np.arange(y.shape[1]))
    x_y = (2 * y[..., :2] - 0.5 + torch.from_numpy(np.stack((columns, lines), -1))) * stride
    sizes = (2 * y[..., 2:4]) ** 2 * (detect.anchors[scale] * stride)[:, None, None]
    return torch.cat((x_y, sizes, y[..., 4:]), -1).reshape(-1, y.shape[-1])
