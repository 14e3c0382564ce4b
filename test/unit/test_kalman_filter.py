from types import SimpleNamespace

import numpy as np
from hypothesis import given, strategies as st

from ros_3d_bb.tracking.kalman_filter import outlier_model, predict, update
from ros_3d_bb.tracking.tracker import TrackerParams
from support.states import covariance_of, mean_of, state_of

OUTLIERS = outlier_model(TrackerParams())
SECONDS = st.floats(0.01, 2)


def measured_at(x, y, sigma=0.1, ray=(1.0, 0.0)):
    """A measurement on a viewing ray, along x by default."""
    return SimpleNamespace(x=x, y=y, xx=sigma ** 2, xy=0.0, yy=sigma ** 2, ray_x=ray[0], ray_y=ray[1])


@given(SECONDS, st.integers(0, 1000))
def test_the_prediction_is_that_of_the_textbook(elapsed_s, seed):
    """F P F^T + Q with matrices."""
    factors = np.random.RandomState(seed).normal(0, 1, (4, 4))
    start, step = state_of((1, 2, 0.5, -1), factors.dot(factors.T)), np.eye(4)
    step[0, 2] = step[1, 3] = elapsed_s
    white = np.array([[elapsed_s ** 3 / 3, elapsed_s ** 2 / 2], [elapsed_s ** 2 / 2, elapsed_s]])
    after = predict(start, elapsed_s, 0.08)
    np.testing.assert_allclose(mean_of(after), step.dot(mean_of(start)))
    np.testing.assert_allclose(covariance_of(after), step.dot(covariance_of(start)).dot(step.T)
                               + 0.08 * np.kron(white, np.eye(2)), rtol=1e-9, atol=1e-12)


@given(st.integers(0, 1000))
def test_the_mixture_has_the_mean_and_the_covariance_of_both_updates(seed):
    random = np.random.RandomState(seed)
    factors, angle = random.normal(0, 0.5, (4, 4)), random.uniform(-np.pi, np.pi)
    mean, covariance, ray = random.normal(0, 1, 4), factors.dot(factors.T), np.array([np.cos(angle), np.sin(angle)])
    place_m, matrix, means, covariances, densities = random.normal(0, 0.5, 2), np.eye(2, 4), [], [], []
    for share, offset_m, spread_m in ((0.9, 0.0, 0.0), (0.1, 0.45, 0.3)):
        innovation = place_m - mean[:2] - offset_m * ray
        spread = covariance[:2, :2] + 0.1 ** 2 * np.eye(2) + spread_m ** 2 * np.outer(ray, ray)
        gain = covariance.dot(matrix.T).dot(np.linalg.inv(spread))
        means.append(mean + gain.dot(innovation))
        covariances.append(covariance - gain.dot(matrix).dot(covariance))
        distance2 = innovation.dot(np.linalg.solve(spread, innovation))
        densities.append(share * np.exp(-distance2 / 2) / np.sqrt(np.linalg.det(spread)))
    shares, mixed = np.array(densities) / sum(densities), np.average(means, axis=0, weights=densities)
    spreads = [part + np.outer(own - mixed, own - mixed) for part, own in zip(covariances, means)]
    after = update(state_of(mean, covariance), measured_at(*place_m, ray=ray), OUTLIERS)
    np.testing.assert_allclose(mean_of(after), mixed, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(covariance_of(after), np.average(spreads, axis=0, weights=shares), rtol=1e-6, atol=1e-8)
