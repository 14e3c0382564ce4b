"""Networks of all kinds of model files, chosen by the suffix: torch and ONNX Runtime.

`open_runtime` returns a network for `network_detector.NetworkDetector`: one of the YOLOv5 backends, see
`predictions.Backend`, or an `onnx.onnx_model.OnnxModel`.
"""
import ctypes
import os
import re
import warnings
from typing import NamedTuple

import numpy as np

from ros_3d_bb.core.params import Param, check, parameters
from ros_3d_bb.detection.network_detector import DetectionParams, NetworkDetector
from ros_3d_bb.detection.onnx.onnx_model import OnnxModel, gpus_are_supported
from ros_3d_bb.detection.weights import WeightsError
from ros_3d_bb.detection.yolov5.onnx_backend import OnnxUnusable, export_folder, open_exported

MAX_THREADS = 4  # default maximum; small networks gain little from more threads
# ONNX files up to this size use one thread by default: with YOLOX-nano (3.7 MB) the pipeline takes 84 instead of 105 %
# of a core at 30 Hz, with the same latency.
SMALL_BYTES = 6 * 10 ** 6


@parameters('Detector yolov5')
class RuntimeParams(NamedTuple):
    """What runs the network, and where."""

    runtime: str = Param(
        'auto', 'What runs the network. ONNX Runtime takes half of the time of torch on a CPU; on a GPU (device:=), '
        'torch runs checkpoints, in half precision. auto: torch on a GPU, else ONNX Runtime, or torch where that is '
        'not installed. A checkpoint (.pt) is exported to ONNX once, see export_folder.',
        choices=('auto', 'onnxruntime', 'torch'))
    device: str = Param('auto')
    threads: int = Param(
        0, 'CPU threads of the network. 0: as many as this machine has cores, at most 4; one for ONNX files of up to 6 '
        'MB.', limits=(0, 1024))
    export_folder: str = Param(
        '', 'Folder for checkpoints exported to ONNX (four bytes for each weight), named by the SHA-256 of the '
        'checkpoint. It is created if missing and may be deleted at any time. Empty: ~/.cache/ros_3d_bb/onnx, or '
        'below XDG_CACHE_HOME or ROS_3D_BB_CACHE where set.')


def open_detector(weights, detection=DetectionParams(), running=RuntimeParams(), warn=warnings.warn):
    """Open a network as the nodes do, and return it as a `network_detector.NetworkDetector`.

    `warn` is called with the text of each warning. Raises ValueError if the network cannot be used.
    """
    detector = NetworkDetector(open_runtime(os.path.abspath(os.path.expanduser(weights)), running, warn), detection)
    detector.detect(np.zeros((480, 640, 3), np.uint8))  # the first detection takes several times as long as others
    return detector


def open_runtime(path, params=RuntimeParams(), warn=warnings.warn):
    """Load an official YOLOv5 checkpoint (.pt), or any known detector in an ONNX file (.onnx).

    `warn` is called with one line of text for problems that
    are worked around. Raises WeightsError if the file cannot be used, or needs torch and torch is not installed, and
    ValueError if a parameter is out of range, the device does not exist, or the runtime cannot run this file.
    """
    check(params)
    if params.runtime == 'onnxruntime' and params.device not in ('auto', 'cpu') and not str(path).endswith('.onnx'):
        raise ValueError('runtime onnxruntime works on the CPU, and device is %r; use runtime torch' % params.device)
    threads = params.threads or min(physical_cores(), MAX_THREADS)
    try:
        return _open_file(str(path), params, threads, warn)
    except ImportError as error:
        if error.name != 'torch':
            raise
        raise WeightsError('weights %s: torch is not installed; install it with "pip3 install torch", or use the '
                           'detector without weights (detector:=depth)' % path)


def _open_file(path, params, threads, warn):
    """Choose the backend. A checkpoint runs in torch on a GPU, and on a CPU in ONNX Runtime, which is twice as fast.

    Torch is large and optional, so it is imported only if it is needed.
    """
    if path.endswith('.onnx'):
        if params.runtime == 'torch':
            raise ValueError('runtime torch cannot run %s; use auto or onnxruntime, or the .pt checkpoint' % path)
        is_small = os.path.isfile(path) and os.path.getsize(path) <= SMALL_BYTES
        return OnnxModel(path, 1 if is_small and not params.threads else threads, gpu_for_onnx(params.device, path))

    if params.runtime == 'onnxruntime' or params.runtime == 'auto' and not on_gpu(params.device):
        try:
            return open_exported(path, export_folder(params.export_folder), threads, warn)
        except OnnxUnusable as error:
            if params.runtime == 'onnxruntime':
                raise
            warn('%s; using torch instead, which takes twice as long' % error)
    from ros_3d_bb.detection.yolov5.torch_backend import TorchRuntime, torch_device
    return TorchRuntime(path, torch_device(params.device), threads)


def gpu_for_onnx(device, path):
    """Number of the GPU on which ONNX Runtime runs a file; None for the CPU. Raises ValueError for other devices."""
    number = re.match(r'(?:auto|cuda(?::(\d{1,3}))?)\Z', device)
    if device == 'cpu' or device == 'auto' and not (gpu_count() and gpus_are_supported()):
        return None
    if number is None or not gpus_are_supported():
        raise ValueError('device is %r, but the installed ONNX Runtime cannot run %s on it; use auto, cpu or, with '
                         'onnxruntime-gpu, cuda' % (device, path))
    return int(number.group(1) or 0)


def on_gpu(device):
    """Whether the network runs on a GPU. For 'auto', torch, which takes a second and 200 MB, is imported only if
    NVIDIA's driver reports a GPU.
    """
    if device != 'auto':
        return not device.startswith('cpu')
    if gpu_count() == 0:
        return False
    try:
        from ros_3d_bb.detection.yolov5.torch_backend import torch_device
    except ImportError:  # only torch runs networks on a GPU
        return False
    return torch_device('auto').type == 'cuda'


def gpu_count():
    """Number of GPUs that NVIDIA's driver reports; 0 without a driver."""
    count = ctypes.c_int(0)
    try:
        driver = ctypes.CDLL('libcuda.so.1')
        if driver.cuInit(0) == 0:
            driver.cuDeviceGetCount(ctypes.byref(count))
    except (OSError, AttributeError):  # no driver, or an incomplete one
        pass
    return count.value


def physical_cores():
    """Number of physical cores that this process may use."""
    cores = set()
    for number in os.sched_getaffinity(0):
        try:
            with open('/sys/devices/system/cpu/cpu%d/topology/thread_siblings_list' % number) as stream:
                cores.add(stream.read())
        except OSError:
            cores.add(number)
    return len(cores)
