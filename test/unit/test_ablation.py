import pytest

from ros_3d_bb.estimation import depth_samples, foreground
from ros_3d_bb_lab.evaluation.ablation.benchmark import MECHANISMS, Mechanism, ablate, check, without


@pytest.mark.parametrize('mechanism', MECHANISMS, ids=lambda mechanism: mechanism.name)
def test_each_mechanism_exists(mechanism):
    check(mechanism)


def test_a_mechanism_is_off_wherever_it_is_imported_and_on_again_afterwards():
    mechanism = Mechanism('reach of a body', 'estimation.depth_samples', 'BODY_HALF_DEPTH_MM', 7)

    def reaches_mm():
        return {'here': depth_samples.BODY_HALF_DEPTH_MM, 'there': foreground.BODY_HALF_DEPTH_MM}
    before_mm = reaches_mm()
    assert ablate([reaches_mm, reaches_mm], [mechanism]) == {
        '': {key: 2 * value for key, value in before_mm.items()}, 'reach of a body': {'here': 14, 'there': 14}}
    assert reaches_mm() == before_mm


def test_a_mechanism_that_does_not_exist_is_named():
    missing = Mechanism('reach', 'estimation.depth_samples', 'RectSamples.reach', None)
    with pytest.raises(ValueError, match="'reach': ros_3d_bb.estimation.depth_samples has no RectSamples.reach"):
        with without(missing):
            pass
