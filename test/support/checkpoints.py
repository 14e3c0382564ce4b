"""Checkpoints with random weights in the official format: pickled instances of classes of `models`."""
import contextlib
import sys
import types

import numpy as np
import torch

from ros_3d_bb.detection.yolov5.network import Bottleneck, C3, Concat, Conv, Detect, Focus, Network, SPP, SPPF


def write_checkpoint(path, layout, yaml=None, root='Model', anchor_grid=False):
    """Write a checkpoint of random float16 weights and return its network.

    `yaml` is the layout in the file, by default that of the weights; `root` is the model's class in `models.yolo`:
    Model (to release 6.1), DetectionModel (6.2 on), or another. With `anchor_grid`, the anchors are stored twice, as in
    release 5.0.
    """
    network = random_network(layout).half()
    if anchor_grid:
        network.model[-1].register_buffer('anchor_grid', network.model[-1].anchors.clone().view(-1, 1, 3, 1, 1, 2))
    with official_classes(root) as classes:
        for module in network.modules():
            module.__class__ = classes.get(type(module), type(module))
        network.yaml = yaml or layout
        network.names = ['person'] + ['thing %d' % number for number in range(1, layout['nc'])]
        torch.save({'epoch': -1, 'model': network, 'ema': None, 'optimizer': None}, path)
        ours = {official: own for own, official in classes.items()}
        for module in network.modules():
            module.__class__ = ours.get(type(module), type(module))
    return network.float()


def random_network(layout, seed=0):
    """A network with random weights, statistics that preserve the signal, and the anchors of the layout."""
    torch.manual_seed(seed)
    network = Network(layout)
    for module in network.modules():
        if isinstance(module, torch.nn.BatchNorm2d):
            module.running_mean.uniform_(-0.1, 0.1)
            module.running_var.uniform_(0.5, 1.5)
    detect = network.model[-1]
    anchors = torch.tensor(np.reshape(layout['anchors'], (len(detect.strides), -1, 2)), dtype=torch.float32)
    detect.anchors.copy_(anchors / torch.tensor(detect.strides, dtype=torch.float32).view(-1, 1, 1))
    return network.eval()


@contextlib.contextmanager
def official_classes(root='Model'):
    """Context with modules `models.common` and `models.yolo` of empty official classes; yields {our class: theirs}."""
    modules = {name: types.ModuleType(name) for name in ('models', 'models.common', 'models.yolo')}
    classes = {}
    for own in (Conv, C3, Bottleneck, SPP, SPPF, Focus, Concat, Detect, Network):
        module = 'models.yolo' if own in (Detect, Network) else 'models.common'
        name = root if own is Network else own.__name__
        classes[own] = type(name, (torch.nn.Module,), {'__module__': module})
        setattr(modules[module], name, classes[own])
    sys.modules.update(modules)
    try:
        yield classes
    finally:
        for name in modules:
            del sys.modules[name]
