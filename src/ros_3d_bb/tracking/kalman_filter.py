"""Constant-velocity Kalman filter in the plane, vectorised over objects, with a model of outliers behind the object.

Convention: a state is (x, y, vx, vy), metres and m/s, in the fixed frame; `mean` is (n, 4), `covariance` (n, 4, 4).
`measurements` is an array of `measurement_model.MEASUREMENT`, `params` has the `outlier_` fields of
`tracker.TrackerParams`. If the depth of a box is that of the background, the measurement lies behind the person on the
viewing ray. The measurement error is therefore a mixture of two Gaussians, one of them shifted along the ray.
"""
import numpy as np


def predict(mean, covariance, elapsed_s, density):
    """Mean and covariance `elapsed_s` ahead, with white-noise acceleration of `density` m²/s³ (Bar-Shalom et al., 2001,
    6.2.2), which is a number or an array (n,)."""
    step = np.eye(4)
    step[0, 2] = step[1, 3] = elapsed_s
    position, both = elapsed_s ** 3 / 3, elapsed_s ** 2 / 2
    white = np.array([[position, 0, both, 0], [0, position, 0, both], [both, 0, elapsed_s, 0], [0, both, 0, elapsed_s]])
    noise = np.asarray(density)[..., None, None] * white
    return mean.dot(step.T), step.dot(covariance).transpose(1, 0, 2).dot(step.T) + noise


def negative_log_likelihood(mean, covariance, measurements, params):
    """-log p (n, m), where p is the density of each measurement given each object, per m²."""
    (inlier, outlier), _innovation, _inverse = _fit(mean[:, None], covariance[:, None], measurements, params)
    return np.log(2 * np.pi) - np.logaddexp(inlier, outlier)


def update(mean, covariance, measurements, params):
    """Mean and covariance after one measurement for each state; the mixture is reduced to one Gaussian."""
    logs, (x, y), (inverse_xx, inverse_xy, inverse_yy) = (
        [values[..., None] for values in group] for group in _fit(mean, covariance, measurements, params))
    of_x, of_y = covariance[:, 0], covariance[:, 1]
    gain_x, gain_y = inverse_xx * of_x + inverse_xy * of_y, inverse_xy * of_x + inverse_yy * of_y
    means = mean + gain_x * x + gain_y * y
    covariances = covariance - gain_x[..., None] * of_x[:, None] - gain_y[..., None] * of_y[:, None]
    share = np.exp(logs[1] - np.logaddexp(*logs))
    shift = means[1] - means[0]
    mixed = covariances[0] + share[..., None] * (covariances[1] - covariances[0])
    mixed += (share * (1 - share) * shift)[:, :, None] * shift[:, None, :]
    return means[0] + share * shift, (mixed + mixed.transpose(0, 2, 1)) / 2


def _fit(mean, covariance, measurements, params):
    """Log likelihoods plus log(2 pi), innovations (x, y) and inverse innovation covariances (xx, xy, yy). The first
    axis of each is that of the components of the mixture, the inliers and the outliers.

    Computed element by element, because numpy is several times slower on stacks of 2x2 matrices.
    """
    components = (2,) + (1,) * (mean.ndim - 1)
    shares = np.reshape((1 - params.outlier_share, params.outlier_share), components)
    offsets_m, spreads_m = (np.reshape((0, outlier_m), components)
                            for outlier_m in (params.outlier_offset, params.outlier_spread))
    ray_x, ray_y = measurements['ray'][..., 0], measurements['ray'][..., 1]
    x = measurements['position_m'][..., 0] - mean[..., 0] - offsets_m * ray_x
    y = measurements['position_m'][..., 1] - mean[..., 1] - offsets_m * ray_y
    noise_m2, spreads_m2 = measurements['noise_m2'], spreads_m ** 2
    xx = covariance[..., 0, 0] + noise_m2[..., 0, 0] + spreads_m2 * (ray_x * ray_x)
    xy = covariance[..., 0, 1] + noise_m2[..., 0, 1] + spreads_m2 * (ray_x * ray_y)
    yy = covariance[..., 1, 1] + noise_m2[..., 1, 1] + spreads_m2 * (ray_y * ray_y)
    determinant = xx * yy - xy * xy
    inverse = yy / determinant, -xy / determinant, xx / determinant
    distance = inverse[0] * x * x + 2 * inverse[1] * x * y + inverse[2] * y * y
    return np.log(np.maximum(shares, 1e-12)) - (distance + np.log(determinant)) / 2, (x, y), inverse
