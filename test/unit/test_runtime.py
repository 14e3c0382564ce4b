"""Whatever runs the network: the same predictions, and one clear error for what cannot be run."""
import json
import sys

import numpy as np
import pytest
import torch

from ros_3d_bb.detection.checkpoint import WeightsError
from ros_3d_bb.detection.runtime import open_runtime, torch_device
from ros_3d_bb.detection.yolov5 import letterboxed
from support.checkpoints import random_network, write_checkpoint
from support.layouts import layout
from support.official_reference import made
from support.red_detector import write_red_detector


def exported_onnx(path, network, hw, metadata, dynamic=False):
    """Write a network as YOLOv5's export does: one output, stride and names in the metadata."""
    import onnx
    axes = {'images': {2: 'height', 3: 'width'}, 'output0': {1: 'rows'}} if dynamic else None
    torch.onnx.export(network, torch.zeros((1, 3) + hw), path, opset_version=13, dynamo=False, input_names=['images'],
                      output_names=['output0'], dynamic_axes=axes)
    model = onnx.load(path)
    for key, value in metadata.items():
        entry = model.metadata_props.add()
        entry.key, entry.value = key, value
    onnx.save(model, path)
    return path


def test_raw_output_agrees_with_the_official_code(official_output):
    """Within 0.01 px and 1e-4 in every score, without letterbox (the images are multiples of the stride)."""
    path, cases = official_output
    runtime = open_runtime(path, 'cpu')
    for image, rows, values in cases:
        batch, letterbox = letterboxed(image, (max(image.shape[:2]),) * 2, runtime.stride)
        assert batch.shape[2:] == image.shape[:2] and letterbox == (1.0, 0, 0)
        difference = np.abs(runtime(batch)[rows] - values)
        assert difference[:, :4].max() <= 0.01
        assert difference[:, 4:].max() <= 1e-4


@pytest.mark.parametrize('release,model', [('6.0', 'n'), ('5.0', 's')])
def test_raw_output_agrees_with_plain_numpy(tmp_path, release, model):
    """Focus and SPP of release 5.0 too, of which there is no recorded output."""
    path, cases = made(str(tmp_path / 'random.pt'), layout(release, model))
    runtime = open_runtime(path, 'cpu')
    for image, rows, values in cases:
        batch, _letterbox = letterboxed(image, (96, 96), runtime.stride)
        difference = np.abs(runtime(batch)[rows] - values)
        assert difference[:, :4].max() <= 0.01 and difference[:, 4:].max() <= 1e-4


def test_anchors_kept_twice_as_in_release_5_are_read_once(tmp_path):
    path = str(tmp_path / 'five.pt')
    network = write_checkpoint(path, layout('5.0', 's'), anchor_grid=True)
    batch = np.random.RandomState(0).random_sample((1, 3, 64, 64)).astype(np.float32)
    with torch.no_grad():
        expected = network(torch.from_numpy(batch))[0].numpy()
    np.testing.assert_allclose(open_runtime(path, 'cpu')(batch), expected, atol=1e-3, rtol=1e-4)


def test_weights_that_do_not_fit_their_layout_are_refused(tmp_path):
    path = str(tmp_path / 'wrong.pt')
    write_checkpoint(path, layout('6.0', 'n'), yaml=layout('6.0', 's'))
    with pytest.raises(WeightsError, match='wrong.pt: the network cannot be rebuilt .* expected the checkpoint'):
        open_runtime(path, 'cpu')


@pytest.mark.parametrize('dynamic', [False, True])
def test_onnx_exports_give_the_same_predictions(tmp_path, dynamic):
    network = random_network(layout('6.0', 'n', 3)).fuse()
    path = exported_onnx(str(tmp_path / 'model.onnx'), network, (96, 128),
                         {'stride': '32', 'names': "{0: 'person', 1: 'cat', 2: 'dog'}"}, dynamic)
    runtime = open_runtime(path)
    assert runtime.names == ['person', 'cat', 'dog'] and runtime.stride == 32
    assert runtime.input_hw == (None if dynamic else (96, 128))
    batch = np.random.RandomState(0).random_sample((1, 3, 96, 128)).astype(np.float32)
    with torch.no_grad():
        expected = network(torch.from_numpy(batch))[0].numpy()
    np.testing.assert_allclose(runtime(batch), expected, atol=1e-3, rtol=1e-4)


def test_torchscript_exports_give_the_same_predictions(tmp_path):
    network = random_network(layout('6.0', 'n', 3)).fuse()
    path = str(tmp_path / 'model.torchscript')
    config = {'shape': [1, 3, 96, 128], 'stride': 32, 'names': {'0': 'person'}}
    torch.jit.trace(network, torch.zeros(1, 3, 96, 128)).save(path, _extra_files={'config.txt': json.dumps(config)})
    runtime = open_runtime(path, 'cpu')
    assert runtime.input_hw == (96, 128) and runtime.stride == 32 and runtime.names[0] == 'person'
    batch = np.random.RandomState(0).random_sample((1, 3, 96, 128)).astype(np.float32)
    with torch.no_grad():
        expected = network(torch.from_numpy(batch))[0].numpy()
    np.testing.assert_allclose(runtime(batch), expected, atol=1e-3, rtol=1e-4)


def test_torchscript_runs_only_by_its_name(tmp_path):
    """It is a program, and a checkpoint must never be one."""
    assert open_runtime(write_red_detector(str(tmp_path / 'red.torchscript.pt')), 'cpu').names[0] == 'person'
    with pytest.raises(WeightsError, match='must end in .torchscript'):
        open_runtime(write_red_detector(str(tmp_path / 'red.pt')), 'cpu')


@pytest.mark.parametrize('edit', [
    lambda given: given['head'].__setitem__(-2, [-1, 1, 'C3', [1024, False]]) or given['backbone'].pop(),
    lambda given: given['backbone'].__setitem__(0, [-1, 1, 'Conv', [64, 6, 0, 2]]),
    lambda given: given['backbone'].__setitem__(1, [-1, 0, 'Conv', [128, 3, 2]]),
    lambda given: given['head'].__setitem__(2, [[-1, 4], 1, 'Concat', [1]])])
def test_layouts_that_cannot_run_are_refused_when_the_file_is_opened(tmp_path, edit):
    path, given = str(tmp_path / 'odd.pt'), layout('6.0', 'n')
    edit(given)
    write_checkpoint(path, layout('6.0', 'n'), yaml=given)
    with pytest.raises(WeightsError, match='cannot be rebuilt'):
        open_runtime(path, 'cpu')


class NotADetector(torch.nn.Module):
    """A classifier: its output has the wrong shape."""

    def forward(self, images):
        return images.mean(dim=3).mean(dim=2)


@pytest.mark.parametrize('suffix', ['onnx', 'torchscript'])
@pytest.mark.parametrize('kind', ['missing', 'damaged', 'other'])
def test_exports_that_cannot_be_run_are_refused(tmp_path, suffix, kind):
    path = str(tmp_path / ('model.' + suffix))
    if kind == 'damaged':
        with open(path, 'wb') as stream:
            stream.write(b'nonsense')
    elif kind == 'other' and suffix == 'torchscript':
        torch.jit.script(NotADetector()).save(path)
    elif kind == 'other':
        exported_onnx(path, NotADetector(), (64, 64), {})
    with pytest.raises(WeightsError, match='weights %s: not a YOLOv5 .* export .*expected' % path):
        open_runtime(path, 'cpu')


def test_onnx_without_onnx_runtime_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, 'onnxruntime', None)
    with pytest.raises(WeightsError, match='pip3 install onnxruntime'):
        open_runtime(str(tmp_path / 'model.onnx'))


def test_names_in_an_export_are_never_run(tmp_path):
    victim = tmp_path / 'touched'
    path = exported_onnx(str(tmp_path / 'model.onnx'), random_network(layout('6.0', 'n', 3)), (64, 64),
                         {'names': "__import__('os').system('touch %s')" % victim})
    with pytest.raises(WeightsError):
        open_runtime(path)
    assert not victim.exists()


def test_a_device_that_does_not_exist_is_named():
    assert torch_device('cpu').type == 'cpu'
    assert torch_device('auto').type in ('cpu', 'cuda')
    for name in ('cuda:99', 'toaster'):
        with pytest.raises(ValueError, match=name):
            torch_device(name)
