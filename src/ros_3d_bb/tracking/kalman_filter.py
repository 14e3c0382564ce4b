"""Constant-velocity Kalman filter in the plane, with a model of outliers behind the object.

Convention: lengths are in metres, times in seconds, in the fixed frame. If the depth of a box is that of the
background, the measurement lies behind the person on the viewing ray. The measurement error is therefore a mixture of
two Gaussians, one of them shifted along the ray. Several outliers in succession move the track behind the person, too.
A box that is nearer than the track by this shift therefore has two explanations, between which the track decides: the
track is misplaced, or the box is.

The algebra of 2x2 and 4x4 matrices is written out, because numpy takes several times as long for a few numbers.
"""
import math
from typing import Any, Callable, NamedTuple, Tuple

NEARER = 0.5  # share of boxes that are nearer by the offset of outliers, relative to that of outliers; chosen
LEAST_SHARE = 1e-12  # lower bound of the share of a component of the mixture, for its logarithm
LARGEST_EXPONENT = 700.0  # of math.exp


class State(NamedTuple('State', [('x', float), ('y', float), ('u', float), ('v', float), ('xx', float), ('xy', float),
                                 ('xu', float), ('xv', float), ('yy', float), ('yu', float), ('yv', float),
                                 ('uu', float), ('uv', float), ('vv', float)])):
    """State of the filter: mean (x, y, u, v) and the upper triangle of the covariance; (u, v) is the velocity."""

    __slots__ = ()

    @property
    def position_m2(self) -> float:
        """Variance of the position, the larger one of x and y."""
        return max(self.xx, self.yy)


class OutlierModel(NamedTuple):
    """Logarithms of the shares of inliers, of outliers, and of boxes that are nearer by their offset; mean and variance
    of this offset along the ray."""

    log_inliers: float
    log_outliers: float
    log_nearer: float
    offset_m: float
    spread_m2: float


def outlier_model(params: Any) -> OutlierModel:
    """The OutlierModel of `tracker.TrackerParams`."""
    shares = 1 - params.outlier_share, params.outlier_share, NEARER * params.outlier_share
    log_inliers, log_outliers, log_nearer = (math.log(max(share, LEAST_SHARE)) for share in shares)
    return OutlierModel(log_inliers, log_outliers, log_nearer, params.outlier_offset, params.outlier_spread ** 2)


def predict(state: State, elapsed_s: float, density: float) -> State:
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


def faster(state: State, elapsed_s: float, speed_m2: float) -> State:
    """The State predicted for `elapsed_s`, with `speed_m2` more variance of the velocity along each axis."""
    shift, spread = elapsed_s * speed_m2, elapsed_s * elapsed_s * speed_m2
    return state._replace(xx=state.xx + spread, xu=state.xu + shift, yy=state.yy + spread, yv=state.yv + shift,
                          uu=state.uu + speed_m2, vv=state.vv + speed_m2)


def weighted(x: Any, y: Any, xx: Any, xy: Any, yy: Any, log_share: float,
             log: Callable[[Any], Any] = math.log) -> Tuple[Any, Any, Any, Any]:
    """Logarithm of the density of an innovation z = (x, y) with the covariance S = (xx, xy, yy), times its share and
    2 pi; S^-1 z; and the determinant of S. With `log` = numpy.log, the numbers may be arrays that broadcast.
    """
    determinant = xx * yy - xy * xy
    a_x, a_y = (yy * x - xy * y) / determinant, (xx * y - xy * x) / determinant
    return log_share - (x * a_x + y * a_y + log(determinant)) / 2, a_x, a_y, determinant


def as_outlier(x: Any, y: Any, xx: Any, xy: Any, yy: Any, ray_x: Any, ray_y: Any,
               outliers: OutlierModel) -> Tuple[Any, Any, Any, Any, Any]:
    """Innovation and its covariance (x, y, xx, xy, yy) of an outlier, given those of an inlier and the viewing
    direction; the numbers may be arrays."""
    offset_m, spread_m2 = outliers.offset_m, outliers.spread_m2
    return (x - offset_m * ray_x, y - offset_m * ray_y, xx + spread_m2 * ray_x * ray_x, xy + spread_m2 * ray_x * ray_y,
            yy + spread_m2 * ray_y * ray_y)


def update(state: State, measurement: Any, outliers: OutlierModel) -> State:
    """The State after a Measurement; the mixture of both components is reduced to one Gaussian.

    With the columns C = P H^T of the covariance, component i has the gain C S_i^-1, moves the mean by C a_i, where
    a_i = S_i^-1 z_i, and the covariance to P - C S_i^-1 C^T. The mixture with the share b of outliers and e = a_1 - a_0
    moves the mean by C (a_0 + b e), and the covariance to P - C N C^T, where
    N = (1 - b) S_0^-1 + b S_1^-1 - b (1 - b) e e^T.
    """
    x, y, u, v, xx, xy, xu, xv, yy, yu, yv, uu, uv, vv = state
    z_x, z_y, s_xx, s_xy = measurement.x - x, measurement.y - y, xx + measurement.xx, xy + measurement.xy
    s_yy = yy + measurement.yy
    far_x, far_y, far_xx, far_xy, far_yy = as_outlier(z_x, z_y, s_xx, s_xy, s_yy, measurement.ray_x, measurement.ray_y,
                                                      outliers)
    log_inlier, a_x, a_y, determinant = weighted(z_x, z_y, s_xx, s_xy, s_yy, outliers.log_inliers)
    log_outlier, to_x, to_y, far_determinant = weighted(far_x, far_y, far_xx, far_xy, far_yy, outliers.log_outliers)
    share = 1 / (1 + math.exp(min(log_inlier - log_outlier, LARGEST_EXPONENT)))
    e_x, e_y, both = to_x - a_x, to_y - a_y, share * (1 - share)
    a_x, a_y = a_x + share * e_x, a_y + share * e_y
    weight, far_weight = (1 - share) / determinant, share / far_determinant
    n_xx = weight * s_yy + far_weight * far_yy - both * e_x * e_x
    n_xy = -weight * s_xy - far_weight * far_xy - both * e_x * e_y
    n_yy = weight * s_xx + far_weight * far_xx - both * e_y * e_y
    x_x, x_y, y_x, y_y = n_xx * xx + n_xy * xy, n_xy * xx + n_yy * xy, n_xx * xy + n_xy * yy, n_xy * xy + n_yy * yy
    u_x, u_y, v_x, v_y = n_xx * xu + n_xy * yu, n_xy * xu + n_yy * yu, n_xx * xv + n_xy * yv, n_xy * xv + n_yy * yv
    return State(x + xx * a_x + xy * a_y, y + xy * a_x + yy * a_y, u + xu * a_x + yu * a_y, v + xv * a_x + yv * a_y,
                 xx - x_x * xx - x_y * xy, xy - x_x * xy - x_y * yy, xu - x_x * xu - x_y * yu, xv - x_x * xv - x_y * yv,
                 yy - y_x * xy - y_y * yy, yu - y_x * xu - y_y * yu, yv - y_x * xv - y_y * yv,
                 uu - u_x * xu - u_y * yu, uv - u_x * xv - u_y * yv, vv - v_x * xv - v_y * yv)


def moved_back(place: Any, ray_x: float, ray_y: float, outliers: OutlierModel) -> Any:
    """A State or Measurement, moved against the direction (ray_x, ray_y) by the offset of outliers."""
    x, y, xx, xy, yy = as_outlier(place.x, place.y, place.xx, place.xy, place.yy, ray_x, ray_y, outliers)
    return place._replace(x=x, y=y, xx=xx, xy=xy, yy=yy)
