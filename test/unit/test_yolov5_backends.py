import hashlib
import os
import subprocess
import sys

import numpy as np
import pytest

from ros_3d_bb.detection.weights import WeightsError
from ros_3d_bb.detection.yolov5 import backends, onnx_backend, onnx_export, torch_backend
from ros_3d_bb.detection.yolov5.backends import RuntimeParams, open_runtime
from ros_3d_bb.detection.yolov5.onnx_backend import open_exported
from support.checkpoints import write_checkpoint
from support.layouts import layout
from support.official_reference import made

needs_onnx = pytest.mark.needs('onnxruntime', 'onnx')
ON_TORCH, ON_ONNX = RuntimeParams('torch', 'cpu', 1), RuntimeParams('onnxruntime', 'cpu', 1)
BOTH = [ON_TORCH, pytest.param(ON_ONNX, marks=needs_onnx)]


def image_of(height=96, width=128):
    return np.random.RandomState(0).randint(0, 256, (height, width, 3)).astype(np.uint8)


@pytest.mark.slow
@pytest.mark.parametrize('params', BOTH)
@pytest.mark.parametrize('random', [None, ('5.0', 's')])
def test_raw_output_agrees_with_the_official_code(tmp_path, official_output, random, params):
    """Within 0.01 px and 1e-4 in every score; or, also for Focus and SPP of release 5.0, with a reference network."""
    path, cases = made(str(tmp_path / 'random.pt'), layout(*random)) if random else official_output
    run = open_runtime(path, params)
    for image, rows, values in cases:
        difference = np.abs(run(image, -1)[rows] - values)
        assert difference[:, :4].max() <= 0.01 and difference[:, 4:].max() <= 1e-4


@needs_onnx
@pytest.mark.parametrize('release, model, changes', [
    ('6.0', 'n', {'activation': 'nn.ReLU()'}), ('6.0', 'n', {'activation': 'nn.LeakyReLU(0.1)'}),
    ('6.0', 'n', {'activation': 'nn.Hardswish()'}), ('6.0', 'n6', {}), ('5.0', 's', {})])
def test_every_kind_of_network_is_exported(tmp_path, release, model, changes):
    """Also networks with four scales. In release 5.0, a checkpoint contains a second copy of the anchors."""
    path = str(tmp_path / 'network.pt')
    network = write_checkpoint(path, dict(layout(release, model, 3), **changes), anchor_grid=release == '5.0')
    runtime = open_runtime(path, ON_ONNX)
    assert runtime.stride == (64 if model == 'n6' else 32)
    expected = torch_backend.run(network, image_of(128, 64), -1)
    np.testing.assert_allclose(runtime(image_of(128, 64), -1), expected, atol=1e-3, rtol=1e-4)


@pytest.mark.parametrize('name, runtime, missing', [
    ('model.pt', 'torch', 'torch'), ('model.onnx', 'auto', 'onnxruntime'),
    pytest.param('model.pt', 'onnxruntime', 'torch', marks=needs_onnx)])  # torch exports it
def test_the_error_names_the_missing_package(tmp_path, monkeypatch, name, runtime, missing):
    for module in [name for name in sys.modules if name.startswith('ros_3d_bb.detection.')]:
        if not module.endswith(('.weights', '.backends')):  # the modules of this error and of open_runtime
            monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, missing, None)
    path = tmp_path / name
    path.write_bytes(b'')
    with pytest.raises(WeightsError) as error:
        open_runtime(path, RuntimeParams(runtime, 'cpu', 1, str(tmp_path)))
    assert str(path) in str(error.value) and 'pip3 install ' + missing in str(error.value)


@pytest.mark.parametrize('name, params, reason', [
    ('a.pt', {'runtime': 'onnxruntime', 'device': 'cuda'}, "works on the CPU, and device is 'cuda'"),
    ('a.onnx', {'runtime': 'torch'}, 'runtime torch.* a.onnx.* auto'),
    ('a.onnx', {'device': 'cuda'}, "device .*'cuda'.* a.onnx"), ('a.pt', {'device': 'cuda:99'}, 'cuda:99')])
def test_contradicting_parameters_are_rejected(name, params, reason):
    with pytest.raises(ValueError, match=reason):
        open_runtime(name, RuntimeParams(**params))


@pytest.mark.parametrize('device, gpus, supported, expected', [
    ('auto', 1, True, 0), ('auto', 0, True, None), ('auto', 1, False, None), ('cpu', 1, True, None),
    ('cuda', 1, True, 0), ('cuda:1', 2, True, 1)])
def test_onnx_files_run_on_a_gpu_if_onnx_runtime_supports_it(monkeypatch, device, gpus, supported, expected):
    monkeypatch.setattr(backends, 'gpu_count', lambda: gpus)
    monkeypatch.setattr(backends, 'gpus_are_supported', lambda: supported)
    monkeypatch.setattr(backends, 'OnnxModel', lambda path, threads, gpu: gpu)
    assert open_runtime('a.onnx', RuntimeParams(device=device)) == expected


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


@needs_onnx
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
    import onnx
    model = onnx.load_from_string(content)
    weights = model.graph.initializer[-2]
    weights.raw_data = (np.frombuffer(weights.raw_data, '<f4') * 1.1).astype('<f4').tobytes()
    return model.SerializeToString()


@needs_onnx
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
