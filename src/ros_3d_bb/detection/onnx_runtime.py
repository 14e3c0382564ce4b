"""Runtimes by ONNX Runtime, on the CPU. See `ros_3d_bb.detection.runtime`."""
import ast
import base64
import json

import numpy as np

from ros_3d_bb.detection.checkpoint import WeightsError, cause, class_names
from ros_3d_bb.detection.predictions import batch_of, checked_stride, decoded_heads, predictions

# How far ONNX Runtime may be from torch. Measured with yolov5n: 3e-4 px, 1e-6.
MAX_DIFFERENCE_PX, MAX_DIFFERENCE = 0.05, 1e-3
INSTALL = 'ONNX Runtime is not installed; install it with "pip3 install onnxruntime"'


class OnnxUnusable(ValueError):
    """ONNX Runtime cannot run a network here: says why."""


class OnnxRuntime(object):
    """A model that YOLOv5 exported to ONNX."""

    def __init__(self, path, threads):
        try:
            import onnxruntime  # noqa: F401
        except ImportError:
            raise WeightsError('weights %s: %s, or use the .pt checkpoint' % (path, INSTALL))
        self.description = said(threads)
        try:
            self._session = session_of(path, threads)
            entry = self._session.get_inputs()[0]
            self._input, self._dtype = entry.name, {'tensor(float16)': np.float16}.get(entry.type, np.float32)
            size = entry.shape[2:]
            self.input_hw = tuple(size) if all(isinstance(n, int) for n in size) else None
            metadata = self._session.get_modelmeta().custom_metadata_map
            self.stride = checked_stride(metadata.get('stride', 32))
            columns = self(np.zeros((self.input_hw or (self.stride,) * 2) + (3,), np.uint8), 0).shape[1]
            names = ast.literal_eval(metadata.get('names', 'None'))  # literals only: runs nothing
        except Exception as error:  # a damaged file can raise anything; it all means the same
            raise WeightsError('weights %s: not a YOLOv5 ONNX export (%s); expected the file that its export.py writes'
                               % (path, cause(error)))
        self.names = class_names(names, columns - 5)

    def __call__(self, image, least):
        batch = batch_of(image).astype(self._dtype, copy=False)
        rows = predictions(self._session.run(None, {self._input: batch})[0])
        return rows[rows[:, 4] > least].astype(np.float32, copy=False)


class ExportedRuntime(object):
    """A checkpoint that `ros_3d_bb.detection.exports` made an ONNX model of.

    Parameters
    ----------
    model : bytes
    threads : int

    Raises
    ------
    OnnxUnusable
        If the model is another one, or if ONNX Runtime does not make of the reference image what torch made of it.
    """

    input_hw = None

    def __init__(self, model, threads):
        self.description = said(threads)
        try:
            self._session = session_of(model, threads)
            about = json.loads(self._session.get_modelmeta().custom_metadata_map['about'])
            self.names, self.stride, self.checkpoint = about['names'], about['stride'], about['checkpoint']
            self._anchors_px, self._strides = np.array(about['anchors_px'], np.float32), about['strides']
            expected = np.frombuffer(base64.b64decode(about['reference']), '<f4')
            found = self(reference_image(self.stride), -1)
        except Exception as error:  # a foreign file can raise anything; it all means the same
            raise OnnxUnusable('ONNX Runtime cannot run the exported network (%s)' % cause(error))
        if found.size != expected.size or not agree(found, expected.reshape(found.shape)):
            raise OnnxUnusable('ONNX Runtime finds something else than torch')

    def __call__(self, image, least):
        heads = self._session.run(None, {'image': np.ascontiguousarray(image)[None]})
        return decoded_heads(heads, self._anchors_px, self._strides, least)


def reference_image(stride):
    """The image that runtimes are compared at: noise, 2 strides high and 3 wide."""
    return np.random.RandomState(0).randint(0, 256, (2 * stride, 3 * stride, 3)).astype(np.uint8)


def agree(rows, others):
    """Whether two arrays of predictions are the same but for rounding; False where one is not finite."""
    difference = np.abs(rows - others).max(axis=0)
    return bool((difference[:4] <= MAX_DIFFERENCE_PX).all() and (difference[4:] <= MAX_DIFFERENCE).all())


def session_of(model, threads):
    """An onnxruntime.InferenceSession of a path or of bytes.

    Threads sleep while they wait: by default they spin, which takes a core from other nodes, and with two threads on
    one free core doubles the time.
    """
    import onnxruntime
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads, options.inter_op_num_threads = threads, 1
    options.log_severity_level = 3
    if hasattr(options, 'add_session_config_entry'):  # since 1.5
        options.add_session_config_entry('session.intra_op.allow_spinning', '0')
    return onnxruntime.InferenceSession(model, options, providers=['CPUExecutionProvider'])


def said(threads):
    """The runtime in words."""
    return 'ONNX Runtime, %d thread%s' % (threads, '' if threads == 1 else 's')
