import glob
import os

import numpy as np
import pytest
import yaml
from hypothesis import given, settings, strategies as st

from ros_3d_bb.core.detector_model import DetectorModel
from ros_3d_bb.estimation.box3d import Box3D
from ros_3d_bb.estimation.error_model import (Scores, Spread, XBias, checked, corrected_boxes, read_error_model,
                                              write_error_model)
from support.error_models import MODEL

SHIPPED = os.path.join(os.path.dirname(os.path.abspath(__file__)), os.pardir, os.pardir, 'config', 'error_models')
small = st.floats(-0.05, 0.05)
positions = st.tuples(st.floats(-5, 5), st.floats(-2, 2), st.floats(0.6, 20))
models = st.builds(lambda z, x, angle, offset: MODEL._replace(z_bias=z, x_bias=XBias(x, angle, offset)),
                   st.lists(small, min_size=1, max_size=3).map(tuple), small, small, small)


@given(models, st.lists(positions, min_size=1, max_size=5))
def test_correction_is_the_inverse_of_the_bias(model, true_m):
    assert np.allclose(checked(model).corrected(model.biased(true_m)), true_m, atol=1e-5)


def test_the_bias_is_that_of_the_true_position():
    x_m, y_m, z_m = MODEL.biased([1.0, 0.3, 3.0])
    assert z_m == pytest.approx(3.0 - 0.36 + 0.18 + 0.008)
    assert x_m == pytest.approx(1.0 - 0.05 - 0.1 / 3 + 0.02)
    assert y_m / z_m == pytest.approx(0.1)  # y changes along the ray


def test_the_bias_is_constant_outside_of_the_measured_range():
    end, beyond = MODEL.biased([[0.0, 0.0, 4.0], [0.0, 0.0, 9.0]])
    assert beyond[2] - 9.0 == pytest.approx(end[2] - 4.0)
    assert np.diff(MODEL.corrected([[0, 0, 8.0], [0, 0, 9.0]])[:, 2]) == pytest.approx(1.0)


def test_covariance_is_the_spread_inside_and_grows_outside():
    inside, far, aside, near = MODEL.covariance([[0, 0, 2.0], [0, 0, 7.0], [2.5, 0, 2.0], [0, 0, 0.4]])
    assert np.allclose(inside, np.diag([0.02 ** 2, 0.1 ** 2, 0.01 ** 2 + 0.016 ** 2]))
    assert far[2, 2] == pytest.approx(0.01 ** 2 + (0.004 * 49) ** 2 + 0.6 ** 2)
    assert np.allclose(aside - inside, 0.2 ** 2 * np.eye(3))
    assert (np.diag(near) > np.diag(MODEL.covariance([0, 0, 0.5]))).all()


def test_only_positions_before_the_camera_are_corrected_and_stay_there():
    assert MODEL._replace(z_bias=(0.3,)).corrected([[0.0, 0.2, 0.1]])[0, 2] > 0
    with pytest.raises(ValueError, match='z is -1 m'):
        MODEL.corrected([[0, 0, 1], [0, 0, -1]])


@pytest.mark.parametrize('change,reason', [
    ({'z_bias': (-0.2, 0.0, 0.0)}, 'z_bias changes by 1.6 m a metre'),
    ({'x_bias': XBias(0.1, -2.0, 0.0)}, 'x_bias changes by 1.9 m'),
    ({'z_bias': (0.0, 0.9)}, 'z_bias is 0.9 m'),
    ({'z_sigma': Spread(0.0, 0.0, 0.0)}, 'z_sigma'), ({'x_sigma': Spread(0.1, 0.0, -0.1)}, 'x_sigma'),
    ({'y_sigma_m': -1.0}, 'y_sigma_m is -1'), ({'growth_outside': -0.1}, 'growth_outside is -0.1'),
    ({'measured_range': MODEL.measured_range._replace(z_max_m=0.1)}, r'measured_range is \(0.5, 0.1')])
def test_unusable_models_are_rejected(change, reason):
    with pytest.raises(ValueError, match=reason):
        checked(MODEL._replace(**change))


@settings(max_examples=30)
@given(models, st.one_of(st.none(), st.builds(Scores, *[st.floats(0, 1)] * 5)), st.sampled_from([None, 20.0]))
def test_models_survive_a_file(tmp_path_factory, model, scores, range_m):
    path = str(tmp_path_factory.getbasetemp() / 'model.yaml')
    model = model._replace(cross_validated=scores, detector=DetectorModel(0.06, 1.2, 0.8, range_m))
    write_error_model(path, model)
    assert read_error_model(path) == model


@pytest.mark.parametrize('edit', [lambda content: content.pop('detector'),
                                  lambda content: content.update(detector={}),
                                  lambda content: content.update(detector={'correlation_time_s': 0.5})])
def test_missing_keys_of_the_detector_have_defaults(tmp_path, edit):
    assert read_error_model(edited(tmp_path, edit)).detector == DetectorModel()


def edited(folder, edit):
    path = folder / 'model.yaml'
    write_error_model(path, MODEL)
    content = yaml.safe_load(path.read_text())
    edit(content)
    path.write_text(yaml.safe_dump(content))
    return path


@pytest.mark.parametrize('edit,reason', [
    (lambda content: content.update(z_bais=[1]), 'unknown key z_bais; did you mean z_bias'),
    (lambda content: content['x_sigma'].pop('growth'), r'the key x_sigma\.growth is missing'),
    (lambda content: content.update(z_bias=[]), r'z_bias is \[\]'),
    (lambda content: content.update(z_bias=[1, 'two']), "z_bias is 'two'; a number expected"),
    (lambda content: content.update(y_sigma_m=float('nan')), 'y_sigma_m is nan; a number expected'),
    (lambda content: content.update(x_sigma=3), 'x_sigma is 3; the keys constant_m, growth, near_m2 expected'),
    (lambda content: content['detector'].update(max_range_m=-1), r'detector\.max_range_m is -1; more than 0, or null'),
    (lambda content: content['detector'].update(detection_probability=1), r'detection_probability is 1; more than 0'),
    (lambda content: content['detector'].update(lasting_sigma_m=-0.1), r'lasting_sigma_m is -0\.1; 0 to 10 expected'),
    (lambda content: content['detector'].update(correlation_time_s=1e9), 'correlation_time_s is 1e')])
def test_invalid_files_are_rejected(tmp_path, edit, reason):
    path = edited(tmp_path, edit)
    with pytest.raises(ValueError, match=reason) as error:
        read_error_model(path)
    assert str(path) in str(error.value)


def test_shipped_models_are_readable_and_the_thesis_one_is_published():
    for path in glob.glob(os.path.join(SHIPPED, '*.yaml')):
        assert read_error_model(path).provenance.source
    model = read_error_model(os.path.join(SHIPPED, 'thesis.yaml'))
    assert model.z_bias == (-0.04, 0.06, 0.008) and model.x_bias == (-0.106, 0.0, -0.006)
    assert np.sqrt(np.diag(model.covariance([0.5, 0, 2])))[[0, 2]] == pytest.approx([0.018, 0.0474])


def test_a_model_of_recorded_positions_is_for_any_estimator():
    for estimator in ('', 'recorded', 'foreground'):
        MODEL._replace(provenance=MODEL.provenance._replace(estimator=estimator)).check_estimator('foreground')
    with pytest.raises(ValueError, match='for the estimator median, not foreground'):
        MODEL.check_estimator('foreground')


def test_boxes_are_corrected_and_get_their_covariance():
    box = Box3D(np.array([0.5, 0.1, 2.0]), np.array([0.5, 1.7, 0.5]), (1, 2, 3, 4), 0.9, (False,) * 4)
    other = box._replace(center_m=np.array([-0.5, 0.0, 3.0]))
    assert corrected_boxes([], MODEL) == []
    for result, given_box in zip(corrected_boxes([box, other], MODEL), (box, other)):
        assert result.size_m is box.size_m
        np.testing.assert_allclose(result.center_m, MODEL.corrected(given_box.center_m))
        np.testing.assert_allclose(result.covariance_m2, MODEL.covariance(result.center_m))
    behind = box._replace(center_m=np.array([0.1, 0.9, -0.2]))  # of a person right before a tilted camera
    first, second = corrected_boxes([box, behind], MODEL)
    np.testing.assert_allclose(first.center_m, MODEL.corrected(box.center_m))
    assert second.center_m.tolist() == [0.1, 0.9, -0.2] and np.linalg.eigvalsh(second.covariance_m2).min() > 0
    uncalibrated, = corrected_boxes([box])
    assert uncalibrated.center_m.tolist() == box.center_m.tolist()
    np.testing.assert_allclose(uncalibrated.covariance_m2, 0.01 * np.eye(3))


@pytest.mark.parametrize('model', [MODEL, None])
@pytest.mark.parametrize('changed,gap_s,larger_m', [
    ({'support': 0.15}, 0, (0.2, 0, 0.125)), ({'truncated_edges': (False, True, False, False)}, 0, (0.06, 0, 0.03)),
    ({}, 0.1, (0.095, 0, 0.095))])
def test_covariance_grows_with_low_support_truncation_and_image_gap(model, changed, gap_s, larger_m):
    box = Box3D(np.array([0.5, 0.1, 2.0]), np.array([0.5, 1.7, 0.5]), (1, 2, 3, 4), 0.9, (False,) * 4)
    before, = corrected_boxes([box], model)
    after, = corrected_boxes([box._replace(**changed)], model, gap_s)
    np.testing.assert_allclose(after.covariance_m2 - before.covariance_m2, np.diag(larger_m) ** 2, atol=1e-12)
