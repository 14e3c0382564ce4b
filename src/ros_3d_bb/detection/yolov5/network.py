"""YOLOv5 network, built from the `yaml` in a checkpoint.

Architecture: YOLOv5 releases 5.0 (Focus, SPP) and 6.0 to 7.0 (Conv, SPPF), any width and depth, three or four output
scales (P5, P6). Attributes have the names of the weights in checkpoints, so that weights are loaded by name.
Images are (batch, 3, height, width), RGB, 0..1; height and width multiples of `Network.stride`.
"""
import math

import numpy as np
import torch
from torch import nn

ACTIVATIONS = {'nn.SiLU()': nn.SiLU, 'nn.ReLU()': nn.ReLU, 'nn.Hardswish()': nn.Hardswish,
               'nn.LeakyReLU(0.1)': lambda: nn.LeakyReLU(0.1)}
# Limits of a layout. The largest official model, x6, has 1.4e8 parameters, 4 scales and 3 anchors.
MAX_LAYERS, MAX_REPEATS, MAX_KERNEL, MAX_SCALES, MAX_ANCHORS, MAX_PARAMETERS = 100, 50, 31, 5, 10, 2e8


class Conv(nn.Module):
    """Convolution, batch normalisation and activation."""

    def __init__(self, in_channels, out_channels, kernel=1, stride=1, padding=None):
        super(Conv, self).__init__()
        self.conv = nn.Conv2d(in_channels, out_channels, kernel, stride, kernel // 2 if padding is None else padding,
                              bias=False)
        self.bn = nn.BatchNorm2d(out_channels, eps=1e-3)
        self.act = nn.SiLU()

    def forward(self, x):
        return self.act(self.bn(self.conv(x)))


class Focus(nn.Module):
    """Space-to-depth by a factor of 2, followed by Conv (release 5.0)."""

    def __init__(self, in_channels, out_channels, kernel=1):
        super(Focus, self).__init__()
        self.conv = Conv(4 * in_channels, out_channels, kernel)

    def forward(self, x):
        return self.conv(torch.cat((x[..., ::2, ::2], x[..., 1::2, ::2], x[..., ::2, 1::2], x[..., 1::2, 1::2]), 1))


class Bottleneck(nn.Module):
    """Two convolutions with an optional shortcut."""

    def __init__(self, channels, shortcut):
        super(Bottleneck, self).__init__()
        self.cv1 = Conv(channels, channels)
        self.cv2 = Conv(channels, channels, 3)
        self.shortcut = shortcut

    def forward(self, x):
        y = self.cv2(self.cv1(x))
        return x + y if self.shortcut else y


class C3(nn.Module):
    """Cross stage partial block: half of the channels pass the bottlenecks, half bypass them."""

    def __init__(self, in_channels, out_channels, repeats, shortcut=True):
        super(C3, self).__init__()
        hidden = out_channels // 2
        self.cv1 = Conv(in_channels, hidden)
        self.cv2 = Conv(in_channels, hidden)
        self.cv3 = Conv(2 * hidden, out_channels)
        self.m = nn.Sequential(*[Bottleneck(hidden, shortcut) for _ in range(repeats)])

    def forward(self, x):
        return self.cv3(torch.cat((self.m(self.cv1(x)), self.cv2(x)), 1))


class SPP(nn.Module):
    """Spatial pyramid pooling: the input and its maxima over windows of several sizes (release 5.0)."""

    def __init__(self, in_channels, out_channels, kernels=(5, 9, 13)):
        super(SPP, self).__init__()
        hidden = in_channels // 2
        self.cv1 = Conv(in_channels, hidden)
        self.cv2 = Conv(hidden * (len(kernels) + 1), out_channels)
        self.m = nn.ModuleList([nn.MaxPool2d(kernel, 1, kernel // 2) for kernel in kernels])

    def forward(self, x):
        x = self.cv1(x)
        return self.cv2(torch.cat([x] + [pool(x) for pool in self.m], 1))


class SPPF(nn.Module):
    """Fast spatial pyramid pooling: one small window is applied repeatedly (releases 6.0 to 7.0)."""

    def __init__(self, in_channels, out_channels, kernel=5):
        super(SPPF, self).__init__()
        hidden = in_channels // 2
        self.cv1 = Conv(in_channels, hidden)
        self.cv2 = Conv(4 * hidden, out_channels)
        self.m = nn.MaxPool2d(kernel, 1, kernel // 2)

    def forward(self, x):
        levels = [self.cv1(x)]
        for _ in range(3):
            levels.append(self.m(levels[-1]))
        return self.cv2(torch.cat(levels, 1))


class Concat(nn.Module):
    """Concatenation of several inputs along the channels."""

    def forward(self, inputs):
        return torch.cat(inputs, 1)


class Detect(nn.Module):
    """Output layer: the heads, one for each scale, see `predictions.decode_heads`.

    `anchors` (scales, anchors per scale, 2), width and height in cells, are loaded with the weights.
    """

    def __init__(self, class_count, anchor_count, in_channels, strides):
        super(Detect, self).__init__()
        self.strides = strides
        self.m = nn.ModuleList([nn.Conv2d(channels, anchor_count * (class_count + 5), 1) for channels in in_channels])
        self.register_buffer('anchors', torch.zeros(len(in_channels), anchor_count, 2))

    @property
    def anchors_px(self):
        """Width and height of the anchors in pixels, as an array (scales, anchors per scale, 2)."""
        return self.anchors.float().cpu().numpy() * np.reshape(self.strides, (-1, 1, 1))

    def forward(self, inputs):
        return [head(x) for head, x in zip(self.m, inputs)]


class Network(nn.Module):
    """YOLOv5 detection network.

    `layout` is the `yaml` of a checkpoint: nc, anchors, depth_multiple, width_multiple, backbone and head, whose rows
    are [inputs, repeats, layer, arguments]. ValueError if it contains a layer or a size that no YOLOv5 release has.
    """

    def __init__(self, layout):
        super(Network, self).__init__()
        backbone, head = layout['backbone'], layout['head']
        if not (isinstance(backbone, list) and isinstance(head, list) and len(backbone) + len(head) <= MAX_LAYERS):
            raise ValueError('backbone and head are not lists of at most %d layers in total' % MAX_LAYERS)
        rows, builder = backbone + head, _Builder(layout)
        self.model = nn.ModuleList([builder.layer(*row) for row in rows])
        self.inputs = [row[0] for row in rows]
        if not isinstance(self.model[-1], Detect):
            raise ValueError('the last layer is %s, not Detect' % rows[-1][2])
        self.stride = max(self.model[-1].strides)

    def forward(self, x):
        outputs = []
        for inputs, layer in zip(self.inputs, self.model):
            x = layer([outputs[i] for i in inputs] if isinstance(inputs, list) else outputs[inputs] if outputs else x)
            outputs.append(x)
        return x

    def fuse(self):
        """Fold all batch normalisations into the convolutions and switch to evaluation mode. Returns self."""
        self.eval()
        for module in self.modules():
            if isinstance(module, Conv):
                module.conv = nn.utils.fusion.fuse_conv_bn_eval(module.conv, module.bn)
                module.bn = nn.Identity()
        return self


BLOCKS = {'Conv': Conv, 'C3': C3, 'SPP': SPP, 'SPPF': SPPF, 'Focus': Focus}


class _Builder(object):
    def __init__(self, layout):
        self._class_count = layout['nc']
        anchors = layout['anchors']
        self._anchor_count = len(anchors[0]) // 2 if isinstance(anchors, (list, tuple)) else int(anchors)
        if not 0 < self._anchor_count <= MAX_ANCHORS:
            raise ValueError('%d anchors per scale; 1 to %d expected' % (self._anchor_count, MAX_ANCHORS))
        self._width, self._depth = float(layout['width_multiple']), float(layout['depth_multiple'])
        activation = layout.get('activation') or 'nn.SiLU()'
        if not isinstance(activation, str) or activation not in ACTIVATIONS:
            raise ValueError('unknown activation; one of %s expected' % ', '.join(sorted(ACTIVATIONS)))
        self._activation = ACTIVATIONS[activation]
        self._channels, self._strides, self._parameters = [], [], 0

    def layer(self, inputs, repeats, kind, arguments):
        """Build the next layer. The arguments are a row of the layout."""
        if not isinstance(kind, str) or (isinstance(inputs, list) and len(inputs) > MAX_SCALES):
            raise ValueError('layer %d is not a YOLOv5 layer' % len(self._channels))
        first = inputs[0] if isinstance(inputs, list) else inputs
        channels = self._channels[first] if self._channels else 3
        stride = self._strides[first] if self._strides else 1
        repeats = max(int(round(repeats * self._depth)), 1) if repeats > 1 else repeats
        if repeats > MAX_REPEATS:
            raise ValueError('%s is repeated %d times, more than %d' % (kind[:20], repeats, MAX_REPEATS))
        factor = 1
        if kind in BLOCKS:
            layer, channels, factor = self._block(kind, channels, repeats, list(arguments))
        elif kind == 'nn.Upsample':
            layer, factor = nn.Upsample(scale_factor=2, mode='nearest'), 0.5
        elif kind == 'Concat':
            layer, channels = Concat(), sum(self._channels[i] for i in inputs)
        elif kind == 'Detect':
            layer = Detect(self._class_count, self._anchor_count, [self._channels[i] for i in inputs],
                           [int(self._strides[i]) for i in inputs])
        else:
            raise ValueError('unknown layer %r' % kind[:50])
        self._channels.append(channels)
        self._strides.append(stride * factor)
        return layer

    def _block(self, kind, in_channels, repeats, arguments):
        """Build a layer with weights. Returns the layer, its output channels, and its stride."""
        out_channels, rest = arguments[0], arguments[1:]
        if out_channels != self._anchor_count * (self._class_count + 5):  # rounded up to a multiple of 8 as in YOLOv5
            out_channels = int(math.ceil(out_channels * self._width / 8) * 8)
        if out_channels <= 0:
            raise ValueError('a layer has %d channels; at least 1 expected' % out_channels)
        sizes = rest[0] if kind == 'SPP' and rest else rest
        if len(sizes) > 4 or not all(isinstance(n, int) and 0 <= n <= MAX_KERNEL for n in sizes):
            raise ValueError('kernel, stride and padding of %s are not integers from 0 to %d' % (kind, MAX_KERNEL))
        self._count_parameters(kind, in_channels, out_channels, repeats, sizes)
        if kind == 'C3':
            layers = [C3(in_channels, out_channels, repeats, *rest)]
        else:
            layers = [BLOCKS[kind](in_channels if i == 0 else out_channels, out_channels, *rest)
                      for i in range(repeats)]
        layer = layers[0] if len(layers) == 1 else nn.Sequential(*layers)
        for module in layer.modules():
            if isinstance(module, Conv):
                module.act = self._activation()
        stride = {'Conv': rest[1] if len(rest) > 1 else 1, 'Focus': 2}.get(kind, 1)
        return layer, out_channels, stride

    def _count_parameters(self, kind, in_channels, out_channels, repeats, sizes):
        """Count the weights of a layer before memory is allocated. Raises ValueError above MAX_PARAMETERS."""
        window = (sizes[0] if sizes else 1) ** 2
        self._parameters += {
            'Conv': repeats * in_channels * out_channels * window,
            'Focus': repeats * 4 * in_channels * out_channels * window,
            'C3': out_channels * (in_channels + out_channels) + 2.5 * repeats * out_channels ** 2,
            'SPP': repeats * (in_channels ** 2 / 2.0 + 2.5 * in_channels * out_channels),
            'SPPF': repeats * (in_channels ** 2 / 2.0 + 2 * in_channels * out_channels)}[kind]
        if self._parameters > MAX_PARAMETERS:
            raise ValueError('the layout has more than %d million parameters' % (MAX_PARAMETERS / 1e6))
