"""The network: the official code's output, the published sizes, and layouts that ask too much."""
import pytest
import torch

from ros_3d_bb.detection.network import Network
from support.checkpoints import random_network
from support.layouts import PUBLISHED_MILLIONS, layout


@pytest.mark.needs('torch.export')  # as torch 2 has, which makes networks without numbers
@pytest.mark.parametrize('release,model', sorted(PUBLISHED_MILLIONS))
def test_every_published_model_has_its_published_number_of_parameters(release, model):
    """Rounded to 0.1 million in the README of YOLOv5, before or after fusing."""
    with torch.device('meta'):
        network = Network(layout(release, model))
    millions = sum(parameter.numel() for parameter in network.parameters()) / 1e6
    assert millions == pytest.approx(PUBLISHED_MILLIONS[release, model], abs=0.1)
    assert network.stride == (64 if model.endswith('6') else 32)


@pytest.mark.parametrize('release,model,rows', [('6.0', 'n', 3 * (16 * 24 + 8 * 12 + 4 * 6)),
                                                ('5.0', 's', 3 * (16 * 24 + 8 * 12 + 4 * 6)),
                                                ('6.0', 'n6', 3 * (16 * 24 + 8 * 12 + 4 * 6 + 2 * 3))])
def test_output_has_a_row_for_each_anchor_of_each_cell(release, model, rows):
    with torch.no_grad():
        output = random_network(layout(release, model, 3))(torch.rand(1, 3, 128, 192))
    assert output.shape == (1, rows, 8)
    assert torch.isfinite(output).all() and (output[..., 4:] > 0).all() and (output[..., 4:] < 1).all()


@pytest.mark.parametrize('release,model', [('6.0', 'n'), ('5.0', 's'), ('6.0', 'n6')])
def test_fusing_changes_nothing_but_the_speed(release, model):
    network = random_network(layout(release, model, 3))
    image = torch.rand(1, 3, 128, 128)
    with torch.no_grad():
        before = network(image)
        after = network.fuse()(image)
    torch.testing.assert_close(after, before, atol=1e-3, rtol=1e-4)


def test_other_activations_are_built():
    network = Network(dict(layout('6.0', 'n'), activation='nn.ReLU()'))
    assert not any(isinstance(module, torch.nn.SiLU) for module in network.modules())


def changed(change):
    result = layout('6.0', 'n')
    change(result)
    return result


@pytest.mark.parametrize('change,reason', [
    (lambda given: given['backbone'].__setitem__(0, [-1, 1, 'os.system', ['x']]), 'unknown layer'),
    (lambda given: given['backbone'].__setitem__(0, [-1, 1, 'Conv', [10 ** 9, 3]]), 'million parameters'),
    (lambda given: given['backbone'].__setitem__(0, [-1, 10 ** 6, 'Conv', [64, 3]]), 'repeated'),
    (lambda given: given['backbone'].__setitem__(0, [-1, 1, 'Conv', [64, 10 ** 6]]), 'kernels'),
    (lambda given: given['backbone'].extend([[-1, 1, 'Conv', [8]]] * 200), 'layers'),
    (lambda given: given['head'].pop(), 'not Detect'),
    (lambda given: given.update(activation='__import__("os")'), 'unknown activation')])
def test_layouts_that_no_release_has_are_refused(change, reason):
    with pytest.raises(ValueError, match=reason):
        Network(changed(change))
