"""YOLOv5 network: published numbers of parameters, shape of the output, and rejection of invalid layouts."""
import pytest
import torch

from ros_3d_bb.detection.yolov5.network import Network
from support.layouts import PUBLISHED_MILLIONS, layout


@pytest.mark.needs('torch.export')  # torch 2 builds networks without weights on the meta device
@pytest.mark.parametrize('release,model', sorted(PUBLISHED_MILLIONS))
def test_number_of_parameters_is_the_published_one(release, model):
    """The README of YOLOv5 gives numbers rounded to 0.1 million, before or after fusing."""
    with torch.device('meta'):
        network = Network(layout(release, model))
    millions = sum(parameter.numel() for parameter in network.parameters()) / 1e6
    assert millions == pytest.approx(PUBLISHED_MILLIONS[release, model], abs=0.1)
    assert network.stride == (64 if model.endswith('6') else 32)


@pytest.mark.parametrize('change,named', [
    (lambda rows: rows['backbone'].__setitem__(0, [-1, 1, 'os.system', ['x']]), 'os.system'),
    (lambda rows: rows['backbone'].__setitem__(0, [-1, 1, 'Conv', [10 ** 9, 3]]), '200 million'),
    (lambda rows: rows['backbone'].__setitem__(0, [-1, 1, 'Conv', [64, 10 ** 6]]), 'kernel.* Conv .*31'),
    (lambda rows: rows['head'].pop(), 'Detect'),
    (lambda rows: rows.update(activation='__import__("os")'), 'activation')])
def test_layouts_that_no_release_has_are_rejected(change, named):
    rows = layout('6.0', 'n')
    change(rows)
    with pytest.raises(ValueError, match=named):
        Network(rows)
