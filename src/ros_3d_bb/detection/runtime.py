"""What runs a network: one seam, so that the detector does not know whether torch or ONNX Runtime does.

A runtime is called with an image (height, width, 3), uint8, RGB, and a least objectness, and returns the predictions
above it (rows, 5 + classes), float32: x, y, width, height in pixels of the image, objectness, class scores. It has
`names`, the class names; `stride`, of which height and width must be multiples; `input_hw`, the one (height, width)
that it takes, or None where it takes any; and `description`, itself in words.
"""
import ctypes
import os
import warnings
from typing import NamedTuple

from ros_3d_bb.detection.checkpoint import WeightsError
from ros_3d_bb.detection.exports import export_folder, exported_runtime
from ros_3d_bb.detection.onnx_runtime import OnnxRuntime, OnnxUnusable
from ros_3d_bb.params import Param, parameters

RUNTIMES = ('auto', 'onnxruntime', 'torch')
MAX_THREADS = 4  # taken by itself; the networks that a robot's CPU can run gain little from more


@parameters()
class RuntimeParams(NamedTuple):
    """What runs the network, and where."""

    runtime: str = Param(
        'auto', 'What runs the network. ONNX Runtime takes half of the time of torch on a CPU; only torch runs on a '
        'GPU (device:=), in half precision. auto: torch on a GPU, else ONNX Runtime, or torch where that is not '
        'installed. A checkpoint (.pt) is exported to ONNX once, see export_folder.', choices=RUNTIMES)
    device: str = Param('auto')
    threads: int = Param(
        0, 'CPU threads of the network. 0: as many as this machine has cores, at most 4.', limits=(0, 1024))
    export_folder: str = Param(
        '', 'Folder for checkpoints exported to ONNX (four bytes for each weight), named by the SHA-256 of the '
        'checkpoint. It is created if missing and may be deleted at any time. Empty: ~/.cache/ros_3d_bb/onnx, or '
        'below XDG_CACHE_HOME or ROS_3D_BB_CACHE where set.')


def open_runtime(path, params=RuntimeParams(), warn=warnings.warn):
    """The runtime for a file of weights.

    Parameters
    ----------
    path : str
        An official checkpoint (.pt), or a model exported by YOLOv5 to TorchScript (.torchscript) or ONNX (.onnx).
        A TorchScript file is a program: run only those that you trust.
    params : RuntimeParams
    warn : callable
        Told, as a line of text, what is not as it was meant to be but does no harm.

    Raises
    ------
    WeightsError
        If the file cannot be used, or needs torch where that is missing; names the file and what was expected.
    ValueError
        If a parameter makes no sense, the device does not exist, or the runtime asked for cannot run this file.
    """
    threads = checked_threads(params)
    try:
        return _opened(str(path), params, threads, warn)
    except ImportError as error:
        if error.name != 'torch':
            raise
        raise WeightsError('weights %s: torch is not installed; install it with "pip3 install torch", or find people '
                           'without weights (detector:=depth)' % path)


def _opened(path, params, threads, warn):
    """The runtime for a kind of file. Torch, which is large and which few systems bring, is imported where needed."""
    if path.endswith('.onnx'):
        if params.runtime == 'torch':
            raise ValueError('runtime torch cannot run %s; use auto or onnxruntime, or the .pt checkpoint' % path)
        if params.device not in ('auto', 'cpu'):
            raise ValueError('device is %r, and %s runs on the CPU; use the .pt checkpoint' % (params.device, path))
        return OnnxRuntime(path, threads)
    if path.endswith(('.torchscript', '.torchscript.pt')):
        if params.runtime == 'onnxruntime':
            raise ValueError('runtime onnxruntime cannot run %s; use auto or torch, or the .pt checkpoint' % path)
        from ros_3d_bb.detection.torch_runtime import TorchScriptRuntime, torch_device
        return TorchScriptRuntime(path, torch_device(params.device), threads)
    return _of_checkpoint(path, params, threads, warn)


def _of_checkpoint(path, params, threads, warn):
    """ONNX Runtime on a CPU, where it is there and works: it takes half of torch's time. Torch on a GPU."""
    if params.runtime == 'onnxruntime' or params.runtime == 'auto' and not on_gpu(params.device):
        try:
            return exported_runtime(path, export_folder(params.export_folder), threads, warn)
        except OnnxUnusable as error:
            if params.runtime == 'onnxruntime':
                raise
            warn('%s; torch runs the network instead, which takes twice the time' % error)
    from ros_3d_bb.detection.torch_runtime import TorchRuntime, torch_device
    return TorchRuntime(path, torch_device(params.device), threads)


def on_gpu(device):
    """Whether a network for this device, 'auto' included, runs on a GPU.

    Torch, which takes a second and 200 MB to import, is asked only where NVIDIA's driver reports a GPU.
    """
    if device != 'auto':
        return not device.startswith('cpu')
    if gpu_count() == 0:
        return False
    try:
        from ros_3d_bb.detection.torch_runtime import torch_device
    except ImportError:  # without torch nothing runs there
        return False
    return torch_device('auto').type == 'cuda'


def gpu_count():
    """How many GPUs NVIDIA's driver reports; 0 where there is no driver."""
    count = ctypes.c_int(0)
    try:
        driver = ctypes.CDLL('libcuda.so.1')
        if driver.cuInit(0) == 0:
            driver.cuDeviceGetCount(ctypes.byref(count))
    except (OSError, AttributeError):  # no driver, or none worth the name
        pass
    return count.value


def checked_threads(params):
    """How many threads a runtime uses: as many as asked for, or as this machine has cores, up to MAX_THREADS.

    Raises
    ------
    ValueError
        If a parameter makes no sense.
    """
    if params.runtime == 'onnxruntime' and params.device not in ('auto', 'cpu'):
        raise ValueError('runtime onnxruntime works on the CPU, and device is %r; use runtime torch' % params.device)
    return params.threads or min(physical_cores(), MAX_THREADS)


def physical_cores():
    """Cores that this process may use; the two hardware threads of one core are one."""
    cores = set()
    for number in os.sched_getaffinity(0):
        try:
            with open('/sys/devices/system/cpu/cpu%d/topology/thread_siblings_list' % number) as stream:
                cores.add(stream.read())
        except OSError:
            cores.add(number)
    return len(cores)
