"""Checkpoints exported to ONNX: once, kept whole, checked each time, and never in the way."""
import hashlib
import os
import subprocess
import sys

import numpy as np
import onnx
import pytest
import torch

from ros_3d_bb.detection import exports, runtime as seam
from ros_3d_bb.detection.checkpoint import WeightsError, checkpoint_digest
from ros_3d_bb.detection.exports import export, export_folder, exported_runtime, sealed
from ros_3d_bb.detection.onnx_export import exported
from ros_3d_bb.detection.onnx_runtime import ExportedRuntime, OnnxUnusable
from ros_3d_bb.detection.runtime import RuntimeParams, open_runtime
from support.checkpoints import random_network, write_checkpoint
from support.layouts import layout

SOURCE = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(exports.__file__))))


@pytest.fixture
def checkpoint(tmp_path):
    path = str(tmp_path / 'random.pt')
    write_checkpoint(path, layout('6.0', 'n', 3))
    return path


@pytest.fixture
def folder(tmp_path):
    return str(tmp_path / 'made' / 'when missing')


@pytest.fixture
def told():
    return []


@pytest.fixture
def opened(checkpoint, folder, told):
    return lambda: exported_runtime(checkpoint, folder, 1, told.append)


@pytest.fixture
def kept(checkpoint, folder):
    """Where the export of the checkpoint is kept."""
    return os.path.join(folder, '%s-%d.onnx' % (checkpoint_digest(checkpoint), exports.VERSION))


def content_of(path):
    with open(path, 'rb') as stream:
        return stream.read()


def write(path, content):
    with open(path, 'wb') as stream:
        stream.write(content)


def rows_of(runtime):
    return runtime(np.random.RandomState(1).randint(0, 256, (64, 64, 3)).astype(np.uint8), -1)


def test_a_checkpoint_is_exported_once(opened, kept, folder, told, monkeypatch):
    first = rows_of(opened())
    monkeypatch.setattr(exports, 'export', None)
    np.testing.assert_array_equal(rows_of(opened()), first)
    assert os.listdir(folder) == [os.path.basename(kept)] and told == []
    assert os.stat(folder).st_mode & 0o077 == 0


def test_once_it_is_kept_torch_is_not_needed(opened, checkpoint, folder):
    opened()
    code = ('import sys; sys.modules["torch"] = None\n'
            'from ros_3d_bb.detection.runtime import RuntimeParams, open_runtime\n'
            'print(open_runtime(%r, RuntimeParams(device="cpu", export_folder=%r)).names[0])' % (checkpoint, folder))
    output = subprocess.check_output([sys.executable, '-c', code], env=dict(os.environ, PYTHONPATH=os.pathsep.join(
        [SOURCE] + [path for path in sys.path if path])))
    assert output.decode().split() == ['person']


@pytest.mark.parametrize('damage', [lambda content: content[:-1000], lambda content: b'', lambda content: b'nonsense',
                                    lambda content: content[:5000] + bytes([content[5000] ^ 1]) + content[5001:],
                                    lambda content: content[:-1] + b'x', lambda content: sealed(b'nonsense')])
def test_a_damaged_file_is_made_again(opened, kept, told, damage):
    expected = rows_of(opened())
    whole = content_of(kept)
    write(kept, damage(whole))
    np.testing.assert_array_equal(rows_of(opened()), expected)
    assert content_of(kept) == whole
    assert len(told) == 1 and told[0].startswith(kept + ' cannot be used (') and 'made again' in told[0]


def test_the_export_of_another_checkpoint_is_made_again(opened, kept, told, tmp_path):
    expected = rows_of(opened())
    other = str(tmp_path / 'other.pt')
    write_checkpoint(other, layout('6.0', 'n', 5))
    write(kept, sealed(export(other, checkpoint_digest(other))))
    np.testing.assert_array_equal(rows_of(opened()), expected)
    assert 'it is of another checkpoint' in told[0]


def test_a_file_that_no_longer_says_what_torch_said_is_made_again(opened, kept, told):
    """As after an update of ONNX Runtime that computes wrongly, or where somebody put other weights in."""
    expected = rows_of(opened())
    write(kept, sealed(with_other_weights(content_of(kept))))
    np.testing.assert_array_equal(rows_of(opened()), expected)
    assert 'something else than torch' in told[0]


def with_other_weights(content):
    model = onnx.load_from_string(content)
    weights = model.graph.initializer[-2]
    weights.raw_data = (np.frombuffer(weights.raw_data, '<f4') * 1.1).astype('<f4').tobytes()
    return model.SerializeToString()


@pytest.mark.parametrize('reason', ['a file in the way', 'a full disk'])
def test_a_folder_that_cannot_be_written_is_done_without(opened, folder, told, monkeypatch, reason):
    if reason == 'a full disk':
        def full(*_unused):
            raise OSError('no space left')
        monkeypatch.setattr(exports.os, 'replace', full)
    else:
        write(os.path.dirname(folder), b'')
    assert rows_of(opened()).shape[1] == 8
    assert 'cannot be kept' in told[-1] and 'at the next start' in told[-1]
    assert reason != 'a full disk' or os.listdir(folder) == []


def test_another_checkpoint_of_the_same_name_is_exported_too(opened, checkpoint, folder):
    opened()
    write_checkpoint(checkpoint, layout('6.0', 'n', 5))
    assert len(opened().names) == 5 and len(os.listdir(folder)) == 2


@pytest.mark.parametrize('fault', ['not installed', 'wrong'])
def test_where_onnx_runtime_does_not_work_torch_does(checkpoint, folder, told, monkeypatch, fault):
    if fault == 'not installed':
        monkeypatch.setitem(sys.modules, 'onnxruntime', None)
    else:
        monkeypatch.setattr(exports, 'export', lambda path, digest: with_other_weights(export(path, digest)))
    params = RuntimeParams(device='cpu', export_folder=folder)
    runtime = seam.open_runtime(checkpoint, params, told.append)
    assert runtime.description.startswith('torch on the CPU') and rows_of(runtime).shape[1] == 8
    line, = told
    assert ('pip3 install onnxruntime' if fault == 'not installed' else 'else than torch') in line
    assert 'torch runs the network instead' in line and not os.path.exists(folder)
    with pytest.raises(OnnxUnusable):
        open_runtime(checkpoint, params._replace(runtime='onnxruntime'))


def test_checkpoints_that_cannot_be_read_are_refused(tmp_path, folder):
    write(str(tmp_path / 'damaged.pt'), b'nonsense')
    for name, reason in (('missing.pt', 'no such file; expected'), ('damaged.pt', 'truncated, or not'), ('.', 'Is a')):
        with pytest.raises(WeightsError, match=reason):
            open_runtime(str(tmp_path / name), RuntimeParams(device='cpu', export_folder=folder))
    assert not os.path.exists(folder)


def test_exports_are_valid_onnx(checkpoint):
    model = onnx.load_from_string(sealed(export(checkpoint, 'any')))
    onnx.checker.check_model(model, full_check=True)
    assert [entry.key for entry in model.metadata_props] == ['about', 'sha256']


def test_what_is_no_export_of_ours_is_refused():
    for model in (b'', b'nonsense', exported(random_network(layout('6.0', 'n', 3)).fuse(), {'about': '{}'})):
        with pytest.raises(OnnxUnusable):
            ExportedRuntime(model, 1)


@pytest.mark.parametrize('release,digest', [('6.0', 'f57881000fd9a334'), ('5.0', 'e2f0edfc821a2f67')])
def test_what_is_exported_changes_only_with_the_version(release, digest):
    """Files kept by earlier releases must not be taken for new ones: where this fails, raise exports.VERSION."""
    network = random_network(layout(release, 'n', 3)).fuse()
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.zero_()
    assert (exports.VERSION, hashlib.sha256(exported(network, {})).hexdigest()[:16]) == (1, digest)


@pytest.mark.parametrize('variables,expected', [
    ({'ROS_3D_BB_CACHE': '/a'}, '/a/onnx'), ({'XDG_CACHE_HOME': '/b'}, '/b/ros_3d_bb/onnx'),
    ({'HOME': '/c'}, '/c/.cache/ros_3d_bb/onnx')])
def test_exports_are_kept_in_the_users_cache(monkeypatch, variables, expected):
    for name in ('ROS_3D_BB_CACHE', 'XDG_CACHE_HOME'):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    assert export_folder() == expected
    assert export_folder('/given') == '/given'
