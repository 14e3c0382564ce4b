"""What runs a network: one seam, so that the detector does not know whether torch or ONNX Runtime does.

A runtime is called with a batch (1, 3, height, width), float32, RGB, 0..1, and returns its predictions
(rows, 5 + classes), float32: x, y, width, height in pixels of the batch, objectness, class scores. It has
`names`, the class names; `stride`, of which height and width must be multiples; and `input_hw`, the one
(height, width) that it takes, or None where it takes any.
"""
import ast
import json

import numpy as np
import torch

from ros_3d_bb.detection.checkpoint import EXPECTED, WeightsError, cause, class_names, read_checkpoint
from ros_3d_bb.detection.network import Network


def open_runtime(path, device='auto'):
    """The runtime for a file of weights.

    Parameters
    ----------
    path : str
        An official checkpoint (.pt), or a model exported by YOLOv5 to TorchScript (.torchscript) or ONNX (.onnx).
        A TorchScript file is a program: run only those that you trust.
    device : str
        'auto' (CUDA where there is a GPU, else the CPU), or a torch device: 'cpu', 'cuda', 'cuda:1'.

    Raises
    ------
    WeightsError
        If the file cannot be used; names the file and what was expected.
    ValueError
        If the device does not exist.
    """
    path = str(path)
    if path.endswith('.onnx'):
        return OnnxRuntime(path)
    if path.endswith(('.torchscript', '.torchscript.pt')):
        return TorchScriptRuntime(path, torch_device(device))
    return TorchRuntime(path, torch_device(device))


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


class TorchRuntime(object):
    """A network of ours with the weights of an official checkpoint."""

    input_hw = None

    def __init__(self, path, device):
        checkpoint = read_checkpoint(path)
        self.names, self._device = checkpoint.names, device
        try:
            network = Network(checkpoint.layout)
            network.load_state_dict({name: torch.from_numpy(array.astype(np.float32))
                                     for name, array in checkpoint.weights.items()
                                     if not name.endswith('.anchor_grid')})  # release 5.0 keeps the anchors twice
            self.stride = checked_stride(network.stride)
            self._network = network.fuse().to(device)
            self(np.zeros((1, 3, self.stride, self.stride), np.float32))
        except Exception as error:  # a layout is data from outside: whatever is wrong with it, say so once
            raise WeightsError('weights %s: the network cannot be rebuilt from the yaml inside (%s); %s'
                               % (path, cause(error), EXPECTED))

    def __call__(self, batch):
        with torch.no_grad():
            return self._network(torch.from_numpy(batch).to(self._device))[0].cpu().numpy()


class TorchScriptRuntime(object):
    """A model that YOLOv5 exported to TorchScript; it takes the one image size that it was exported for."""

    def __init__(self, path, device):
        extra = {'config.txt': ''}
        try:
            self._module = torch.jit.load(path, map_location=device, _extra_files=extra).eval()
            config = json.loads(extra['config.txt'] or '{}')
            self.input_hw = tuple(config.get('shape', (1, 3, 640, 640))[2:])
            self.stride = checked_stride(config.get('stride', 32))
            self._device = device
            columns = self(np.zeros((1, 3) + self.input_hw, np.float32)).shape[1]
        except Exception as error:  # a damaged file can raise anything; it all means the same
            raise WeightsError('weights %s: not a YOLOv5 TorchScript export (%s); expected the file that its export.py '
                               'writes (release 5.0: with --grid; without --half)' % (path, cause(error)))
        self.names = class_names(config.get('names'), columns - 5)

    def __call__(self, batch):
        with torch.no_grad():
            output = self._module(torch.from_numpy(batch).to(self._device))
        return predictions(output[0] if isinstance(output, (tuple, list)) else output).cpu().numpy()


class OnnxRuntime(object):
    """A model that YOLOv5 exported to ONNX, run on the CPU."""

    def __init__(self, path):
        try:
            import onnxruntime
        except ImportError:
            raise WeightsError('weights %s: running .onnx needs ONNX Runtime; install it with '
                               '"pip3 install onnxruntime", or use the .pt checkpoint' % path)
        try:
            self._session = onnxruntime.InferenceSession(path, providers=['CPUExecutionProvider'])
            entry = self._session.get_inputs()[0]
            self._input, self._dtype = entry.name, {'tensor(float16)': np.float16}.get(entry.type, np.float32)
            size = entry.shape[2:]
            self.input_hw = tuple(size) if all(isinstance(n, int) for n in size) else None
            metadata = self._session.get_modelmeta().custom_metadata_map
            self.stride = checked_stride(metadata.get('stride', 32))
            columns = self(np.zeros((1, 3) + (self.input_hw or (self.stride, self.stride)), np.float32)).shape[1]
            names = ast.literal_eval(metadata.get('names', 'None'))  # literals only: runs nothing
        except Exception as error:  # a damaged file can raise anything; it all means the same
            raise WeightsError('weights %s: not a YOLOv5 ONNX export (%s); expected the file that its export.py writes'
                               % (path, cause(error)))
        self.names = class_names(names, columns - 5)

    def __call__(self, batch):
        output = self._session.run(None, {self._input: batch.astype(self._dtype, copy=False)})[0]
        return predictions(output).astype(np.float32, copy=False)


def checked_stride(stride):
    """A stride as a positive int. Raises ValueError."""
    if not 1 <= int(stride) <= 1024:
        raise ValueError('its stride is %s' % stride)
    return int(stride)


def predictions(output):
    """The predictions (rows, 5 + classes) of the one image in an output (1, rows, 5 + classes).

    Raises
    ------
    ValueError
        If the output has another shape: the model is no YOLOv5 detector.
    """
    if len(output.shape) != 3 or output.shape[0] != 1 or output.shape[2] < 6:
        raise ValueError('its output has shape %s; (1, rows, 5 + classes) expected' % (tuple(output.shape),))
    return output[0]
