import numpy as np
import pytest

from ros_3d_bb.estimation.box3d_estimator import estimator_named
from ros_3d_bb.estimation.error_model import XBias, read_error_model
from ros_3d_bb.sessions.session_reader import read_depth, read_session
from ros_3d_bb_lab.evaluation.accuracy import truth_of
from ros_3d_bb_lab.evaluation.defaults import SIMULATED_ERROR_MODEL
from ros_3d_bb_lab.evaluation.error_model_fit import data_of, fit_error_model, held_out, scores_of
from ros_3d_bb_lab.evaluation.simulated_session import write_simulated_session
from support.error_models import MODEL, PLACES_M, measure

pytestmark = pytest.mark.slow  # each model is fitted many times
SIMPLE = MODEL._replace(x_bias=XBias(-0.1, 0.0, 0.02))


@pytest.fixture(scope='module')
def fitted():
    return fit_error_model(*measure(SIMPLE, 4), source='made', estimator='median', camera='none', date='2026-01-01')


def test_recovers_the_bias(fitted):
    true_m = np.array([[0.5, 0.0, 1.2], [-1.0, 0.2, 2.2], [1.2, 0.1, 3.8]])
    assert np.abs(fitted.corrected(SIMPLE.biased(true_m)) - true_m)[:, [0, 2]].max() < 0.03
    assert len(fitted.z_bias) == 3 and fitted.x_bias.per_angle_m == 0
    assert fitted.x_bias.slope == pytest.approx(-0.1, abs=0.01)


def test_ellipses_contain_their_share(fitted):
    measured_m, truth_m = measure(SIMPLE, 30, seed=2)
    corrected_m = fitted.corrected(measured_m)
    scores = scores_of(corrected_m, fitted.covariance(corrected_m), truth_m)
    assert 0.92 < scores.coverage_95 < 0.99 and 0.62 < scores.coverage_68 < 0.8


def test_scores_are_those_of_held_out_positions():
    measured_m, truth_m = measure(SIMPLE, 3)
    outlier = (truth_m == PLACES_M[10]).all(axis=1)
    measured_m[outlier, 2] += 0.3
    corrected_m, _covariances = held_out(data_of(measured_m, truth_m))
    assert (corrected_m[outlier, 2] - truth_m[outlier, 1]).mean() > 0.29


@pytest.mark.parametrize('edit,reason', [
    (lambda measured, truth: (measured[truth[:, 1] == 2.5], truth[truth[:, 1] == 2.5]), 'at 1 different z'),
    (lambda measured, truth: (np.where(measured == measured[3, 0], np.nan, measured), truth), 'not finite'),
    (lambda measured, truth: (np.c_[measured[:, :2], 0.3 * truth[:, 1]], truth), 'z_bias changes by 0.7 m')])
def test_invalid_measurements_are_rejected(edit, reason):
    with pytest.raises(ValueError, match=reason):
        fit_error_model(*edit(*measure(SIMPLE, 1, noise=0.0)))


def test_the_shipped_model_removes_the_bias_of_the_simulated_camera(tmp_path):
    """Mean errors away from the optical axis and in z at two ranges, where their standard errors are 0.017 and 0.01 m,
    and 0.004 and 0.006 m."""
    session = read_session(write_simulated_session(str(tmp_path), (1.5, 5.0), (-0.4, 0.4), 4))
    boxes = [frame.estimate(read_depth(frame, session), session.camera, estimator_named('foreground'))
             for frame in session.frames]
    truth_m = truth_of(session)
    corrected_m = read_error_model(SIMULATED_ERROR_MODEL).corrected(np.array([box.center_m for box in boxes]))
    error_m = (corrected_m[:, [0, 2]] - truth_m) * np.sign(truth_m)
    assert (np.abs(error_m.reshape(2, -1, 2).mean(axis=1)) < [[0.05, 0.05], [0.02, 0.03]]).all()
