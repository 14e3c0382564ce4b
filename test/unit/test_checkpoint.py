"""Checkpoints: official ones are read, and nothing in a file is ever run."""
import io
import os
import pickle
import zipfile

import numpy as np
import pytest
import torch

from ros_3d_bb.detection.checkpoint import WeightsError, class_names, is_torchscript, read_checkpoint
from support.checkpoints import official_classes, write_checkpoint
from support.layouts import layout


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
    checkpoint = read_checkpoint(path)
    assert checkpoint.layout == layout(release, model)
    assert checkpoint.names[0] == 'person' and len(checkpoint.names) == 80
    state = network.state_dict()
    assert set(checkpoint.weights) == set(state)
    for name, tensor in state.items():
        np.testing.assert_array_equal(checkpoint.weights[name].astype(np.float32), tensor.numpy().astype(np.float32))


def test_what_training_leaves_in_the_file_does_no_harm(path):
    write_checkpoint(path, layout('6.0', 'n'), best_fitness=np.float64(0.5), wandb_id=None,
                     training_results=np.ones(3), opt={'weights': 'x', 'tags': set(['a'])})
    assert read_checkpoint(path).layout['nc'] == 80


def test_the_averaged_model_is_preferred(path):
    write_checkpoint(path, layout('6.0', 'n'))
    with official_classes():
        content = torch.load(path, weights_only=False)  # our own file, made above
        content['ema'] = content['model']
        content['model'] = None
        torch.save(content, path)
    assert len(read_checkpoint(path).weights) > 100


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


def outside_its_data(path):
    """A tensor that claims more numbers than its storage holds."""
    storage = b'(X\x07\0\0\0storagectorch\nFloatStorage\nX\1\0\0\x000X\3\0\0\0cpuK\1tQ'
    call = b'ctorch._utils\n_rebuild_tensor_v2\n(' + storage + b'K\0(M\xff\xfft(K\1t\x89NtR'
    with zipfile.ZipFile(path, 'w') as out:
        out.writestr('archive/data.pkl', b'\x80\x02' + call + b'.')
        out.writestr('archive/data/0', b'\0' * 4)


def itself_for_ever(path):
    """A model that is its own child: walking it must end."""
    with official_classes() as classes:
        module = list(classes.values())[0]()
        module._modules['again'] = module
        torch.save({'model': module}, path)


@pytest.mark.parametrize('write,reason', [
    (truncated, 'truncated'), (flipped, 'CRC'), (text, 'not a checkpoint'), (bare_pickle, 'not a checkpoint'),
    (other_model, 'SegmentationModel'), (state_dict_only, 'it holds dict'), (compressed, 'compressed'),
    (outside_its_data, 'outside its data'), (itself_for_ever, 'it holds models.common')])
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


def test_torchscript_is_told_from_checkpoints(path, weights_script):
    write_checkpoint(path, layout('6.0', 'n'))
    assert not is_torchscript(path)
    assert is_torchscript(weights_script)


@pytest.fixture
def weights_script(tmp_path):
    from support.red_detector import write_red_detector
    return write_red_detector(str(tmp_path / 'red.torchscript'))


@pytest.mark.parametrize('names,count,expected', [(['a', 'b'], 2, ['a', 'b']), ({1: 'b', 0: 'a'}, 2, ['a', 'b']),
                                                  (None, 2, ['0', '1']), ({0: 'a'}, 2, ['a', '1'])])
def test_names_in_every_form(names, count, expected):
    assert class_names(names, count) == expected


def test_80_classes_without_names_are_coco():
    assert class_names(None, 80)[0] == 'person'
