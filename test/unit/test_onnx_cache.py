import hashlib
import os
import subprocess
import sys
from unittest import mock

import numpy as np
import onnx
import pytest

from ros_3d_bb.detection.yolov5 import onnx_backend, onnx_export
from ros_3d_bb.detection.yolov5.onnx_backend import open_exported
from ros_3d_bb.detection.yolov5.onnx_export import export
from support.checkpoints import write_checkpoint
from support.layouts import layout

SOURCE = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(onnx_backend.__file__))))


class Cache(object):
    """A checkpoint, the folder of its exports, and the warnings of opening it."""

    def __init__(self, tmp_path, content):
        self.checkpoint, self.folder = tmp_path / 'random.pt', tmp_path / 'made' / 'when missing'
        self.warnings = []
        self.checkpoint.write_bytes(content)
        digest = hashlib.sha256(content).hexdigest()
        self.exported = self.folder / ('%s-%d.onnx' % (digest, onnx_backend.VERSION))

    def open(self):
        return open_exported(str(self.checkpoint), str(self.folder), 1, self.warnings.append)


@pytest.fixture(scope='module')
def content(tmp_path_factory):
    path = tmp_path_factory.mktemp('weights') / 'random.pt'
    write_checkpoint(str(path), layout('6.0', 'n', 3))
    return path.read_bytes()


@pytest.fixture
def cache(tmp_path, content):
    return Cache(tmp_path, content)


def rows_of(runtime):
    return runtime(np.random.RandomState(1).randint(0, 256, (64, 64, 3)).astype(np.uint8), -1)


def test_a_checkpoint_is_exported_once_and_then_needs_no_torch(cache, monkeypatch):
    first = rows_of(cache.open())
    monkeypatch.setattr(onnx_export, 'export', None)
    np.testing.assert_array_equal(rows_of(cache.open()), first)
    assert list(cache.folder.iterdir()) == [cache.exported] and cache.warnings == []
    assert cache.folder.stat().st_mode & 0o077 == 0
    code = ('import sys; sys.modules["torch"] = None\n'
            'from ros_3d_bb.detection.yolov5.backends import RuntimeParams, open_runtime\n'
            'print(open_runtime(%r, RuntimeParams(device="cpu", export_folder=%r)).names[0])'
            % (str(cache.checkpoint), str(cache.folder)))
    output = subprocess.check_output([sys.executable, '-c', code], env=dict(os.environ, PYTHONPATH=os.pathsep.join(
        [SOURCE] + [path for path in sys.path if path])))
    assert output.decode().split() == ['person']


def with_other_weights(content):
    model = onnx.load_from_string(content)
    weights = model.graph.initializer[-2]
    weights.raw_data = (np.frombuffer(weights.raw_data, '<f4') * 1.1).astype('<f4').tobytes()
    return model.SerializeToString()


@pytest.mark.parametrize('damage, cause', [
    (lambda content: content[:-1000], 'cannot run'),
    (with_other_weights, 'torch')])  # for example with a faulty release of ONNX Runtime
def test_a_file_that_cannot_be_trusted_is_exported_again(cache, damage, cause):
    expected = rows_of(cache.open())
    whole = cache.exported.read_bytes()
    cache.exported.write_bytes(damage(whole))
    np.testing.assert_array_equal(rows_of(cache.open()), expected)
    assert cache.exported.read_bytes() == whole
    warning, = cache.warnings
    assert str(cache.exported) in warning and cause in warning


def test_a_full_disk_causes_a_warning_only(cache, monkeypatch):
    monkeypatch.setattr(onnx_backend.os, 'replace', mock.Mock(side_effect=OSError('no space left')))
    assert rows_of(cache.open()).shape[1] == 8
    assert len(cache.warnings) == 1 and list(cache.folder.iterdir()) == []


def test_exports_are_valid_onnx(cache):
    model = onnx.load_from_string(export(str(cache.checkpoint), 'any'))
    onnx.checker.check_model(model, full_check=True)
    assert [entry.key for entry in model.metadata_props] == ['about']
