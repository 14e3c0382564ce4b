"""Error model of measured positions: bias, which is corrected, and covariance.

Convention: positions (x, y, z) are in the camera optical frame, metres; error = measured - truth. The bias is a
function of the TRUE position, as in the thesis: the noise is in the camera's measurement, not in the tape measure's
ground truth, and a fit as a function of the measured position would pull every position towards the middle of the data.
A node knows only the measured position, so `ErrorModel.corrected` solves measured = truth + bias(truth). The model is
fitted by ros_3d_bb_lab.evaluation.error_model_fit; its file format is described in config/error_models/README.md.
"""
import math
from typing import Any, Callable, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np
import yaml

from ros_3d_bb.core import detector_model
from ros_3d_bb.core.detector_model import DetectorModel
from ros_3d_bb.core.yaml_loader import load_yaml
from ros_3d_bb.core.yaml_records import record_from, record_text
from ros_3d_bb.estimation.box3d import Box3D

Point = Tuple[float, float, float]
STEEPEST_BIAS, SOLVER_STEPS = 0.5, 20  # m/m; a fixed-point iteration: each step halves the error, 1 m to 1 µm
NEAREST_SHARE = 0.2  # lower bound of a corrected range, relative to the measured range: it stays before the camera
RECORDED = 'recorded'  # estimator of models that are fitted to the positions stored in a session
UNCALIBRATED_SIGMA_M = 0.1  # of positions without an error model; the RMSE of raw positions in ./run bench accuracy
# Additional standard deviations along x and z: per unit of support below the first value, and of boxes at the image
# border. Fitted to simulated crowds; measured by test_covariances_hold_for_any_support of test_difficult_views.py.
WELL_SUPPORTED, SUPPORT_SIGMAS_M, TRUNCATED_SIGMAS_M = 0.65, (0.4, 0.0, 0.25), (0.06, 0.0, 0.03)
WALKING_MPS = (0.95, 0.0, 0.95)  # standard deviations: 1.34 m/s (Weidmann, 1993) in any direction, 1.34 / sqrt(2)


class XBias(NamedTuple):
    """Lateral bias at the true (x, z): slope * x + per_angle_m * x / z + offset_m, metres."""

    slope: float
    per_angle_m: float
    offset_m: float


class Spread(NamedTuple):
    """Standard deviation over range: sqrt(constant_m ** 2 + (growth * z ** 2) ** 2 + (near_m2 / z) ** 2), metres.

    The second term is the depth error of stereo: growth = s / (f * b), with the matching error s in pixels, the focal
    length f in pixels and the baseline b in metres (thesis 5.2). The third term decreases with range: near people fill
    the image and are truncated by its border.
    """

    constant_m: float
    growth: float
    near_m2: float

    def at(self, z_m: Any) -> np.ndarray:
        """Standard deviation at range z_m, metres, with the shape of z_m."""
        return np.sqrt(self.variance_at(np.asarray(z_m, float)))

    def variance_at(self, z_m: Any) -> Any:
        """Variance at range z_m (float or array), square metres."""
        return self.constant_m ** 2 + (self.growth * z_m ** 2) ** 2 + (self.near_m2 / z_m) ** 2


class MeasuredRange(NamedTuple):
    """Range of the measurements: z_min_m <= z <= z_max_m, |x| <= x_max_m, and z >= x_z_min_m off the optical axis."""

    z_min_m: float
    z_max_m: float
    x_max_m: float
    x_z_min_m: float


class Provenance(NamedTuple):
    """Origin of a model: files or publication, the estimator it applies to, the camera, the date (ISO), and the number
    of measurements and of distinct positions."""

    source: str
    estimator: str
    camera: str
    date: str
    measurements: int
    positions: int


class Scores(NamedTuple):
    """Leave-one-position-out cross-validation: root mean square errors after correction, metres, and the share of
    measurements inside the 68 % and the 95 % covariance ellipse in the horizontal plane."""

    rmse_x_m: float
    rmse_z_m: float
    rmse_plane_m: float
    coverage_68: float
    coverage_95: float


class ErrorModel(NamedTuple):
    """Bias and spread of measured positions.

    `z_bias` holds the coefficients of a polynomial in z, highest power first; `y_sigma_m` is an assumption, as the
    ground truth does not include y; `growth_outside` is the standard deviation added to each axis per metre outside
    `measured_range`, m/m; `cross_validated` is None if not measured. `detector` is for the tracker.

    >>> model = ErrorModel((0.02, 0.01), XBias(0.05, 0.0, 0.0), Spread(0.01, 0.002, 0.0), Spread(0.02, 0.0, 0.0), 0.1,
    ...                    MeasuredRange(1.0, 6.0, 2.0, 1.0), 0.1, Provenance('', '', '', '', 0, 0), None)
    >>> model.biased([1.0, 0.0, 4.0]).round(3).tolist()  # z: 0.02 * 4 + 0.01 too far
    [1.05, 0.0, 4.09]
    >>> model.corrected([1.05, 0.0, 4.09]).round(3).tolist()
    [1.0, 0.0, 4.0]
    >>> np.sqrt(model.variances_m2(1.0, 0.0, 4.0)).round(4).tolist()
    [0.02, 0.1, 0.0335]
    """

    z_bias: Tuple[float, ...]
    x_bias: XBias
    z_sigma: Spread
    x_sigma: Spread
    y_sigma_m: float
    measured_range: MeasuredRange
    growth_outside: float
    provenance: Provenance
    cross_validated: Optional[Scores]
    detector: DetectorModel = DetectorModel()

    def corrected(self, position_m: Any) -> np.ndarray:
        """Remove the bias from measured positions (..., 3). Inverse of `biased`.

        Outside the measured range, the bias is that at the limit of the range. y is scaled with z, along the ray.
        Raises ValueError if a position is not in front of the camera.
        """
        return _each(self.corrected_point, position_m)

    def corrected_point(self, measured_x_m: float, measured_y_m: float, measured_z_m: float) -> Point:
        """As `corrected`, of one position."""
        if not measured_z_m > 0:
            raise ValueError('z is %g m; a position in front of the camera expected' % measured_z_m)
        z_m = measured_z_m
        for _step in range(SOLVER_STEPS):
            last_m, z_m = z_m, measured_z_m - self._z_bias_at(z_m)
            if z_m == last_m:
                break
        z_m = max(z_m, NEAREST_SHARE * measured_z_m)

        x_m, scale = measured_x_m - self.x_bias.offset_m, 1 + self._x_slope_at(z_m)
        limit_m = self.measured_range.x_max_m
        if scale and abs(x_m) <= limit_m * abs(scale):
            x_m /= scale
        else:
            x_m -= (scale - 1) * math.copysign(limit_m, x_m)
        return x_m, measured_y_m * z_m / measured_z_m, z_m

    def biased(self, position_m: Any) -> np.ndarray:
        """Noise-free measurements of true positions, (..., 3). Inverse of `corrected`."""
        return _each(self._biased_point, position_m)

    def _biased_point(self, x_m: float, y_m: float, z_m: float) -> Point:
        measured_z_m, limit_m = z_m + self._z_bias_at(z_m), self.measured_range.x_max_m
        inside_m = min(max(x_m, -limit_m), limit_m)
        return (x_m + inside_m * self._x_slope_at(z_m) + self.x_bias.offset_m, y_m * measured_z_m / z_m, measured_z_m)

    def check_estimator(self, name: str) -> None:
        """Raise ValueError if the model was fitted for another estimator. That of recorded positions is not known."""
        if self.provenance.estimator not in (name, '', RECORDED):
            raise ValueError('the error model is for the estimator %s, not %s' % (self.provenance.estimator, name))

    def covariance(self, position_m: Any) -> np.ndarray:
        """Covariance (..., 3, 3) of corrected positions (..., 3) in the camera optical frame, square metres.

        The covariance is diagonal: the measurements show no correlation of x and z errors along the ray.
        """
        return _each(self.variances_m2, position_m)[..., np.newaxis] * np.eye(3)

    def variances_m2(self, x_m: float, _y_m: float, z_m: float) -> Point:
        """Variances of x, y and z of a corrected position: by its range, and by its distance to the measured range."""
        outside_m2 = (self.growth_outside * self.distance_outside(x_m, z_m)) ** 2
        return (self.x_sigma.variance_at(z_m) + outside_m2, self.y_sigma_m ** 2 + outside_m2,
                self.z_sigma.variance_at(z_m) + outside_m2)

    def distance_outside(self, x_m: float, z_m: float) -> float:
        """Distance of a corrected position to the measured range, metres; 0 inside."""
        limits = self.measured_range
        return max(0.0, limits.z_min_m - z_m, z_m - limits.z_max_m) + max(0.0, abs(x_m) - limits.x_max_m)

    def _z_bias_at(self, z_m: float) -> float:
        inside_m = min(max(z_m, self.measured_range.z_min_m), self.measured_range.z_max_m)
        bias_m = 0.0
        for coefficient in self.z_bias:
            bias_m = bias_m * inside_m + coefficient
        return bias_m

    def _x_slope_at(self, z_m: float) -> float:
        inside_m = min(max(z_m, self.measured_range.x_z_min_m), self.measured_range.z_max_m)
        return self.x_bias.slope + self.x_bias.per_angle_m / inside_m


def _each(function: Callable[..., Point], position_m: Any) -> np.ndarray:
    """Results (..., 3) of a function of x, y and z at positions (..., 3)."""
    position_m = np.asarray(position_m, float)
    return np.reshape([function(*point_m) for point_m in position_m.reshape(-1, 3).tolist()], position_m.shape)


def corrected_boxes(boxes: Sequence[Box3D], model: Optional[ErrorModel] = None, gap_s: float = 0.0) -> List[Box3D]:
    """Correct the bias of 3D boxes (`box3d.Box3D`) and set their covariance.

    Boxes with little support or at the image border are less certain than those to which an error model is fitted.
    Without a model, positions are not corrected, and their standard deviation is `UNCALIBRATED_SIGMA_M`. `gap_s` is the
    time between the colour and the depth image, in which people move.
    """
    corrected = []
    for box in boxes:
        center_m, variances_m2 = box.center_m.tolist(), 3 * (UNCALIBRATED_SIGMA_M ** 2,)
        if model is not None:
            if center_m[2] > 0:  # the axis of a very near person may be behind the image plane of a tilted camera
                center_m = model.corrected_point(*center_m)
            variances_m2 = model.variances_m2(*center_m)
        covariance_m2, truncated, unsupported = np.zeros((3, 3)), box.truncated, max(0.0, WELL_SUPPORTED - box.support)
        for axis, variance_m2 in enumerate(variances_m2):
            covariance_m2[axis, axis] = (variance_m2 + (unsupported * SUPPORT_SIGMAS_M[axis]) ** 2
                                         + truncated * TRUNCATED_SIGMAS_M[axis] ** 2 + (gap_s * WALKING_MPS[axis]) ** 2)
        corrected.append(box._replace(center_m=np.array(center_m), covariance_m2=covariance_m2))
    return corrected


def checked(model: ErrorModel) -> ErrorModel:
    """Return the model after validation. Raises ValueError, with the bad value, if the model is unusable."""
    limits = model.measured_range
    if not (0 < limits.z_min_m < limits.z_max_m and limits.z_min_m <= limits.x_z_min_m <= limits.z_max_m
            and limits.x_max_m > 0):
        raise ValueError('measured_range is %s; 0 < z_min_m <= x_z_min_m <= z_max_m and x_max_m > 0 expected'
                         % (tuple(limits),))
    z_m = np.linspace(limits.z_min_m, limits.z_max_m, 101)
    for name, slopes in (('z_bias', np.polyval(np.polyder(model.z_bias), z_m)),
                         ('x_bias', list(map(model._x_slope_at, z_m.tolist())))):
        steepest = np.abs(slopes).max()
        if steepest > STEEPEST_BIAS:
            raise ValueError('%s changes by %.2g m a metre; at most %g expected, because the bias must be invertible'
                             % (name, steepest, STEEPEST_BIAS))
    nearest_bias_m = model._z_bias_at(limits.z_min_m)
    if not abs(nearest_bias_m) < limits.z_min_m:
        raise ValueError('z_bias is %g m at %g m; less than the range expected' % (nearest_bias_m, limits.z_min_m))
    for name, spread in (('z_sigma', model.z_sigma), ('x_sigma', model.x_sigma)):
        if min(spread) < 0 or not spread.at(limits.z_min_m) > 0:
            raise ValueError('%s is %s; constant_m, growth and near_m2 of 0 or more, and not all 0, expected'
                             % (name, tuple(spread)))
    if not model.y_sigma_m > 0:
        raise ValueError('y_sigma_m is %g; more than 0 expected' % model.y_sigma_m)
    if model.growth_outside < 0:
        raise ValueError('growth_outside is %g; 0 or more expected' % model.growth_outside)
    detector_model.checked(model.detector)
    return model


def read_error_model(path: str) -> ErrorModel:
    """Read an ErrorModel from a YAML file; no code in the file is executed.

    Raises OSError if the file cannot be read, and ValueError if it is not YAML, or a key is unknown (the message names
    the nearest one), missing, or has an invalid value.
    """
    with open(str(path), encoding='utf-8') as stream:
        try:
            return checked(record_from(ErrorModel, load_yaml(stream)))
        except (ValueError, OverflowError, yaml.YAMLError) as error:
            raise ValueError('%s: not an error model: %s' % (path, error))


def error_model_of_param(path: str) -> Optional[ErrorModel]:
    """The ErrorModel of the parameter ~error_model of a node; None if it is empty. Raises ValueError."""
    try:
        return read_error_model(path) if path else None
    except OSError as error:
        raise ValueError('the error model cannot be read: %s; an absolute path expected' % error)


def write_error_model(path: str, model: ErrorModel) -> None:
    """Write an error model in the format of `read_error_model`. Raises OSError."""
    with open(str(path), 'w', encoding='utf-8') as stream:
        stream.write('# Error model of measured positions; the keys are explained in config/error_models/README.md.\n')
        stream.write(record_text(model))
