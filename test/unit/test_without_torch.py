"""Few systems bring torch: without it what needs it says so."""
import sys

import pytest

from ros_3d_bb.detection.yolov5.backends import RuntimeParams, open_runtime
from ros_3d_bb.detection.yolov5.checkpoint import WeightsError


@pytest.fixture
def without_torch(monkeypatch):
    """A machine without torch, on which nothing has imported it yet."""
    for module in [name for name in sys.modules if name.startswith('ros_3d_bb.detection.')]:
        if not module.endswith(('.checkpoint', '.backends')):  # whose error and function are those of this test
            monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, 'torch', None)


@pytest.mark.parametrize('name, runtime', [
    ('model.pt', 'torch'), ('model.torchscript', 'torch'),
    pytest.param('model.pt', 'onnxruntime', marks=pytest.mark.needs('onnxruntime'))])  # which torch exports it for
def test_the_error_says_what_to_install(tmp_path, without_torch, name, runtime):
    path = tmp_path / name
    path.write_bytes(b'weights')
    with pytest.raises(WeightsError, match='%s: torch is not installed.*pip3 install torch.*detector:=depth' % path):
        open_runtime(str(path), RuntimeParams(runtime, 'cpu', 1, str(tmp_path)))


def test_a_fault_of_another_import_is_not_taken_for_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, 'ros_3d_bb.detection.yolov5.torch_backend', None)
    with pytest.raises(ImportError):
        open_runtime(str(tmp_path / 'model.torchscript'), RuntimeParams('torch', 'cpu', 1))
