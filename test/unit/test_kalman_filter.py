"""The filter's laws: it is a Kalman filter where nothing is an outlier, the same at any frame rate, and not fooled."""
import numpy as np
import pytest
from hypothesis import given, strategies as st

from ros_3d_bb.tracking.kalman_filter import negative_log_likelihood, predict, update
from ros_3d_bb.tracking.measurement_model import MEASUREMENT
from ros_3d_bb.tracking.tracker import TrackerParams

OUTLIERS, NONE = TrackerParams(), TrackerParams(outlier_share=0.0)
SECONDS = st.floats(0.01, 2)


def state(position=(0, 0), velocity=(0, 0), spread=0.3, speed_spread=0.8):
    return (np.array([tuple(position) + tuple(velocity)], float),
            np.diag([spread ** 2, spread ** 2, speed_spread ** 2, speed_spread ** 2])[None])


def measured_at(positions_m, sigma=0.1):
    """Measurements (m,) on viewing rays along x."""
    measurements = np.zeros(len(positions_m), MEASUREMENT)
    measurements['position_m'], measurements['noise_m2'] = positions_m, np.eye(2) * sigma ** 2
    measurements['ray'] = 1.0, 0.0
    return measurements


@given(SECONDS, SECONDS)
def test_two_steps_are_one(first_s, second_s):
    mean, covariance = state((1, 2), (0.5, -1))
    once = predict(mean, covariance, first_s + second_s, 0.08)
    twice = predict(*predict(mean, covariance, first_s, 0.08), elapsed_s=second_s, density=0.08)
    for one, other in zip(once, twice):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12)


@given(st.floats(-1, 1), st.floats(-1, 1), st.floats(0.02, 0.5))
def test_without_outliers_it_is_the_textbook_filter(x, y, sigma):
    mean, covariance = state()
    covariance[0, 0, 2] = covariance[0, 2, 0] = 0.1
    matrix = np.eye(2, 4)
    innovation = matrix.dot(covariance[0]).dot(matrix.T) + sigma ** 2 * np.eye(2)
    gain = covariance[0].dot(matrix.T).dot(np.linalg.inv(innovation))
    got_mean, got_covariance = update(mean, covariance, measured_at([(x, y)], sigma), NONE)
    np.testing.assert_allclose(got_mean[0], gain.dot([x, y]), atol=1e-9)
    np.testing.assert_allclose(got_covariance[0], (np.eye(4) - gain.dot(matrix)).dot(covariance[0]), atol=1e-9)


def test_a_measurement_behind_the_person_is_an_outlier_and_one_beside_is_not():
    """0.8 m behind is what a background pixel looks like; 0.8 m beside no background explains."""
    sure = state(spread=0.1)
    behind, _covariance = update(*sure, measurements=measured_at([(0.8, 0.0)]), params=OUTLIERS)
    beside, _covariance = update(*sure, measurements=measured_at([(0.0, 0.8)]), params=OUTLIERS)
    plain, _covariance = update(*sure, measurements=measured_at([(0.8, 0.0)]), params=NONE)
    assert abs(behind[0, 0]) < 0.1 and plain[0, 0] == pytest.approx(0.4, abs=1e-4)
    assert beside[0, 1] == pytest.approx(0.4, abs=1e-4)


def test_likelihood_is_a_density():
    """p, summed over a fine grid of places, is a probability of 1."""
    mean, covariance = state(spread=0.2)
    step_m = 0.05
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(-3, 4, step_m), np.arange(-3, 3, step_m)))
    cost = negative_log_likelihood(mean, covariance, measured_at(np.column_stack((x, y))), OUTLIERS)
    assert np.exp(-cost).sum() * step_m ** 2 == pytest.approx(1, abs=0.01)


def test_all_pairs_are_as_likely_as_each_alone():
    random = np.random.RandomState(3)
    mean, covariance = random.normal(0, 1, (3, 4)), np.tile(np.eye(4) * 0.1, (3, 1, 1))
    measurements = measured_at(random.normal(0, 1, (5, 2)))
    cost = negative_log_likelihood(mean, covariance, measurements, OUTLIERS)
    assert cost.shape == (3, 5)
    alone = negative_log_likelihood(mean[1:2], covariance[1:2], measurements[2:3], OUTLIERS)
    assert cost[1, 2] == pytest.approx(alone[0, 0])
