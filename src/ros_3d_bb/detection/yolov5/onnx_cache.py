"""Cache of checkpoints that are exported to ONNX.

A cached file is named by the SHA-256 of its checkpoint and by `VERSION`, and accepts images of any size. It ends with
its own SHA-256, and contains the output of torch for a reference image, which ONNX Runtime must reproduce each time the
file is loaded. Loading a cached file executes no code from it; torch is needed only to create it.
"""
import hashlib
import os

from ros_3d_bb.core.atomic_file import atomic_write
from ros_3d_bb.core.error_text import cause
from ros_3d_bb.detection.yolov5.checkpoint import checkpoint_digest
from ros_3d_bb.detection.yolov5.onnx_backend import INSTALL, ExportedRuntime, OnnxUnusable
from ros_3d_bb.detection.yolov5.onnx_writer import metadata_entry

VERSION = 1  # of the cached files; increase it when network.py or onnx_export.py change their content


def open_exported(path, folder, threads, warn):
    """Open a checkpoint as an `onnx_backend.ExportedRuntime`, from the cache in `folder` if it is there.

    The folder is created if missing. If it cannot be written, the export is used from memory. `warn` is called with one
    line of text for problems that are worked around.

    Raises
    ------
    WeightsError
        If the checkpoint cannot be used.
    OnnxUnusable
        If ONNX Runtime is not installed, or its output differs from torch's.
    """
    try:
        import onnxruntime  # noqa: F401
    except ImportError:
        raise OnnxUnusable(INSTALL)
    digest = checkpoint_digest(path)
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
        atomic_write(file_path, with_checksum(model))
    except OSError as error:
        warn('the ONNX export cannot be saved (%s); the checkpoint will be exported again at the next start'
             % cause(error))
    return runtime


def export_folder(folder=''):
    """Absolute path of the cache: `folder`, or by default a folder in the user's cache, the same that ./run uses."""
    cache = os.environ.get('ROS_3D_BB_CACHE') or os.path.join(
        os.environ.get('XDG_CACHE_HOME') or os.path.join('~', '.cache'), 'ros_3d_bb')
    return os.path.abspath(os.path.expanduser(folder or os.path.join(cache, 'onnx')))


def with_checksum(model):
    """Append the SHA-256 of a model to its metadata. The result is still a valid ONNX file."""
    return model + metadata_entry('sha256', hashlib.sha256(model).hexdigest())


def _open_cached(path, digest, threads):
    with open(path, 'rb') as stream:
        content = stream.read()
    model = content[:-len(with_checksum(b''))]
    if with_checksum(model) != content:
        raise ValueError('its checksum is wrong')
    runtime = ExportedRuntime(model, threads)
    if runtime.checkpoint != digest:
        raise ValueError('it was exported from another checkpoint')
    return runtime
