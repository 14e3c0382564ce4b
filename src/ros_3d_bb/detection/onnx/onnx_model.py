"""Detection networks in ONNX files, run by ONNX Runtime.

The head is recognised by the outputs for a grey image (`heads`); a YAML file beside the ONNX file can give the names of
the classes.
"""
import ast
import functools

import numpy as np

from ros_3d_bb.core.error_text import cause
from ros_3d_bb.detection.network_detector import BGR, GREY, MAX_INPUT_PX, RGB, batch_of
from ros_3d_bb.detection.onnx.heads import HEADS, layout_of
from ros_3d_bb.detection.weights import MAX_CLASSES, WeightsError, class_names, names_beside

INSTALL = ('ONNX Runtime is not installed; install it with "pip3 install onnxruntime" ("onnxruntime<1.11" on Ubuntu '
           '18.04 and 20.04, see doc/installing.md)')
TWO_FILES = ('its weights are in a second file; onnx.save(onnx.load("IN.onnx"), "OUT.onnx") in Python writes them to '
             'one file')
LOCATION = b'\x0a\x08location'  # key of the name of that file, with its field number and length
CPU, CUDA = 'CPUExecutionProvider', 'CUDAExecutionProvider'
DTYPES = {'tensor(float)': np.float32, 'tensor(float16)': np.float16, 'tensor(uint8)': np.uint8}
MAX_STRIDE = 1024
MAX_OUTPUT_BYTES = 2 ** 28
MAX_SCORE = 1.005  # with the rounding of float16 and of quantized networks
MAX_METADATA = 10 ** 6  # characters
MAX_LISTED, MAX_LIST_LENGTH = 20, 2000  # inputs or outputs in a message, and characters


class OnnxModel(object):
    """Network of an ONNX file, for `network_detector.NetworkDetector`.

    Raises WeightsError if the file cannot be used: it is damaged, its outputs are those of no known head, or the YAML
    file with its class names is invalid.
    """

    def __init__(self, path, threads, gpu=None):
        self.description = 'ONNX Runtime on ' + ('the CPU, threads: %d' % threads if gpu is None else 'cuda:%d' % gpu)
        names, self._session = names_beside(path), None
        try:
            with open(path, 'rb') as stream:
                content = stream.read()
            self._session = session_of(content, threads, gpu)
            self._configure(names, self._session.get_modelmeta().custom_metadata_map)
        except ImportError:
            raise WeightsError('weights %s: %s, or use the .pt checkpoint' % (path, INSTALL))
        except OSError as error:
            raise WeightsError('weights %s: cannot be read (%s)' % (path, error.strerror))
        except Exception as error:  # a damaged file can raise any exception
            reason = TWO_FILES if self._session is None and LOCATION in content else cause(error)
            raise WeightsError('weights %s: %s%s' % (path, reason, _signature(self._session)))

    def _configure(self, names, metadata):
        """Read the input, recognise the head by the outputs for a grey image, and set the attributes."""
        entry, *others = self._session.get_inputs()
        if others:
            raise ValueError('it has %d inputs; one image expected: export it without postprocessing'
                             % (1 + len(others)))
        if entry.type not in DTYPES:
            raise ValueError('its input is a %s; one of %s expected' % (entry.type, ', '.join(DTYPES)))
        self._input, self._dtype = entry.name, DTYPES[entry.type]
        self._channels_last, self.input_hw = _input_layout(entry.shape)
        self.stride = _stride(metadata)
        probe_hw = self.input_hw or (3 * max(64, self.stride), 4 * max(64, self.stride))
        probe = np.full(probe_hw + (3,), GREY, np.uint8)
        names = names or _names(metadata)
        self._prepare = _preprocessing(self._dtype, HEADS['yolov5'])
        outputs = self._run(probe)
        self._layout = layout_of(outputs, probe_hw, metadata, names)
        self.stride = max((self.stride,) + self._layout.strides)
        self._head = HEADS[self._layout.head]
        self.description += ', head: %s' % self._layout.head
        self.names = class_names(names or None, self._layout.classes)
        self.suppressed, self.padding = self._head.suppressed, self._head.padding
        self._prepare = _preprocessing(self._dtype, self._head)
        self.candidates(probe, 0.0)

    def candidates(self, image, confidence):
        """Detections in an image with a score above the confidence, see `network_detector.NetworkDetector`."""
        outputs = self._run(image)
        found = self._head.decode([outputs[0].astype(np.float32, copy=False)], image.shape[:2], self._layout.classes,
                                  confidence, self._layout.strides)
        best = found.scores.max() if len(found.scores) else 0.0
        if best > MAX_SCORE:
            raise ValueError('its scores are up to %.3g; 0 to 1 expected: its outputs are not those of the head %s'
                             % (best, self._layout.head))
        return found

    def _run(self, image):
        """Outputs of the network for an RGB image (height, width, 3), uint8; ValueError if they are too large."""
        batch = self._prepare(image)
        if self._channels_last:
            batch = np.ascontiguousarray(batch.transpose(0, 2, 3, 1))
        try:
            outputs = self._session.run(None, {self._input: batch})
        except Exception as error:  # ONNX Runtime has a type of exception for each cause
            raise ValueError('the network cannot process an image of %d x %d pixels (%s); export it with a fixed size'
                             % (image.shape[1], image.shape[0], cause(error)))
        outputs = [output[None] if output.ndim == 2 else output for output in outputs]  # exports without a batch axis
        if sum(output.nbytes for output in outputs) > MAX_OUTPUT_BYTES:
            raise ValueError('its outputs are larger than %d MB' % (MAX_OUTPUT_BYTES // 2 ** 20))
        return outputs


def _preprocessing(dtype, head):
    return functools.partial(batch_of, order=BGR if head.color == 'bgr' else RGB, dtype=dtype,
                             scale=1.0 if dtype == np.uint8 else head.scale)


def _input_layout(shape):
    """Whether the channels of an input are last, and its (height, width), None if dynamic. Raises ValueError."""
    if len(shape) != 4 or (isinstance(shape[0], int) and shape[0] != 1):
        raise ValueError('its input is not one image: export it with a batch of 1')
    channels_last = shape[3] == 3 and shape[1] != 3
    if not channels_last and isinstance(shape[1], int) and shape[1] != 3:
        raise ValueError('its input has %d channels; 3 expected' % shape[1])
    size = tuple(shape[1:3] if channels_last else shape[2:])
    fixed = [isinstance(length, int) for length in size]
    if not any(fixed):
        return channels_last, None
    if not all(fixed) or not all(0 < length <= MAX_INPUT_PX for length in size):
        raise ValueError('its input has the size %s; both 1 to %d, or both dynamic expected' % (size, MAX_INPUT_PX))
    return channels_last, size


def _stride(metadata):
    stride = str(metadata.get('stride', 32))
    if not (stride.isdigit() and 1 <= int(stride) <= MAX_STRIDE):
        raise ValueError('its stride is %.40r; 1 to %d expected' % (stride, MAX_STRIDE))
    return int(stride)


def _names(metadata):
    """Class names in the metadata of ultralytics and YOLOv5, as a list; empty without. Raises ValueError."""
    text = metadata.get('names', '')
    if not text:
        return []
    if len(text) > MAX_METADATA:
        raise ValueError('its names are longer than %d characters' % MAX_METADATA)
    try:
        names = ast.literal_eval(text)  # executes no code
    except (SyntaxError, ValueError):
        raise ValueError('its names are %.60r; a list or a dictionary expected' % text)
    count = len(names) if isinstance(names, (dict, list, tuple)) else 0
    if not 0 < count <= MAX_CLASSES:
        raise ValueError('its names are not those of 1 to %d classes' % MAX_CLASSES)
    return class_names(names, count)


def _signature(session):
    """Inputs and outputs of a network, and the heads that are known, as text; empty if it could not be loaded."""
    if session is None:
        return '; expected an ONNX file of a detector'
    lists = [', '.join('%s %s %s' % (entry.name, entry.shape, entry.type)
                       for entry in entries[:MAX_LISTED]) or 'none'
             for entries in (session.get_inputs(), session.get_outputs())]
    known = '; '.join('%s %s' % (name, head.shape) for name, head in HEADS.items())
    return '. Inputs: %s. Outputs: %s. Known heads: %s. See doc/onnx.md' % (
        tuple(ascii(text[:MAX_LIST_LENGTH])[1:-1] for text in lists) + (known,))


def gpus_are_supported():
    """Whether the installed ONNX Runtime has the CUDA provider (package onnxruntime-gpu); False if none is there."""
    try:
        import onnxruntime
    except ImportError:
        return False
    return CUDA in onnxruntime.get_available_providers()


def session_of(model, threads, gpu=None):
    """Create an onnxruntime.InferenceSession, from a path or from bytes, whose waiting threads sleep.

    By default they spin, which takes a core from other nodes, and doubles the inference time if two share a free core.
    With `gpu`, the number of a GPU, the network runs there. Raises ValueError if ONNX Runtime cannot use it.
    """
    import onnxruntime
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads, options.inter_op_num_threads = threads, 1
    options.log_severity_level = 4
    options.add_session_config_entry('session.intra_op.allow_spinning', '0')
    if gpu is None:
        return onnxruntime.InferenceSession(model, options, providers=[CPU])
    session = onnxruntime.InferenceSession(model, options, providers=[(CUDA, {'device_id': gpu}), CPU])
    if session.get_providers()[0] != CUDA:
        raise ValueError('ONNX Runtime cannot use the GPU %d; its log names the missing library' % gpu)
    return session
