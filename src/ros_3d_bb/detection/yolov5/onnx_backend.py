"""ONNX Runtime backends, on the CPU. See `ros_3d_bb.detection.yolov5.backends`."""
import ast
import base64
import json

import numpy as np

from ros_3d_bb.core.error_text import cause
from ros_3d_bb.detection.yolov5.checkpoint import WeightsError, class_names
from ros_3d_bb.detection.yolov5.predictions import batch_of, check_stride, decode_heads, predictions

# Maximum difference between ONNX Runtime and torch. Measured with yolov5n: 3e-4 px, 1e-6.
MAX_DIFFERENCE_PX, MAX_DIFFERENCE = 0.05, 1e-3
INSTALL = 'ONNX Runtime is not installed; install it with "pip3 install onnxruntime"'


class OnnxUnusable(ValueError):
    """ONNX Runtime is not installed, or cannot run a network."""


class OnnxRuntime(object):
    """Model that was exported to ONNX by YOLOv5's export.py."""

    def __init__(self, path, threads):
        try:
            import onnxruntime  # noqa: F401
        except ImportError:
            raise WeightsError('weights %s: %s, or use the .pt checkpoint' % (path, INSTALL))
        self.description = 'ONNX Runtime on the CPU, threads: %d' % threads
        try:
            self._session = session_of(path, threads)
            entry = self._session.get_inputs()[0]
            self._input, self._dtype = entry.name, {'tensor(float16)': np.float16}.get(entry.type, np.float32)
            size = entry.shape[2:]
            self.input_hw = tuple(size) if all(isinstance(n, int) for n in size) else None
            metadata = self._session.get_modelmeta().custom_metadata_map
            self.stride = check_stride(metadata.get('stride', 32))
            columns = self(np.zeros((self.input_hw or (self.stride,) * 2) + (3,), np.uint8), 0).shape[1]
            names = ast.literal_eval(metadata.get('names', 'None'))  # executes no code
        except Exception as error:  # a damaged file can raise any exception
            raise WeightsError('weights %s: not a YOLOv5 ONNX export (%s); expected the file that its export.py writes'
                               % (path, cause(error)))
        self.names = class_names(names, columns - 5)

    def __call__(self, image, min_objectness):
        batch = batch_of(image).astype(self._dtype, copy=False)
        rows = predictions(self._session.run(None, {self._input: batch})[0])
        return rows[rows[:, 4] > min_objectness].astype(np.float32, copy=False)


class ExportedRuntime(object):
    """Checkpoint that was exported to ONNX by `onnx_export`; `model` is the content of the ONNX file.

    Raises OnnxUnusable if the file has another origin, or if the output for the reference image differs from torch's.
    """

    input_hw = None

    def __init__(self, model, threads):
        self.description = 'ONNX Runtime on the CPU, threads: %d' % threads
        try:
            self._session = session_of(model, threads)
            about = json.loads(self._session.get_modelmeta().custom_metadata_map['about'])
            self.names, self.stride, self.checkpoint = about['names'], about['stride'], about['checkpoint']
            self._anchors_px, self._strides = np.array(about['anchors_px'], np.float32), about['strides']
            expected = np.frombuffer(base64.b64decode(about['reference']), '<f4')
            rows = self(reference_image(self.stride), -1)
        except Exception as error:  # a foreign file can raise any exception
            raise OnnxUnusable('ONNX Runtime cannot run the exported network (%s)' % cause(error))
        if not (rows.size == expected.size and _are_close(rows, expected.reshape(rows.shape))):
            raise OnnxUnusable('the output of ONNX Runtime differs from that of torch')

    def __call__(self, image, min_objectness):
        heads = self._session.run(None, {'image': np.ascontiguousarray(image)[None]})
        return decode_heads(heads, self._anchors_px, self._strides, min_objectness)


def reference_image(stride):
    """Noise image, 2 strides high and 3 strides wide, for the comparison of backends."""
    return np.random.RandomState(0).randint(0, 256, (2 * stride, 3 * stride, 3)).astype(np.uint8)


def _are_close(rows, expected):
    """Whether two arrays of predictions are equal within rounding errors; False if a number is not finite."""
    difference = np.abs(rows - expected).max(axis=0)
    return (difference[:4] <= MAX_DIFFERENCE_PX).all() and (difference[4:] <= MAX_DIFFERENCE).all()


def session_of(model, threads):
    """Create an onnxruntime.InferenceSession, from a path or from bytes, whose waiting threads sleep.

    By default they spin, which takes a core from other nodes, and doubles the inference time if two share a free core.
    """
    import onnxruntime
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads, options.inter_op_num_threads = threads, 1
    options.log_severity_level = 3
    if hasattr(options, 'add_session_config_entry'):  # since 1.5
        options.add_session_config_entry('session.intra_op.allow_spinning', '0')
    return onnxruntime.InferenceSession(model, options, providers=['CPUExecutionProvider'])
