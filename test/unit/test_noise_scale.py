"""Noise of boxes without a covariance, which the tracker learns from innovations."""
import numpy as np
import pytest

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.tracker import Tracker
from ros_3d_bb.tracking.types import CameraView, Detection

VIEW, SIZE_M = CameraView(np.eye(4)), np.array([0.5, 0.5, 1.7])
SECONDS, RATE_HZ = 20, 5
ASSUMED_M = 0.1  # `noise_unknown`


def walk(tracker, sigma_m, covariance_m2=None, seed=0, turns=0.4):
    """A person walks along a wavy line, and is measured with errors of `sigma_m`. Returns the last tracks, and the
    share of the images of the second half with the person in the 95 % ellipse."""
    random, inside = np.random.RandomState(seed), []
    for number in range(SECONDS * RATE_HZ):
        time_s = number / RATE_HZ
        place_m = np.array([1.2 * time_s - 10, 5 + np.sin(turns * time_s), 0.85])
        measured_m = place_m + sigma_m * random.normal(size=3) * (1, 1, 0)
        tracks = tracker.update(int(round((1 + time_s) * NS)), [Detection(measured_m, SIZE_M, covariance_m2)], VIEW)
        if number > SECONDS * RATE_HZ / 2:
            error_m = tracks[0].position_m[:2] - place_m[:2]
            inside.append(error_m.dot(np.linalg.solve(tracks[0].covariance[:2, :2], error_m)) < 5.99)
    return tracks, np.mean(inside)


def velocity_sigma_mps(tracks):
    return np.sqrt(tracks[0].covariance[3, 3])


@pytest.mark.parametrize('sigma_m', [0.005, 0.02, 0.1, 0.15])
def test_ellipses_hold_whatever_the_errors_are(sigma_m):
    shares = [walk(Tracker(), sigma_m, seed=seed)[1] for seed in range(5)]
    assert np.mean(shares) > 0.9


def test_known_covariances_are_used_as_they_are():
    known = ASSUMED_M ** 2 * np.eye(3)
    exact, _share = walk(Tracker(), 0.005, known)
    noisy, _share = walk(Tracker(), 0.05, known)
    assert velocity_sigma_mps(exact) == pytest.approx(velocity_sigma_mps(noisy), rel=0.05)


def test_the_learned_noise_outlives_the_tracks():
    tracker = Tracker()
    walk(tracker, 0.005, turns=0.8)
    tracker.reset()
    learned, new = ([other.update(100 * NS + number * NS // 5, [Detection(np.array([3, 0.1 * number, 0.85]), SIZE_M)],
                                  VIEW) for number in range(4)][-1] for other in (tracker, Tracker()))
    assert velocity_sigma_mps(learned) < 0.8 * velocity_sigma_mps(new)
