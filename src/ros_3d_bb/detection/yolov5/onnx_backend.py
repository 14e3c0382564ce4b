"""Cache of YOLOv5 checkpoints that are exported to ONNX, for ONNX Runtime on the CPU. See `backends`.

A cached file is named by the SHA-256 of its checkpoint and by `VERSION`, and accepts images of any size. It
contains the output of torch for a reference image, which ONNX Runtime must reproduce each time the file is loaded.
Loading a cached file executes no code from it; torch is needed only to create it.
"""
import base64
import hashlib
import json
import os

import numpy as np

from ros_3d_bb.core.atomic_file import atomic_write
from ros_3d_bb.core.error_text import cause
from ros_3d_bb.detection.onnx.onnx_model import INSTALL, session_of
from ros_3d_bb.detection.yolov5.checkpoint import unreadable
from ros_3d_bb.detection.yolov5.predictions import Backend, decode_heads, reference_image

VERSION = 2  # of the cached files; increase it when network.py or onnx_export.py change their content
# Maximum difference between ONNX Runtime and torch. Measured with yolov5n: 3e-4 px, 1e-6.
MAX_DIFFERENCE_PX, MAX_DIFFERENCE = 0.05, 1e-3


class OnnxUnusable(ValueError):
    """ONNX Runtime is not installed, or cannot run a network."""


class ExportedRuntime(Backend):
    """Checkpoint that was exported to ONNX by `onnx_export`; `model` is the content of the ONNX file.

    Raises OnnxUnusable if the file has another origin, or if the output for the reference image differs from torch's.
    """

    def __init__(self, model, threads):
        self.description = 'ONNX Runtime on the CPU, threads: %d' % threads
        try:
            self._session = session_of(model, threads)
            about = json.loads(self._session.get_modelmeta().custom_metadata_map['about'])
            self.names, self.stride, self.checkpoint = about['names'], about['stride'], about['checkpoint']
            self._anchors_px, self._strides = np.array(about['anchors_px'], np.float32), about['strides']
            expected = np.frombuffer(base64.b64decode(about['reference']), '<f4')
            rows = self(reference_image(self.stride), -1)
            difference = np.abs(rows - expected.reshape(rows.shape)).max(axis=0)
        except Exception as error:  # a foreign file can raise any exception
            raise OnnxUnusable('ONNX Runtime cannot run the exported network (%s)' % cause(error))
        # False for numbers that are not finite.
        if not ((difference[:4] <= MAX_DIFFERENCE_PX).all() and (difference[4:] <= MAX_DIFFERENCE).all()):
            raise OnnxUnusable('the output of ONNX Runtime differs from that of torch')

    def __call__(self, image, min_objectness):
        heads = self._session.run(None, {'image': np.ascontiguousarray(image)[None]})
        return decode_heads(heads, self._anchors_px, self._strides, min_objectness)


def open_exported(path, folder, threads, warn):
    """Open a checkpoint as an `ExportedRuntime`, from the cache in `folder` if it is there.

    The folder is created if missing. If it cannot be written, the export is used from memory. `warn` is called with one
    line of text for problems that are worked around.

    Raises WeightsError if the checkpoint cannot be used, and OnnxUnusable if ONNX Runtime is not installed, or its
    output differs from torch's.
    """
    try:
        import onnxruntime  # noqa: F401
    except ImportError:
        raise OnnxUnusable(INSTALL)
    try:
        with open(path, 'rb') as stream:
            digest = hashlib.sha256(stream.read()).hexdigest()
    except OSError as error:
        raise unreadable(path, error)

    file_path = os.path.join(folder, '%s-%d.onnx' % (digest, VERSION))
    try:
        return _open_cached(file_path, digest, threads)
    except FileNotFoundError:
        pass
    except (OSError, ValueError) as error:
        warn('%s cannot be used (%s); exporting the checkpoint again' % (file_path, cause(error)))
    from ros_3d_bb.detection.yolov5 import onnx_export  # imports torch, which takes a second and 200 MB
    model = onnx_export.export(path, digest)
    runtime = ExportedRuntime(model, threads)
    try:
        os.makedirs(folder, mode=0o700, exist_ok=True)
        atomic_write(file_path, model)
    except OSError as error:
        warn('the ONNX export cannot be saved (%s); the checkpoint will be exported again at the next start'
             % cause(error))
    return runtime


def export_folder(folder=''):
    """Absolute path of the cache: `folder`, or by default a folder in the user's cache, the same that ./run uses."""
    cache = os.environ.get('ROS_3D_BB_CACHE') or os.path.join(
        os.environ.get('XDG_CACHE_HOME') or os.path.join('~', '.cache'), 'ros_3d_bb')
    return os.path.abspath(os.path.expanduser(folder or os.path.join(cache, 'onnx')))


def _open_cached(path, digest, threads):
    with open(path, 'rb') as stream:
        content = stream.read()
    runtime = ExportedRuntime(content, threads)
    if runtime.checkpoint != digest:
        raise ValueError('it was exported from another checkpoint')
    return runtime
