"""Checkpoints exported to ONNX once, and kept in a folder.

A file there is named by the SHA-256 of its checkpoint and by `VERSION`; it takes images of any size. It ends in its own
SHA-256, and holds what torch made of a reference image, which ONNX Runtime has to repeat each time that it is loaded.
It is read as numbers and names and runs no code; torch is needed only to make it.
"""
import base64
import hashlib
import json
import os

import numpy as np

from ros_3d_bb.detection.checkpoint import cause, checkpoint_digest
from ros_3d_bb.detection.onnx_file import metadata_entry
from ros_3d_bb.detection.onnx_runtime import INSTALL, ExportedRuntime, OnnxUnusable, reference_image
from ros_3d_bb.session_file import write_whole

VERSION = 1  # of the files; to be raised when network.py or onnx_export.py make other ones


def exported_runtime(path, folder, threads, warn):
    """ONNX Runtime for a checkpoint, from the folder where that has it.

    Parameters
    ----------
    path : str
        An official checkpoint (.pt).
    folder : str
        Made if missing. Where it cannot be written, the export is kept in memory.
    threads : int
    warn : callable
        Told, as a line of text, what went wrong without harm.

    Raises
    ------
    WeightsError
        If the checkpoint cannot be used.
    OnnxUnusable
        If ONNX Runtime is not there, or finds something else than torch does.
    """
    try:
        import onnxruntime  # noqa: F401
    except ImportError:
        raise OnnxUnusable(INSTALL)
    digest = checkpoint_digest(path)
    file_path = os.path.join(folder, '%s-%d.onnx' % (digest, VERSION))
    try:
        return _kept(file_path, digest, threads)
    except FileNotFoundError:
        pass
    except (OSError, ValueError) as error:
        warn('%s cannot be used (%s); it is made again' % (file_path, cause(error)))
    model = export(path, digest)
    runtime = ExportedRuntime(model, threads)
    try:
        os.makedirs(folder, mode=0o700, exist_ok=True)
        write_whole(file_path, sealed(model))
    except OSError as error:
        warn('the network exported to ONNX cannot be kept (%s); it will be made again at the next start' % cause(error))
    return runtime


def export_folder(given=''):
    """Where exports are kept: the folder given, or one in the user's cache, as ./run has it."""
    cache = os.environ.get('ROS_3D_BB_CACHE') or os.path.join(
        os.environ.get('XDG_CACHE_HOME') or os.path.join('~', '.cache'), 'ros_3d_bb')
    return os.path.abspath(os.path.expanduser(given or os.path.join(cache, 'onnx')))


def export(path, digest):
    """A checkpoint as an ONNX model with its names, its anchors, and what torch makes of the reference image: bytes."""
    from ros_3d_bb.detection.onnx_export import exported  # torch takes a second and 200 MB to import
    from ros_3d_bb.detection.torch_runtime import network_of, run
    network, names = network_of(path)
    detect, stride = network.model[-1], int(network.stride)
    reference = run(network, reference_image(stride)).numpy()
    anchors_px = detect.anchors.numpy() * np.reshape(detect.strides, (-1, 1, 1))
    return exported(network, {'about': json.dumps({
        'checkpoint': digest, 'names': names, 'stride': stride, 'strides': detect.strides,
        'anchors_px': anchors_px.tolist(), 'reference': base64.b64encode(reference.astype('<f4').tobytes()).decode()})})


def sealed(model):
    """A model with its SHA-256 as a last entry of its metadata, which leaves it a model."""
    return model + metadata_entry('sha256', hashlib.sha256(model).hexdigest())


def _kept(path, digest, threads):
    with open(path, 'rb') as stream:
        content = stream.read()
    model = content[:-len(sealed(b''))]
    if sealed(model) != content:
        raise ValueError('it is damaged')
    runtime = ExportedRuntime(model, threads)
    if runtime.checkpoint != digest:
        raise ValueError('it is of another checkpoint')
    return runtime
