"""Runtimes by torch: checkpoints in a network of ours, and TorchScript exports. See `ros_3d_bb.detection.runtime`."""
import json

import numpy as np
import torch

from ros_3d_bb.detection.checkpoint import EXPECTED, WeightsError, cause, class_names, read_checkpoint
from ros_3d_bb.detection.network import Network
from ros_3d_bb.detection.predictions import batch_of, checked_stride, predictions


def torch_device(name):
    """The torch.device of that name, checked; 'auto' takes CUDA where it works."""
    if name == 'auto':
        return torch.device('cuda' if torch.cuda.is_available() else 'cpu')
    try:
        device = torch.device(name)
        torch.zeros(1, device=device)
    except (RuntimeError, AssertionError) as error:
        raise ValueError('device %r cannot be used (%s); use auto, cpu or, with an NVIDIA GPU, cuda'
                         % (name, cause(error)))
    return device


def network_of(path):
    """The network of a checkpoint and its class names: (Network, list), fused, float32, on the CPU.

    Raises
    ------
    WeightsError
        If the checkpoint cannot be read, or its weights do not fit the layout inside.
    """
    checkpoint = read_checkpoint(path)
    try:
        network = Network(checkpoint.layout)
        network.load_state_dict({name: torch.from_numpy(array.astype(np.float32))
                                 for name, array in checkpoint.weights.items()
                                 if not name.endswith('.anchor_grid')})  # release 5.0 keeps the anchors twice
        stride = checked_stride(network.stride)
        run(network.fuse(), np.zeros((stride, stride, 3), np.uint8))
    except Exception as error:  # a layout is data from outside: whatever is wrong with it, say so once
        raise WeightsError('weights %s: the network cannot be rebuilt from the yaml inside (%s); %s'
                           % (path, cause(error), EXPECTED))
    return network, checkpoint.names


def run(network, image):
    """All predictions of a network for an image (height, width, 3), uint8, as a tensor where the network is."""
    weight = next(network.parameters())
    with torch.no_grad():
        return network(torch.from_numpy(batch_of(image)).to(weight.device, weight.dtype))[0]


class TorchRuntime(object):
    """A network of ours with the weights of an official checkpoint; in half precision where there is a GPU."""

    input_hw = None

    def __init__(self, path, device, threads):
        network, self.names = network_of(path)
        self.stride = int(network.stride)
        self._network = moved(network, device)
        self.description = said(device, threads)

    def __call__(self, image, least):
        rows = run(self._network, image)
        return rows[rows[:, 4] > least].cpu().numpy()


class TorchScriptRuntime(object):
    """A model that YOLOv5 exported to TorchScript; it takes the one image size that it was exported for."""

    def __init__(self, path, device, threads):
        extra = {'config.txt': ''}
        self.description = said(device, threads)
        try:
            self._module = torch.jit.load(path, map_location=device, _extra_files=extra).eval()
            config = json.loads(extra['config.txt'] or '{}')
            self.input_hw = tuple(config.get('shape', (1, 3, 640, 640))[2:])
            self.stride = checked_stride(config.get('stride', 32))
            self._device = device
            columns = self(np.zeros(self.input_hw + (3,), np.uint8), 0).shape[1]
        except Exception as error:  # a damaged file can raise anything; it all means the same
            raise WeightsError('weights %s: not a YOLOv5 TorchScript export (%s); expected the file that its export.py '
                               'writes (release 5.0: with --grid; without --half)' % (path, cause(error)))
        self.names = class_names(config.get('names'), columns - 5)

    def __call__(self, image, least):
        with torch.no_grad():
            output = self._module(torch.from_numpy(batch_of(image)).to(self._device))
        rows = predictions(output[0] if isinstance(output, (tuple, list)) else output)
        return rows[rows[:, 4] > least].cpu().numpy()


def moved(network, device):
    """A network on a device, in half precision on a GPU; its predictions are decoded in single precision."""
    return network.to(device).half() if device.type == 'cuda' else network


def said(device, threads):
    """Let torch use so many threads, and say in words what it works on."""
    if device.type != 'cpu':
        return 'torch on %s' % device
    torch.set_num_threads(threads)
    return 'torch on the CPU, %d thread%s' % (threads, '' if threads == 1 else 's')
