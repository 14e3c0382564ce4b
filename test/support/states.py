"""States of the Kalman filter as vectors and matrices."""
import numpy as np

from ros_3d_bb.tracking.kalman_filter import State


def mean_of(state):
    """Mean (4,) of a State."""
    return np.array(state[:4])


def covariance_of(state):
    """Covariance (4, 4) of a State."""
    covariance = np.zeros((4, 4))
    covariance[np.triu_indices(4)] = state[4:]
    return covariance + np.triu(covariance, 1).T


def state_of(mean, covariance):
    """Inverse of `mean_of` and `covariance_of`."""
    return State(*np.array(mean, float).tolist() + np.array(covariance, float)[np.triu_indices(4)].tolist())
