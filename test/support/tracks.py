"""Tracks with known motion."""
import numpy as np

from ros_3d_bb.tracking.types import VISIBLE, TrackedObject

STEP_S = 0.25


def track_at(position_m, velocity_mps, prediction_m=None, moving=True, covariance=None, number=1):
    """A track whose prediction is straight ahead for 2 s, where none is given."""
    position_m, velocity_mps = np.array(position_m, float), np.array(velocity_mps, float)
    if prediction_m is None:
        prediction_m = position_m + np.outer(STEP_S * np.arange(1, 9), velocity_mps)
    return TrackedObject(number, position_m, np.array([0.5, 0.5, 1.7]), velocity_mps, VISIBLE, moving, 0,
                         0, np.reshape(prediction_m, (-1, 3)), STEP_S, covariance)
