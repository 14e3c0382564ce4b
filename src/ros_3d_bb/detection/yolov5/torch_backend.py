"""Torch backends: checkpoints in the network of this package. See `backends`."""
import numpy as np
import torch

from ros_3d_bb.core.error_text import cause
from ros_3d_bb.detection.network_detector import batch_of
from ros_3d_bb.detection.weights import WeightsError
from ros_3d_bb.detection.yolov5.checkpoint import EXPECTED, read_checkpoint
from ros_3d_bb.detection.yolov5.network import Network
from ros_3d_bb.detection.yolov5.predictions import Backend, check_stride, decode_heads


def torch_device(name):
    """Return a torch.device that works; 'auto' is CUDA if available. Raises ValueError."""
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
    """Return the `network.Network` of a checkpoint, fused, float32, on the CPU, and its class names.

    Raises WeightsError if the checkpoint cannot be read, or its weights do not match its layout.
    """
    layout, names, weights = read_checkpoint(path)
    try:
        network = Network(layout)
        network.load_state_dict({name: torch.from_numpy(array.astype(np.float32)) for name, array in weights.items()
                                 if not name.endswith('.anchor_grid')})  # a second copy of the anchors in release 5.0
        stride = check_stride(network.stride)
        run(network.fuse(), np.zeros((stride, stride, 3), np.uint8), 0)
    except Exception as error:  # an invalid layout can raise any exception
        raise WeightsError('weights %s: the network cannot be built from its yaml (%s); %s'
                           % (path, cause(error), EXPECTED))
    return network, names


def run(network, image, min_objectness):
    """Predictions of a network for an image, see `predictions.Backend`."""
    detect, weight = network.model[-1], next(network.parameters())
    with torch.no_grad():
        heads = network(torch.from_numpy(batch_of(image)).to(weight.device, weight.dtype))
    return decode_heads([head.cpu().numpy() for head in heads], detect.anchors_px, detect.strides, min_objectness)


class TorchRuntime(Backend):
    """Official checkpoint in the network of this package."""

    def __init__(self, path, device, threads):
        network, self.names = network_of(path)
        self.stride = int(network.stride)
        # In half precision on a GPU; predictions are decoded in single precision.
        self._network = network.to(device).half() if device.type == 'cuda' else network
        self.description = description_of(device, threads)

    def __call__(self, image, min_objectness):
        return run(self._network, image, min_objectness)


def description_of(device, threads):
    """Set the number of threads of torch. Returns a description of the backend for logs."""
    if device.type != 'cpu':
        return 'torch on %s' % device
    torch.set_num_threads(threads)
    return 'torch on the CPU, threads: %d' % threads
