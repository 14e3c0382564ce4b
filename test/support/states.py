"""States of the Kalman filter as vectors and matrices."""
import numpy as np

from ros_3d_bb.tracking.kalman_filter import State


def mean_of(state):
    return np.array(state[:4])


def covariance_of(state):
    covariance = np.zeros((4, 4))
    covariance[np.triu_indices(4)] = state[4:]
    return covariance + np.triu(covariance, 1).T


def state_of(mean, covariance):
    return State(*np.array(mean, float).tolist() + np.array(covariance, float)[np.triu_indices(4)].tolist())
