"""Checkpoints: official ones are read, and nothing in a file is ever run."""
import copy
import io
import os
import pickle
import random as random_numbers
import zipfile

import numpy as np
import pytest
import torch

from ros_3d_bb.detection.checkpoint import WeightsError, class_names, read_checkpoint
from ros_3d_bb.detection import checkpoint
from ros_3d_bb.detection.runtime import RuntimeParams, open_runtime
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


def test_what_training_leaves_in_the_file_does_no_harm(path):
    write_checkpoint(path, layout('6.0', 'n'), best_fitness=np.float64(0.5), wandb_id=None,
                     training_results=np.ones(3), opt={'weights': 'x', 'tags': set(['a'])})
    assert read_checkpoint(path).layout['nc'] == 80


def change(path, edit):
    """Edit the content of a checkpoint that the test made itself, in the classes that it names."""
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


def test_a_model_that_contains_itself_is_read_to_its_end(path):
    def with_itself(content, _classes):
        content['model']._modules['again'] = content['model']
    write_checkpoint(path, layout('6.0', 'n'))
    before = set(read_checkpoint(path).weights)
    change(path, with_itself)
    assert set(read_checkpoint(path).weights) == before


def test_an_activation_that_the_yaml_does_not_name_is_refused(path):
    """Somebody changed it in the code of a release that did not write it down: our network would compute another."""
    def with_relu(content, _classes):
        content['model'].model[0].act = torch.nn.ReLU()
    write_checkpoint(path, layout('6.0', 'n'))
    change(path, with_relu)
    with pytest.raises(WeightsError, match='its layers use ReLU, SiLU, where its yaml says nn.SiLU'):
        read_checkpoint(path)


def test_a_checkpoint_that_carries_a_command_is_refused_and_not_run(path, tmp_path):
    victim = tmp_path / 'touched'
    torch.save({'model': Shell('touch %s' % victim)}, path)
    with pytest.raises(WeightsError) as error:
        read_checkpoint(path)
    assert not victim.exists()
    assert path in str(error.value) and 'posix.system' in str(error.value) and 'expected' in str(error.value)


@pytest.mark.parametrize('module,name', [('builtins', 'eval'), ('builtins', 'getattr'), ('torch', 'load'),
                                         ('torch.hub', 'load'), ('subprocess', 'Popen'), ('torch.jit', 'load'),
                                         ('torch._utils', '_rebuild_device_tensor_from_numpy'), ('nt', 'system'),
                                         ('modelsx', 'Model'), ('runpy', '_run_code'), ('collections', 'Counter')])
def test_every_name_outside_the_list_is_refused(path, module, name):
    archive_with(path, b'c%s\n%s\n.' % (module.encode(), name.encode()))
    with pytest.raises(WeightsError, match='it names %s.%s' % (module, name)):
        read_checkpoint(path)


@pytest.mark.parametrize('name', ['models.common', 'numpy.core.multiarray', 'torch.nn.modules.conv', 'pathlib',
                                  'utils.loss'])
def test_allowed_modules_are_not_imported_but_stood_in_for(path, name):
    archive_with(path, b'c%s\nsystem\n(S"exit 1"\ntR.' % name.encode())
    with pytest.raises(WeightsError, match='it holds'):
        read_checkpoint(path)


def truncated(path):
    write_checkpoint(path, layout('6.0', 'n'))
    with open(path, 'rb+') as stream:
        stream.truncate(os.path.getsize(path) // 2)


def flipped(path):
    """A byte of the weights is wrong: the archive's checksum says so."""
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
    """A checkpoint that is one tensor of a storage of 16 bytes."""
    storage = b'(X\x07\0\0\0storagectorch\nFloatStorage\nX\1\0\0\x000X\3\0\0\0cpuK\1tQ'
    call = b'ctorch._utils\n_rebuild_tensor_v2\n(' + storage + offset + size + stride + b'\x89NtR'
    with zipfile.ZipFile(path, 'w') as out:
        out.writestr('archive/data.pkl', b'\x80\x02' + call + b'.')
        out.writestr('archive/data/0', b'\0' * 16)


def test_a_tensor_that_fills_its_data_is_read(path):
    tensor(path)
    with pytest.raises(WeightsError, match='it holds'):  # it is no model, but it is a tensor
        read_checkpoint(path)


@pytest.mark.parametrize('change,reason', [
    ({'size': b'(K\5t'}, 'outside its data'), ({'offset': b'K\1'}, 'outside its data'),
    ({'stride': b'(K\2t'}, 'outside its data'), ({'offset': b'J\xff\xff\xff\xff'}, 'outside its data'),
    ({'stride': b'(J\xff\xff\xff\xfft'}, 'outside its data'), ({'stride': b'(K\1K\1t'}, 'outside its data'),
    ({'size': b'(J\xff\xff\xff\x7ft', 'stride': b'(K\0t'}, 'numbers is made of 4')])
def test_tensors_that_are_not_in_their_data_are_refused(path, change, reason):
    tensor(path, **change)
    with pytest.raises(WeightsError, match=reason):
        read_checkpoint(path)


def test_a_tensor_of_a_tensor_is_refused(path):
    """A view that repeats its numbers claims to be larger than the memory behind it."""
    call = b'ctorch._utils\n_rebuild_tensor_v2\n'
    storage = b'(X\x07\0\0\0storagectorch\nFloatStorage\nX\1\0\0\x000X\3\0\0\0cpuK\1tQ'
    inner = call + b'(' + storage + b'K\0(M\xff\xfft(K\0t\x89NtR'
    with zipfile.ZipFile(path, 'w') as out:
        out.writestr('archive/data.pkl', b'\x80\x02' + call + b'(' + inner + b'K\0(M\xff\xfft(K\1t\x89NtR.')
        out.writestr('archive/data/0', b'\0' * 16)
    with pytest.raises(WeightsError, match='something that is no data'):
        read_checkpoint(path)


def test_what_a_file_sets_does_not_outlive_it(path):
    """BUILD on an allowed function: the next file must find it as it was."""
    archive_with(path, b'ctorch._utils\n_rebuild_parameter\n(N(S"owned"\nS"yes"\ndtb.')
    with pytest.raises(WeightsError):
        read_checkpoint(path)
    assert not hasattr(checkpoint._tensor, 'owned')
    write_checkpoint(path, layout('6.0', 'n'))
    assert len(read_checkpoint(path).weights) > 100


def test_any_byte_of_the_directory_may_be_wrong(path):
    """Whatever is damaged, it is a WeightsError or, where the byte does not matter, no error."""
    write_checkpoint(path, layout('6.0', 'n'))
    with open(path, 'rb') as stream:
        whole = stream.read()
    random, refused = random_numbers.Random(0), 0
    start = whole.rindex(b'PK\x05\x06') - 4000
    for _ in range(60):
        damaged = bytearray(whole)
        damaged[random.randrange(start, len(whole))] ^= random.randrange(1, 256)
        with open(path, 'wb') as stream:
            stream.write(damaged)
        try:
            open_runtime(path, RuntimeParams('torch', 'cpu', 1))
        except WeightsError as error:
            refused += path in str(error)
    assert refused > 20


@pytest.mark.parametrize('write,reason', [
    (truncated, 'truncated'), (flipped, 'CRC'), (text, 'not a checkpoint'), (bare_pickle, 'not a checkpoint'),
    (other_model, 'SegmentationModel'), (state_dict_only, 'it holds dict'), (compressed, 'compressed'),
    (torchscript, 'must end in .torchscript'), (tensor, 'it holds')])
def test_unusable_files_are_refused_with_one_clear_error(path, write, reason):
    write(path)
    with pytest.raises(WeightsError) as error:
        read_checkpoint(path)
    assert path in str(error.value) and reason in str(error.value) and 'expected the checkpoint' in str(error.value)


def test_missing_weights_are_named(path):
    with pytest.raises(WeightsError, match='weights.pt: no such file; expected'):
        read_checkpoint(path)


def test_weights_that_are_a_folder_are_named(tmp_path):
    with pytest.raises(WeightsError, match='expected'):
        read_checkpoint(str(tmp_path))


@pytest.mark.parametrize('names,count,expected', [(['a', 'b'], 2, ['a', 'b']), ({1: 'b', 0: 'a'}, 2, ['a', 'b']),
                                                  (None, 2, ['0', '1']), ({0: 'a'}, 2, ['a', '1']),
                                                  ({'0': 'a', '1': 'b'}, 2, ['a', 'b']),
                                                  (['a' * 300, ['b']], 2, ['0', '1'])])
def test_names_in_every_form(names, count, expected):
    assert class_names(names, count) == expected


def test_80_classes_without_names_are_coco():
    assert class_names(None, 80)[0] == 'person'
