"""Constant-velocity Kalman filter in the plane, with a model of outliers behind the object.

Convention: lengths are in metres, times in seconds, in the fixed frame. If the depth of a box is that of the
background, the measurement lies behind the person on the viewing ray. The measurement error is therefore a mixture of
two Gaussians, one of them shifted along the ray.

The algebra of 2x2 and 4x4 matrices is written out, because numpy takes ten times as long for a few numbers.
"""
import math
from typing import NamedTuple

NEVER = 1e-12  # lower bound of the share of a component of the mixture, for its logarithm
LARGEST_EXPONENT = 700.0  # of math.exp


class State(NamedTuple):
    """State of the filter: mean (x, y, u, v) and the upper triangle of the covariance; (u, v) is the velocity."""

    x: float
    y: float
    u: float
    v: float
    xx: float
    xy: float
    xu: float
    xv: float
    yy: float
    yu: float
    yv: float
    uu: float
    uv: float
    vv: float

    @property
    def position_m2(self):
        """Variance of the position, the larger one of x and y."""
        return max(self.xx, self.yy)


class OutlierModel(NamedTuple):
    """Logarithms of the shares of inliers and outliers; mean and variance of the shift of outliers along the ray."""

    log_inliers: float
    log_outliers: float
    offset_m: float
    spread_m2: float


def outlier_model(params):
    """The OutlierModel of `tracker.TrackerParams`."""
    return OutlierModel(math.log(max(1 - params.outlier_share, NEVER)), math.log(max(params.outlier_share, NEVER)),
                        params.outlier_offset, params.outlier_spread ** 2)


def predict(state, elapsed_s, density):
    """The State `elapsed_s` ahead, with white-noise acceleration of `density` m²/s³ (Bar-Shalom et al., 2001, 6.2.2).
    """
    x, y, u, v, xx, xy, xu, xv, yy, yu, yv, uu, uv, vv = state
    time2 = elapsed_s * elapsed_s
    position, both, velocity = density * elapsed_s * time2 / 3, density * time2 / 2, density * elapsed_s
    return State(x + elapsed_s * u, y + elapsed_s * v, u, v,
                 xx + 2 * elapsed_s * xu + time2 * uu + position, xy + elapsed_s * (xv + yu) + time2 * uv,
                 xu + elapsed_s * uu + both, xv + elapsed_s * uv,
                 yy + 2 * elapsed_s * yv + time2 * vv + position, yu + elapsed_s * uv, yv + elapsed_s * vv + both,
                 uu + velocity, uv, vv + velocity)


def log_densities(x, y, xx, xy, yy, ray_x, ray_y, outliers, log=math.log):
    """Logarithms of the densities of an innovation (x, y) with the covariance (xx, xy, yy), plus log 2 pi, as an inlier
    and as an outlier, each with its share. `ray_x`, `ray_y` is the viewing direction.

    With `log` = numpy.log, the numbers may be arrays that broadcast.
    """
    determinant = xx * yy - xy * xy
    distance2 = (yy * x * x - 2 * xy * x * y + xx * y * y) / determinant
    inlier = outliers.log_inliers - (distance2 + log(determinant)) / 2
    x, y = x - outliers.offset_m * ray_x, y - outliers.offset_m * ray_y
    xx, yy = xx + outliers.spread_m2 * ray_x * ray_x, yy + outliers.spread_m2 * ray_y * ray_y
    xy = xy + outliers.spread_m2 * ray_x * ray_y
    determinant = xx * yy - xy * xy
    distance2 = (yy * x * x - 2 * xy * x * y + xx * y * y) / determinant
    return inlier, outliers.log_outliers - (distance2 + log(determinant)) / 2


def update(state, measurement, outliers):
    """The State after a Measurement; the mixture of both components is reduced to one Gaussian."""
    x, y = measurement.x - state.x, measurement.y - state.y
    xx, xy, yy = state.xx + measurement.xx, state.xy + measurement.xy, state.yy + measurement.yy
    ray_x, ray_y, spread_m2 = measurement.ray_x, measurement.ray_y, outliers.spread_m2
    inlier, outlier = log_densities(x, y, xx, xy, yy, ray_x, ray_y, outliers)
    share = 1 / (1 + math.exp(min(inlier - outlier, LARGEST_EXPONENT)))  # of the outlier
    gain_x, gain_y = _gain(state, xx, xy, yy)
    shift = [of_x * x + of_y * y for of_x, of_y in zip(gain_x, gain_y)]
    outlier_x, outlier_y = _gain(state, xx + spread_m2 * ray_x * ray_x, xy + spread_m2 * ray_x * ray_y,
                                 yy + spread_m2 * ray_y * ray_y)
    x, y = x - outliers.offset_m * ray_x, y - outliers.offset_m * ray_y
    apart = [of_x * x + of_y * y - own for of_x, of_y, own in zip(outlier_x, outlier_y, shift)]
    return _mixed(state, share, [own + share * (other - own) for own, other in zip(gain_x, outlier_x)],
                  [own + share * (other - own) for own, other in zip(gain_y, outlier_y)], shift, apart)


def _gain(state, xx, xy, yy):
    """The two columns (4,) of the Kalman gain, for an innovation covariance."""
    determinant = xx * yy - xy * xy
    xx, xy, yy = yy / determinant, -xy / determinant, xx / determinant  # the inverse
    by_x, by_y = (state.xx, state.xy, state.xu, state.xv), (state.xy, state.yy, state.yu, state.yv)
    return ([xx * of_x + xy * of_y for of_x, of_y in zip(by_x, by_y)],
            [xy * of_x + yy * of_y for of_x, of_y in zip(by_x, by_y)])


def _mixed(state, share, gain_x, gain_y, shift, apart):
    """The State of the mixture, given the mean gain, the shift by the inlier, and how far apart the means (4,) are."""
    x, y, u, v, xx, xy, xu, xv, yy, yu, yv, uu, uv, vv = state
    (x_x, u_x, v_x), (x_y, y_y, u_y, v_y) = (gain_x[0], gain_x[2], gain_x[3]), gain_y
    y_x, spread, (dx, dy, du, dv) = gain_x[1], share * (1 - share), apart
    return State(x + shift[0] + share * dx, y + shift[1] + share * dy, u + shift[2] + share * du,
                 v + shift[3] + share * dv,
                 xx - x_x * xx - x_y * xy + spread * dx * dx, xy - x_x * xy - x_y * yy + spread * dx * dy,
                 xu - x_x * xu - x_y * yu + spread * dx * du, xv - x_x * xv - x_y * yv + spread * dx * dv,
                 yy - y_x * xy - y_y * yy + spread * dy * dy,
                 yu - y_x * xu - y_y * yu + spread * dy * du, yv - y_x * xv - y_y * yv + spread * dy * dv,
                 uu - u_x * xu - u_y * yu + spread * du * du, uv - u_x * xv - u_y * yv + spread * du * dv,
                 vv - v_x * xv - v_y * yv + spread * dv * dv)
