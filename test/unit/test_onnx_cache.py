"""Cache of ONNX exports: each checkpoint is exported once, cached files are verified, and failures are worked around.
"""
import hashlib
import os
import subprocess
import sys

import numpy as np
import onnx
import pytest
import torch

from ros_3d_bb.detection.yolov5 import onnx_cache, backends
from ros_3d_bb.detection.yolov5.backends import RuntimeParams, open_runtime
from ros_3d_bb.detection.yolov5.checkpoint import WeightsError, checkpoint_digest
from ros_3d_bb.detection.yolov5.onnx_backend import ExportedRuntime, OnnxUnusable
from ros_3d_bb.detection.yolov5.onnx_cache import export, export_folder, open_exported, with_checksum
from ros_3d_bb.detection.yolov5.onnx_export import onnx_model_of
from support.checkpoints import random_network, write_checkpoint
from support.layouts import layout

SOURCE = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(onnx_cache.__file__))))


@pytest.fixture
def checkpoint(tmp_path):
    path = str(tmp_path / 'random.pt')
    write_checkpoint(path, layout('6.0', 'n', 3))
    return path


@pytest.fixture
def folder(tmp_path):
    return str(tmp_path / 'made' / 'when missing')


@pytest.fixture
def warnings():
    return []


@pytest.fixture
def opened(checkpoint, folder, warnings):
    return lambda: open_exported(checkpoint, folder, 1, warnings.append)


@pytest.fixture
def cached_path(checkpoint, folder):
    """Path of the cached export of the checkpoint."""
    return os.path.join(folder, '%s-%d.onnx' % (checkpoint_digest(checkpoint), onnx_cache.VERSION))


def content_of(path):
    with open(path, 'rb') as stream:
        return stream.read()


def write(path, content):
    with open(path, 'wb') as stream:
        stream.write(content)


def rows_of(runtime):
    return runtime(np.random.RandomState(1).randint(0, 256, (64, 64, 3)).astype(np.uint8), -1)


def test_a_checkpoint_is_exported_once(opened, cached_path, folder, warnings, monkeypatch):
    first = rows_of(opened())
    monkeypatch.setattr(onnx_cache, 'export', None)
    np.testing.assert_array_equal(rows_of(opened()), first)
    assert os.listdir(folder) == [os.path.basename(cached_path)] and warnings == []
    assert os.stat(folder).st_mode & 0o077 == 0


def test_a_cached_export_does_not_need_torch(opened, checkpoint, folder):
    opened()
    code = ('import sys; sys.modules["torch"] = None\n'
            'from ros_3d_bb.detection.yolov5.backends import RuntimeParams, open_runtime\n'
            'print(open_runtime(%r, RuntimeParams(device="cpu", export_folder=%r)).names[0])' % (checkpoint, folder))
    output = subprocess.check_output([sys.executable, '-c', code], env=dict(os.environ, PYTHONPATH=os.pathsep.join(
        [SOURCE] + [path for path in sys.path if path])))
    assert output.decode().split() == ['person']


@pytest.mark.slow
@pytest.mark.parametrize('damage', [lambda content: content[:-1000], lambda content: b'', lambda content: b'nonsense',
                                    lambda content: content[:5000] + bytes([content[5000] ^ 1]) + content[5001:],
                                    lambda content: content[:-1] + b'x', lambda content: with_checksum(b'nonsense')])
def test_a_damaged_file_is_exported_again(opened, cached_path, warnings, damage):
    expected = rows_of(opened())
    whole = content_of(cached_path)
    write(cached_path, damage(whole))
    np.testing.assert_array_equal(rows_of(opened()), expected)
    assert content_of(cached_path) == whole
    assert len(warnings) == 1 and cached_path in warnings[0]


def test_a_file_from_another_checkpoint_is_exported_again(opened, cached_path, warnings, tmp_path):
    expected = rows_of(opened())
    other = str(tmp_path / 'other.pt')
    write_checkpoint(other, layout('6.0', 'n', 5))
    write(cached_path, with_checksum(export(other, checkpoint_digest(other))))
    np.testing.assert_array_equal(rows_of(opened()), expected)
    assert len(warnings) == 1 and cached_path in warnings[0] and 'another checkpoint' in warnings[0]


def test_a_file_whose_output_differs_from_torch_is_exported_again(opened, cached_path, warnings):
    """For example with a faulty release of ONNX Runtime, or if the weights in the file were changed."""
    expected = rows_of(opened())
    write(cached_path, with_checksum(with_other_weights(content_of(cached_path))))
    np.testing.assert_array_equal(rows_of(opened()), expected)
    assert len(warnings) == 1 and cached_path in warnings[0] and 'torch' in warnings[0]


def with_other_weights(content):
    model = onnx.load_from_string(content)
    weights = model.graph.initializer[-2]
    weights.raw_data = (np.frombuffer(weights.raw_data, '<f4') * 1.1).astype('<f4').tobytes()
    return model.SerializeToString()


@pytest.mark.parametrize('reason', ['a file in the way', 'a full disk'])
def test_a_folder_that_cannot_be_written_causes_a_warning_only(opened, folder, warnings, monkeypatch, reason):
    if reason == 'a full disk':
        def full(*_unused):
            raise OSError('no space left')
        monkeypatch.setattr(onnx_cache.os, 'replace', full)
    else:
        write(os.path.dirname(folder), b'')
    assert rows_of(opened()).shape[1] == 8
    assert len(warnings) == (1 if reason == 'a full disk' else 2)
    assert reason != 'a full disk' or os.listdir(folder) == []


def test_another_checkpoint_of_the_same_name_is_exported(opened, checkpoint, folder):
    opened()
    write_checkpoint(checkpoint, layout('6.0', 'n', 5))
    assert len(opened().names) == 5 and len(os.listdir(folder)) == 2


@pytest.mark.slow
@pytest.mark.parametrize('fault', ['not installed', 'wrong'])
def test_torch_replaces_an_onnx_runtime_that_does_not_work(checkpoint, folder, warnings, monkeypatch, fault):
    if fault == 'not installed':
        monkeypatch.setitem(sys.modules, 'onnxruntime', None)
    else:
        monkeypatch.setattr(onnx_cache, 'export', lambda path, digest: with_other_weights(export(path, digest)))
    params = RuntimeParams(device='cpu', export_folder=folder)
    runtime = backends.open_runtime(checkpoint, params, warnings.append)
    assert runtime.description.startswith('torch on the CPU') and rows_of(runtime).shape[1] == 8
    assert len(warnings) == 1 and ('pip3 install onnxruntime' in warnings[0]) == (fault == 'not installed')
    assert not os.path.exists(folder)
    with pytest.raises(OnnxUnusable):
        open_runtime(checkpoint, params._replace(runtime='onnxruntime'))


def test_checkpoints_that_cannot_be_read_are_rejected(tmp_path, folder):
    write(str(tmp_path / 'damaged.pt'), b'nonsense')
    for name, named in (('missing.pt', 'missing.pt'), ('damaged.pt', 'damaged.pt.*zip'), ('.', 'Is a directory')):
        with pytest.raises(WeightsError, match=named):
            open_runtime(str(tmp_path / name), RuntimeParams(device='cpu', export_folder=folder))
    assert not os.path.exists(folder)


def test_exports_are_valid_onnx(checkpoint):
    model = onnx.load_from_string(with_checksum(export(checkpoint, 'any')))
    onnx.checker.check_model(model, full_check=True)
    assert [entry.key for entry in model.metadata_props] == ['about', 'sha256']


def test_files_of_other_origin_are_rejected():
    for model in (b'', b'nonsense', onnx_model_of(random_network(layout('6.0', 'n', 3)).fuse(), {'about': '{}'})):
        with pytest.raises(OnnxUnusable):
            ExportedRuntime(model, 1)


@pytest.mark.parametrize('release,digest', [('6.0', 'f57881000fd9a334'), ('5.0', 'e2f0edfc821a2f67')])
def test_the_exported_model_changes_only_with_the_version(release, digest):
    """Files cached by earlier releases must not be used as current ones. If this fails, increase onnx_cache.VERSION."""
    network = random_network(layout(release, 'n', 3)).fuse()
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.zero_()
    assert (onnx_cache.VERSION, hashlib.sha256(onnx_model_of(network, {})).hexdigest()[:16]) == (1, digest)


@pytest.mark.parametrize('variables,expected', [
    ({'ROS_3D_BB_CACHE': '/a'}, '/a/onnx'), ({'XDG_CACHE_HOME': '/b'}, '/b/ros_3d_bb/onnx'),
    ({'HOME': '/c'}, '/c/.cache/ros_3d_bb/onnx')])
def test_exports_are_stored_in_the_users_cache(monkeypatch, variables, expected):
    for name in ('ROS_3D_BB_CACHE', 'XDG_CACHE_HOME'):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    assert export_folder() == expected
    assert export_folder('/given') == '/given'
