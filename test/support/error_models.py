"""An error model with known numbers, and simulated measurements with its errors."""
import numpy as np

from ros_3d_bb.estimation.error_model import ErrorModel, MeasuredRange, Provenance, Spread, XBias

MODEL = ErrorModel(
    z_bias=(-0.04, 0.06, 0.008), x_bias=XBias(-0.05, -0.1, 0.02), z_sigma=Spread(0.01, 0.004, 0.0),
    x_sigma=Spread(0.02, 0.0, 0.0), y_sigma_m=0.1, measured_range=MeasuredRange(0.5, 4.0, 1.5, 1.0), growth_outside=0.2,
    provenance=Provenance('a test: of "keys", and #colours', 'median', 'none', '2026-01-01', 110, 22),
    cross_validated=None)
PLACES_M = np.array([(x, z) for z in (0.5, 1.0, 1.7, 2.5, 3.2, 4.0)
                     for x in (-1.5, 0.0, 0.7, 1.5) if z >= 1.0 or x == 0.0])


def measure(model, repetitions, seed=1, noise=1.0):
    """Simulated measurements at PLACES_M: measured (n, 3), truth (n, 2), metres."""
    random = np.random.RandomState(seed)
    truth_m = np.repeat(PLACES_M, repetitions, axis=0)
    true_m = np.stack((truth_m[:, 0], np.full(len(truth_m), 0.1), truth_m[:, 1]), axis=1)
    sigmas_m = np.sqrt(np.diagonal(model.covariance(true_m), axis1=1, axis2=2))
    return model.biased(true_m) + noise * sigmas_m * random.normal(size=true_m.shape), truth_m
