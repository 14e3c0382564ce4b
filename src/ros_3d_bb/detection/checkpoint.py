"""Read official YOLOv5 checkpoints (.pt, releases 5.0 to 7.0) without running anything that is in them.

A checkpoint is a pickle of a whole `models.yolo.Model` in a zip archive, beside the raw bytes of its tensors. Here
the pickle may name only what such a file needs: containers, tensors, and classes of YOLOv5 and torch.nn, of which
inert stand-ins are made. No class is ever imported and nothing of torch is used, so that the file decides nothing but
numbers, names and the layout of the network. (What is left: a file can be made to keep Python's own unpickler busy for
very long, by hashing nested tuples.)
"""
import collections
import hashlib
import pickle
import zipfile
from typing import Dict, List, NamedTuple

import numpy as np

EXPECTED = 'expected the checkpoint (.pt) of an official YOLOv5 detection model, release 5.0 to 7.0'
# Modules whose classes become inert stand-ins: the model itself, and what training leaves in the file beside it.
INERT_MODULES = ('models', 'utils', 'torch.nn', 'numpy', '_codecs', 'pathlib', 'datetime')
MAX_CLASSES, MAX_NAME = 10000, 200
# A tensor may be larger than its numbers where it repeats them (YOLOv5's cached grids do), but not much.
MAX_REPEATED = 10 ** 6
STORAGE_DTYPES = {'DoubleStorage': '<f8', 'FloatStorage': '<f4', 'HalfStorage': '<f2', 'LongStorage': '<i8',
                  'IntStorage': '<i4', 'ShortStorage': '<i2', 'CharStorage': '<i1', 'ByteStorage': '<u1',
                  'BoolStorage': '|b1'}


class WeightsError(ValueError):
    """Weights that cannot be used: says which file, why, and what was expected."""


class Checkpoint(NamedTuple):
    """What a checkpoint says: `layout`, its `yaml` (see `network.Network`), class `names` and `weights` by name."""

    layout: dict
    names: List[str]
    weights: Dict[str, np.ndarray]


def read_checkpoint(path):
    """Read a checkpoint; runs no code from it and builds no class that it names.

    Raises
    ------
    WeightsError
        If the file is missing, damaged, not a YOLOv5 detection model, or names anything outside the allow-list.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            root = _Unpickler(archive).load()
        return _checkpoint_from(root)
    except FileNotFoundError:
        raise _missing(path)
    except zipfile.BadZipFile as error:
        raise WeightsError('weights %s: truncated, or not a checkpoint at all, or one of torch before 1.6 (%s); %s'
                           % (path, cause(error), EXPECTED))
    except Exception as error:  # a damaged or hostile pickle can raise anything; it all means the same
        raise WeightsError('weights %s: refused (%s); %s' % (path, cause(error), EXPECTED))


def checkpoint_digest(path):
    """SHA-256 of a file, in hexadecimal. Raises WeightsError where it cannot be read."""
    try:
        with open(path, 'rb') as stream:
            return hashlib.sha256(stream.read()).hexdigest()
    except FileNotFoundError:
        raise _missing(path)
    except OSError as error:
        raise WeightsError('weights %s: %s; %s' % (path, cause(error), EXPECTED))


def _missing(path):
    return WeightsError('weights %s: no such file; %s' % (path, EXPECTED))


def cause(error):
    """What an exception says, as one short line without control characters; its type where it says nothing."""
    return ascii(' '.join(str(error).split()))[1:-1][:300] or type(error).__name__


class Inert(object):
    """Stands in for an object of a foreign class: keeps the state that was pickled, has no behaviour."""

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
            raise pickle.UnpicklingError('the archive holds no data.pkl')
        self._folder = pickles[0].split('/')[0]
        self._storages, self._classes = {}, {}
        if self._folder + '/constants.pkl' in archive.namelist():
            raise pickle.UnpicklingError('it is a TorchScript export; its name must end in .torchscript')
        compressed = [info.filename for info in archive.infolist() if info.compress_type != zipfile.ZIP_STORED]
        if compressed:  # torch never compresses; what unpacks to more than its file could fill the memory
            raise pickle.UnpicklingError('%s is compressed' % compressed[0])
        super(_Unpickler, self).__init__(archive.open(pickles[0]), encoding='utf-8')

    def find_class(self, module, name):
        """The stand-in for a name in the pickle. Nothing is imported.

        The functions are made anew each time, because a pickle can set attributes of what it names.
        """
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
        raise pickle.UnpicklingError('it names %s.%s, which no such checkpoint needs' % (module, name))

    def persistent_load(self, reference):
        """The numbers of one storage, a flat array over the bytes in the archive."""
        _kind, dtype, key, _device, _count = reference
        if (dtype, key) not in self._storages:
            raw = self._archive.read('%s/data/%s' % (self._folder, key))
            self._storages[dtype, key] = np.frombuffer(raw, dtype)
        return self._storages[dtype, key]


def _tensor(storage, offset, size, stride, *_unused):
    """A view of a storage as read from the archive, and of nothing else; strides count elements."""
    offset, size, stride = int(offset), [int(n) for n in size], [int(n) for n in stride]
    if type(storage) is not np.ndarray or storage.strides != (storage.itemsize,):
        raise pickle.UnpicklingError('a tensor is made of something that is no data')
    last, count = offset, 1
    for n, step in zip(size, stride):
        last, count = last + (n - 1) * step, count * n
    if min(size + stride + [offset]) < 0 or len(size) != len(stride) or (count and last >= storage.size):
        raise pickle.UnpicklingError('a tensor reaches outside its data')
    if count > max(storage.size, MAX_REPEATED):
        raise pickle.UnpicklingError('a tensor of %d numbers is made of %d' % (count, storage.size))
    return np.lib.stride_tricks.as_strided(storage[offset:], size, [step * storage.itemsize for step in stride],
                                           writeable=False)


def _checkpoint_from(root):
    """Find the model in an unpickled checkpoint: the averaged one where training kept one, as YOLOv5 does."""
    model = (root.get('ema') or root.get('model')) if isinstance(root, dict) else None
    origin = getattr(model, 'origin', type(model).__name__)
    if origin not in ('models.yolo.Model', 'models.yolo.DetectionModel'):
        raise ValueError('it holds %s, not models.yolo.Model or DetectionModel' % origin)
    layout = model.state.get('yaml')
    if not isinstance(layout, dict) or not isinstance(layout.get('nc'), int):
        raise ValueError('the model carries no yaml to rebuild it from')
    if not 0 < layout['nc'] <= MAX_CLASSES:
        raise ValueError('the model has %d classes; 1 to %d expected' % (layout['nc'], MAX_CLASSES))
    tensors, activations = _walk(model)
    written = str(layout.get('activation') or 'nn.SiLU()')[:MAX_NAME]
    if activations - {written.partition('(')[0].rpartition('.')[2]}:
        raise ValueError('its layers use %s, where its yaml says %s' % (', '.join(sorted(activations)), written))
    return Checkpoint(layout, class_names(model.state.get('names'), layout['nc']), tensors)


def class_names(names, count):
    """Class names as a list, from the list or the {number: name} dict in a file.

    Where a file carries no names, 80 classes are taken for COCO's, whose first is person; the others get numbers.
    """
    if isinstance(names, (list, tuple)):
        names = dict(enumerate(names))
    if not isinstance(names, dict):
        names = {0: 'person'} if count == 80 else {}
    found = [names.get(number, names.get(str(number))) for number in range(count)]  # JSON makes strings of the numbers
    return [name if isinstance(name, str) and len(name) <= MAX_NAME else str(number)
            for number, name in enumerate(found)]


def _walk(model):
    """All parameters and buffers below an inert module, {name: array}, named as by torch's state_dict, and the names of
    the classes of its activations.
    """
    tensors, activations, seen, to_visit = {}, set(), set(), [('', model)]
    while to_visit:
        prefix, module = to_visit.pop()
        if id(module) in seen:  # modules form a tree but for shared activations, which hold no weights
            continue
        seen.add(id(module))
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
