"""Read official YOLOv5 checkpoints (.pt, releases 5.0 to 7.0) without executing code from them.

A checkpoint is a zip archive with the pickle of a `models.yolo.Model` and the raw bytes of its tensors. The unpickler
of this module accepts an allow-list of names: containers, tensors, and classes of YOLOv5 and torch.nn, which become
inert stand-ins. No class is imported and torch is not used, so a file controls only numbers, names and the layout of
the network. Known limitation: a malicious file can keep Python's unpickler busy for very long by hashing nested tuples.
"""
import collections
import os
import pickle
import zipfile

import numpy as np

from ros_3d_bb.core.error_text import cause
from ros_3d_bb.detection.weights import MAX_CLASSES, MAX_NAME, WeightsError, class_names

EXPECTED = 'expected the checkpoint (.pt) of a YOLOv5 detection model, release 5.0 to 7.0'
# Modules whose classes become inert stand-ins: the model itself, and leftovers of training in the file.
INERT_MODULES = ('models', 'utils', 'torch.nn', 'numpy', '_codecs', 'pathlib', 'datetime')
# A tensor may repeat its numbers by strides of 0, as YOLOv5's cached grids do, up to this size.
MAX_REPEATED = 10 ** 6
STORAGE_DTYPES = {'DoubleStorage': '<f8', 'FloatStorage': '<f4', 'HalfStorage': '<f2', 'LongStorage': '<i8',
                  'IntStorage': '<i4', 'ShortStorage': '<i2', 'CharStorage': '<i1', 'ByteStorage': '<u1',
                  'BoolStorage': '|b1'}


def read_checkpoint(path):
    """Return the layout (its `yaml`, see `network.Network`), the class names, and {name: array} of the weights.

    Raises WeightsError if the file is missing, damaged, not a YOLOv5 detection model, or names anything outside the
    allow-list.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            return _content_of(_Unpickler(archive).load())
    except OSError as error:
        raise unreadable(path, error)
    except zipfile.BadZipFile as error:
        raise WeightsError('weights %s: truncated, not a checkpoint, or written by torch before 1.6 (%s); %s'
                           % (path, cause(error), EXPECTED))
    except Exception as error:  # a damaged or malicious pickle can raise any exception
        raise WeightsError('weights %s: rejected (%s); %s' % (path, cause(error), EXPECTED))


def unreadable(path, error):
    return WeightsError('weights %s: cannot be read (%s); %s' % (path, error.strerror, EXPECTED))


class Inert(object):
    """Stand-in for an object of a foreign class. It stores the pickled state and has no behaviour."""

    def __new__(cls, *_args, **_kwargs):
        instance = super(Inert, cls).__new__(cls)
        instance.state = {}
        return instance

    def __setstate__(self, state):
        self.state = state if isinstance(state, dict) else {}


class _Unpickler(pickle.Unpickler):
    """Unpickle the `data.pkl` of a torch zip archive with the allow-list of this module."""

    def __init__(self, archive):
        self._archive = archive
        pickles = [name for name in archive.namelist() if name.split('/')[1:] == ['data.pkl']]
        if len(pickles) != 1:
            raise pickle.UnpicklingError('the archive contains no data.pkl')
        self._folder = pickles[0].split('/')[0]
        self._storages, self._classes = {}, {}
        compressed = [info.filename for info in archive.infolist() if info.compress_type != zipfile.ZIP_STORED]
        if compressed:  # torch never compresses; decompression could exhaust the memory
            raise pickle.UnpicklingError('%s is compressed' % compressed[0])
        super(_Unpickler, self).__init__(archive.open(pickles[0]), encoding='utf-8')

    def find_class(self, module, name):
        """Return the stand-in for a name in the pickle, without importing anything."""
        # Functions are created on each call, because a pickle can set attributes of the objects that it names.
        allowed = {('collections', 'OrderedDict'): collections.OrderedDict, ('__builtin__', 'set'): set,
                   ('builtins', 'set'): set, ('torch', 'Size'): tuple,
                   ('torch._utils', '_rebuild_tensor_v2'): lambda *arguments: _tensor(*arguments),
                   ('torch._utils', '_rebuild_parameter'): lambda tensor, *_unused: tensor}
        if (module, name) in allowed:
            return allowed[module, name]
        if module == 'torch' and name in STORAGE_DTYPES:
            return STORAGE_DTYPES[name]
        if any(module == inert or module.startswith(inert + '.') for inert in INERT_MODULES):
            return self._classes.setdefault((module, name), type(name, (Inert,), {'origin': '%s.%s' % (module, name)}))
        if module.split('.')[0] == 'ultralytics':
            raise pickle.UnpicklingError(
                'it is a model of ultralytics (YOLOv8 or later), which contains code; export it with "yolo export '
                'model=%s format=onnx" and use the .onnx file' % os.path.basename(self._archive.filename))
        raise pickle.UnpicklingError('%s.%s is not in the allow-list' % (module, name))

    def persistent_load(self, reference):
        """The numbers of one storage: a flat array that views the bytes in the archive."""
        _kind, dtype, key, _device, _count = reference
        if (dtype, key) not in self._storages:
            raw = self._archive.read('%s/data/%s' % (self._folder, key))
            self._storages[dtype, key] = np.frombuffer(raw, dtype)
        return self._storages[dtype, key]


def _tensor(storage, offset, size, stride, *_unused):
    """View of a storage that was read from the archive. Strides count elements."""
    offset, size, stride = int(offset), [int(n) for n in size], [int(n) for n in stride]
    if type(storage) is not np.ndarray or storage.strides != (storage.itemsize,):
        raise pickle.UnpicklingError('the storage of a tensor is not in the archive')
    last, count = offset, 1
    for n, step in zip(size, stride):
        last, count = last + (n - 1) * step, count * n
    if min(size + stride + [offset]) < 0 or len(size) != len(stride) or (count and last >= storage.size):
        raise pickle.UnpicklingError('a tensor exceeds its storage')
    if count > max(storage.size, MAX_REPEATED):
        raise pickle.UnpicklingError('a tensor repeats its storage: %d elements from %d' % (count, storage.size))
    return np.lib.stride_tricks.as_strided(storage[offset:], size, [step * storage.itemsize for step in stride],
                                           writeable=False)


def _content_of(root):
    """As `read_checkpoint`. As in YOLOv5, the averaged model (`ema`) is preferred if there is one."""
    model = (root.get('ema') or root.get('model')) if isinstance(root, dict) else None
    origin = getattr(model, 'origin', type(model).__name__)
    if origin not in ('models.yolo.Model', 'models.yolo.DetectionModel'):
        raise ValueError('the file contains %s, not models.yolo.Model or DetectionModel' % origin)
    layout = model.state.get('yaml')
    if not isinstance(layout, dict) or not isinstance(layout.get('nc'), int):
        raise ValueError('the model has no yaml that describes its layers')
    if not 0 < layout['nc'] <= MAX_CLASSES:
        raise ValueError('the model has %d classes; 1 to %d expected' % (layout['nc'], MAX_CLASSES))
    tensors, activations = _walk(model)
    declared = str(layout.get('activation') or 'nn.SiLU()')[:MAX_NAME]
    if activations - {declared.partition('(')[0].rpartition('.')[2]}:
        raise ValueError('its layers use %s, but its yaml declares %s' % (', '.join(sorted(activations)), declared))
    return layout, class_names(model.state.get('names'), layout['nc']), tensors


def _walk(model):
    """Return {name in torch's state_dict: array} of all modules below an inert one, and the classes of activations."""
    tensors, activations, visited, to_visit = {}, set(), set(), [('', model)]
    while to_visit:
        prefix, module = to_visit.pop()
        if id(module) in visited:  # modules form a tree except for shared activations, which have no weights
            continue
        visited.add(id(module))
        if len(prefix) > MAX_NAME:
            raise ValueError('its modules are nested too deeply')
        if prefix.endswith('.act.'):
            activations.add(type(module).__name__)
        for kind in ('_parameters', '_buffers'):
            tensors.update((prefix + name, tensor) for name, tensor in (module.state.get(kind) or {}).items()
                           if tensor is not None)
        to_visit.extend(('%s%s.' % (prefix, name), child)
                        for name, child in (module.state.get('_modules') or {}).items())
    return tensors, activations - {'Identity'}
