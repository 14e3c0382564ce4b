"""Reading of YOLOv5 checkpoints, and rejection of damaged and malicious files without executing code from them."""
import copy
import io
import os
import pickle
import random as random_numbers
import re
import zipfile

import numpy as np
import pytest
import torch

from ros_3d_bb.detection.yolov5 import checkpoint
from ros_3d_bb.detection.yolov5.backends import RuntimeParams, open_runtime
from ros_3d_bb.detection.yolov5.checkpoint import EXPECTED, WeightsError, class_names, read_checkpoint
from support.checkpoints import official_classes, write_checkpoint
from support.layouts import layout
from support.red_detector import write_red_detector


class Shell(object):
    """Runs a command when it is unpickled by the stock unpickler."""

    def __init__(self, command):
        self._command = command

    def __reduce__(self):
        return os.system, (self._command,)


def archive_with(path, pickled, name='archive/data.pkl', compression=zipfile.ZIP_STORED):
    """A zip archive with one member, as torch writes them."""
    with zipfile.ZipFile(path, 'w', compression) as archive:
        archive.writestr(name, pickled)
    return path


@pytest.fixture
def path(tmp_path):
    return str(tmp_path / 'weights.pt')


@pytest.mark.parametrize('release,model,root', [('6.0', 'n', 'Model'), ('6.0', 'n6', 'DetectionModel'),
                                                ('5.0', 's', 'Model')])
def test_reads_weights_layout_and_names(path, release, model, root):
    network = write_checkpoint(path, layout(release, model), root=root)
    read = read_checkpoint(path)
    assert read.layout == layout(release, model)
    assert read.names[0] == 'person' and len(read.names) == 80
    state = network.state_dict()
    assert set(read.weights) == set(state)
    for name, tensor in state.items():
        np.testing.assert_array_equal(read.weights[name].astype(np.float32), tensor.numpy().astype(np.float32))


def test_leftovers_of_training_are_ignored(path):
    write_checkpoint(path, layout('6.0', 'n'), best_fitness=np.float64(0.5), wandb_id=None,
                     training_results=np.ones(3), opt={'weights': 'x', 'tags': set(['a'])})
    assert read_checkpoint(path).layout['nc'] == 80


def change(path, edit):
    """Edit the content of a checkpoint that the test wrote, as instances of the official classes."""
    with official_classes() as classes:
        content = torch.load(path, weights_only=False)
        edit(content, classes)
        torch.save(content, path)


@pytest.mark.parametrize('model_too', [True, False])
def test_the_averaged_model_is_preferred(path, model_too):
    def with_average(content, _classes):
        average = copy.deepcopy(content['model'])
        average.names = ['average'] + average.names[1:]
        content.update(ema=average, model=content['model'] if model_too else None)
    write_checkpoint(path, layout('6.0', 'n'))
    change(path, with_average)
    assert read_checkpoint(path).names[0] == 'average'


def test_a_model_that_contains_itself_is_read(path):
    def with_itself(content, _classes):
        content['model']._modules['again'] = content['model']
    write_checkpoint(path, layout('6.0', 'n'))
    before = set(read_checkpoint(path).weights)
    change(path, with_itself)
    assert set(read_checkpoint(path).weights) == before


def test_an_activation_that_differs_from_the_yaml_is_rejected(path):
    """In old releases a user can change the activation in the code without a trace in the yaml."""
    def with_relu(content, _classes):
        content['model'].model[0].act = torch.nn.ReLU()
    write_checkpoint(path, layout('6.0', 'n'))
    change(path, with_relu)
    with pytest.raises(WeightsError, match=r'ReLU, SiLU.* nn\.SiLU'):
        read_checkpoint(path)


def test_a_checkpoint_that_contains_a_command_is_rejected_and_not_executed(path, tmp_path):
    victim = tmp_path / 'touched'
    torch.save({'model': Shell('touch %s' % victim)}, path)
    with pytest.raises(WeightsError) as error:
        read_checkpoint(path)
    assert not victim.exists()
    assert path in str(error.value) and 'posix.system' in str(error.value)


@pytest.mark.parametrize('module,name', [('builtins', 'eval'), ('builtins', 'getattr'), ('torch', 'load'),
                                         ('torch.hub', 'load'), ('subprocess', 'Popen'), ('torch.jit', 'load'),
                                         ('torch._utils', '_rebuild_device_tensor_from_numpy'), ('nt', 'system'),
                                         ('modelsx', 'Model'), ('runpy', '_run_code'), ('collections', 'Counter')])
def test_names_outside_the_allow_list_are_rejected(path, module, name):
    archive_with(path, b'c%s\n%s\n.' % (module.encode(), name.encode()))
    with pytest.raises(WeightsError, match=re.escape('%s.%s' % (module, name))):
        read_checkpoint(path)


@pytest.mark.parametrize('name', ['models.common', 'numpy.core.multiarray', 'torch.nn.modules.conv', 'pathlib',
                                  'utils.loss'])
def test_allowed_modules_are_replaced_by_stand_ins(path, name):
    """Nothing is called; the error is that the file contains no model."""
    archive_with(path, b'c%s\nsystem\n(S"exit 1"\ntR.' % name.encode())
    with pytest.raises(WeightsError, match=r'models\.yolo\.Model'):
        read_checkpoint(path)


def truncated(path):
    write_checkpoint(path, layout('6.0', 'n'))
    with open(path, 'rb+') as stream:
        stream.truncate(os.path.getsize(path) // 2)


def flipped(path):
    """Change a byte of the weights, so that the checksum of the archive is wrong."""
    write_checkpoint(path, layout('6.0', 'n'))
    with open(path, 'rb+') as stream:
        stream.seek(os.path.getsize(path) // 2)
        byte = stream.read(1)
        stream.seek(-1, io.SEEK_CUR)
        stream.write(bytes([byte[0] ^ 255]))


def text(path):
    with open(path, 'w') as stream:
        stream.write('Not Found')


def bare_pickle(path):
    with open(path, 'wb') as stream:
        pickle.dump({'model': 1}, stream)


def other_model(path):
    write_checkpoint(path, layout('6.0', 'n'), root='SegmentationModel')


def state_dict_only(path):
    torch.save({'model': {'weight': torch.zeros(3)}}, path)


def compressed(path):
    archive_with(path, pickle.dumps({}, 2), compression=zipfile.ZIP_DEFLATED)


def torchscript(path):
    write_red_detector(path)


def tensor(path, offset=b'K\0', size=b'(K\4t', stride=b'(K\1t'):
    """Write a checkpoint that consists of one tensor in a storage of 16 bytes."""
    storage = b'(X\x07\0\0\0storagectorch\nFloatStorage\nX\1\0\0\x000X\3\0\0\0cpuK\1tQ'
    call = b'ctorch._utils\n_rebuild_tensor_v2\n(' + storage + offset + size + stride + b'\x89NtR'
    with zipfile.ZipFile(path, 'w') as out:
        out.writestr('archive/data.pkl', b'\x80\x02' + call + b'.')
        out.writestr('archive/data/0', b'\0' * 16)


def test_a_tensor_that_fills_its_storage_is_read(path):
    """The error is that the file contains no model; the tensor itself is valid."""
    tensor(path)
    with pytest.raises(WeightsError, match=r'models\.yolo\.Model'):
        read_checkpoint(path)


@pytest.mark.parametrize('change,named', [
    ({'size': b'(K\5t'}, 'exceeds'), ({'offset': b'K\1'}, 'exceeds'), ({'stride': b'(K\2t'}, 'exceeds'),
    ({'offset': b'J\xff\xff\xff\xff'}, 'exceeds'), ({'stride': b'(J\xff\xff\xff\xfft'}, 'exceeds'),
    ({'stride': b'(K\1K\1t'}, 'exceeds'), ({'size': b'(J\xff\xff\xff\x7ft', 'stride': b'(K\0t'}, '2147483647')])
def test_tensors_that_exceed_their_storage_are_rejected(path, change, named):
    tensor(path, **change)
    with pytest.raises(WeightsError, match=named):
        read_checkpoint(path)


def test_a_tensor_of_a_tensor_is_rejected(path):
    """A view with a stride of 0 is larger than its memory."""
    call = b'ctorch._utils\n_rebuild_tensor_v2\n'
    storage = b'(X\x07\0\0\0storagectorch\nFloatStorage\nX\1\0\0\x000X\3\0\0\0cpuK\1tQ'
    inner = call + b'(' + storage + b'K\0(M\xff\xfft(K\0t\x89NtR'
    with zipfile.ZipFile(path, 'w') as out:
        out.writestr('archive/data.pkl', b'\x80\x02' + call + b'(' + inner + b'K\0(M\xff\xfft(K\1t\x89NtR.')
        out.writestr('archive/data/0', b'\0' * 16)
    with pytest.raises(WeightsError, match='archive'):
        read_checkpoint(path)


def test_attributes_set_by_a_file_do_not_persist(path):
    """BUILD on an allowed function must not affect the next file."""
    archive_with(path, b'ctorch._utils\n_rebuild_parameter\n(N(S"owned"\nS"yes"\ndtb.')
    with pytest.raises(WeightsError):
        read_checkpoint(path)
    assert not hasattr(checkpoint._tensor, 'owned')
    write_checkpoint(path, layout('6.0', 'n'))
    assert len(read_checkpoint(path).weights) > 100


@pytest.mark.slow
def test_a_wrong_byte_in_the_directory_raises_no_other_error(path):
    """A damaged byte causes a WeightsError or, if the byte has no effect, no error."""
    write_checkpoint(path, layout('6.0', 'n'))
    with open(path, 'rb') as stream:
        whole = stream.read()
    random, rejected = random_numbers.Random(0), 0
    start = whole.rindex(b'PK\x05\x06') - 4000
    for _ in range(60):
        damaged = bytearray(whole)
        damaged[random.randrange(start, len(whole))] ^= random.randrange(1, 256)
        with open(path, 'wb') as stream:
            stream.write(damaged)
        try:
            open_runtime(path, RuntimeParams('torch', 'cpu', 1))
        except WeightsError as error:
            rejected += path in str(error)
    assert rejected > 20


@pytest.mark.parametrize('write,named', [
    (truncated, 'zip'), (flipped, 'CRC'), (text, 'zip'), (bare_pickle, 'zip'), (other_model, 'SegmentationModel'),
    (state_dict_only, 'dict'), (compressed, 'data.pkl is compressed'), (torchscript, '.torchscript'),
    (tensor, 'models.yolo.Model')])
def test_errors_name_the_file_the_cause_and_the_expected_format(path, write, named):
    write(path)
    with pytest.raises(WeightsError) as error:
        read_checkpoint(path)
    assert path in str(error.value) and named in str(error.value) and EXPECTED in str(error.value)


def test_missing_weights_are_named(path):
    with pytest.raises(WeightsError, match='%s.*%s' % (re.escape(path), re.escape(EXPECTED))):
        read_checkpoint(path)


def test_weights_that_are_a_folder_are_named(tmp_path):
    with pytest.raises(WeightsError, match=re.escape(str(tmp_path))):
        read_checkpoint(str(tmp_path))


@pytest.mark.parametrize('names,count,expected', [(['a', 'b'], 2, ['a', 'b']), ({1: 'b', 0: 'a'}, 2, ['a', 'b']),
                                                  (None, 2, ['0', '1']), ({0: 'a'}, 2, ['a', '1']),
                                                  ({'0': 'a', '1': 'b'}, 2, ['a', 'b']),
                                                  (['a' * 300, ['b']], 2, ['0', '1'])])
def test_names_in_every_form(names, count, expected):
    assert class_names(names, count) == expected


def test_80_classes_without_names_are_those_of_coco():
    assert class_names(None, 80)[0] == 'person'
