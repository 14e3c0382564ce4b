"""Lens distortion and its inverse, for the models of sensor_msgs/CameraInfo.

Convention: rays and their images are (..., 2) and dimensionless. A ray is (x/z, y/z) of a point in the optical frame;
its image is ((u - cx)/fx, (v - cy)/fy) of the pixel onto which it is projected.

A distortion polynomial increases up to some distance from the axis and then folds back. Real lenses do not, so the
model is not calibrated beyond that distance: rays there have no image, and images that only such rays would have, have
no ray. Both are nan. OpenCV inverts the models. Its fixed-point iteration diverges for images whose distance from the
axis grows more than twice as fast as in proportion to that of their rays; they have no ray either. Inside the image,
no real lens stretches that much. OpenCV is imported only where it is used: it takes 100 MB, which nodes save whose
camera has no distortion.
"""
import functools
from typing import Any, Sequence, Tuple

import numpy as np
from numpy.polynomial import Polynomial

PLUMB_BOB, RATIONAL_POLYNOMIAL, EQUIDISTANT = 'plumb_bob', 'rational_polynomial', 'equidistant'  # of sensor_msgs
INVERSE_BROWN_CONRADY = 'inverse_brown_conrady'  # of librealsense
LARGEST = 1e6  # upper bound of a coefficient, beyond that of any lens; larger ones overflow
WIDEST = np.tan(np.radians(89))  # upper bound of the distance from the axis in a planar image
STEPS = 10  # maximum number of corrections of OpenCV's solution
STEPS_BEFORE_3_3_1 = 100  # the same for OpenCV before 3.3.1, which iterates only five times
EXACT = 1e-10  # error at which the corrections stop: 1e-7 pixels
FOUND = 1e-9  # largest error of a solution: 1e-6 pixels
ON_AXIS = 1e-8  # `cv2.fisheye` treats smaller values as 0
UNIT = np.eye(3)  # camera matrix of dimensionless images

# Model: minimum and maximum number of coefficients, and their order.
MODELS = {PLUMB_BOB: (4, 5, 'k1, k2, p1, p2, k3'), RATIONAL_POLYNOMIAL: (8, 8, 'k1, k2, p1, p2, k3, k4, k5, k6'),
          INVERSE_BROWN_CONRADY: (5, 5, 'k1, k2, p1, p2, k3'), EQUIDISTANT: (4, 4, 'k1, k2, k3, k4')}


def checked_distortion(model: str, coefficients: Sequence[float]) -> Tuple[str, Tuple[float, ...]]:
    """Validate a distortion for `camera_model.Camera`. Returns the model and all of its coefficients.

    Coefficients that are all zero mean no distortion, '' and (), except for the equidistant model, which is a fisheye
    even then. Zeros beyond the coefficients of the model, which some drivers append, are removed. Raises ValueError if
    the model is not one of `MODELS`, or its coefficients are too few, too many, or not below `LARGEST`.
    """
    coefficients = tuple(float(coefficient) for coefficient in coefficients)
    if not any(coefficients) and not (model == EQUIDISTANT and coefficients):
        return '', ()
    if model not in MODELS:
        raise ValueError('distortion model is %r; one of %s expected' % (model, ', '.join(sorted(MODELS))))
    fewest, most, order = MODELS[model]
    if len(coefficients) < fewest or any(coefficients[most:]):
        raise ValueError('distortion %s has %d coefficients %s; %d expected (%s)'
                         % (model, len(coefficients), coefficients, most, order))
    if not all(abs(coefficient) < LARGEST for coefficient in coefficients):
        raise ValueError('distortion %s has coefficients %s; finite and below %g expected'
                         % (model, coefficients, LARGEST))
    return model, (coefficients + (0.0,) * most)[:most]


def distort(model: str, coefficients: Tuple[float, ...], rays: Any) -> np.ndarray:
    """Distort rays (..., 2) to images (..., 2), nan for rays without an image. Inverse of `undistort`.

    The equidistant model is the fisheye of Kannala-Brandt, a polynomial in the angle to the axis. The others are
    computed in closed form, because `cv2.projectPoints` also computes 24 derivatives of each point.
    Sources: OpenCV, calib3d, "Camera Calibration and 3D Reconstruction" and "Fisheye camera model"; REP 104;
    sensor_msgs/distortion_models.h.
    """
    rays = np.asarray(rays, float)
    if not rays.size:
        return rays  # OpenCV rejects empty arrays
    radius = np.hypot(rays[..., 0], rays[..., 1])
    with np.errstate(all='ignore'):  # rays without an image may overflow
        if model == EQUIDISTANT:
            import cv2
            images = cv2.fisheye.distortPoints(rays.reshape(-1, 1, 2), UNIT, np.array(coefficients))
            images = images.reshape(rays.shape)
        else:
            images = _distort_brown(rays, coefficients, model == INVERSE_BROWN_CONRADY)
    return np.where((radius <= _widest(model, coefficients))[..., np.newaxis], images, np.nan)


def undistort(model: str, coefficients: Tuple[float, ...], images: Any) -> np.ndarray:
    """Undistort images (..., 2) to rays (..., 2), nan for images without a ray. Inverse of `distort`.

    OpenCV's solution is corrected until `distort` maps it to the images. One step suffices if OpenCV is exact; more are
    needed if its lens model differs slightly, and before OpenCV 3.3.1, which stops after five iterations.
    """
    targets = images = np.asarray(images, float)
    if not images.size:
        return images  # OpenCV rejects empty arrays
    import cv2
    for _step in range(STEPS if hasattr(cv2, 'undistortPointsIter') else STEPS_BEFORE_3_3_1):
        rays = _solved_by_opencv(model, np.array(coefficients), targets.reshape(-1, 1, 2)).reshape(images.shape)
        errors = images - distort(model, coefficients, rays)
        with np.errstate(invalid='ignore'):  # nan
            if not np.any(np.abs(errors) > EXACT):
                break
        targets = targets + errors
    with np.errstate(invalid='ignore'):
        return np.where(np.abs(errors).max(axis=-1, keepdims=True) <= FOUND, rays, np.nan)


def _distort_brown(rays: np.ndarray, coefficients: Tuple[float, ...], is_inverse: bool) -> np.ndarray:
    """Distort rays by the radial and tangential polynomials of plumb_bob or rational_polynomial.

    The inverse Brown-Conrady model of librealsense equals plumb_bob, except that the tangential part is computed from
    the radially distorted ray. In spite of its name it maps rays to images: librealsense uses it to align depth to
    colour, and its inverse therefore returns the measured points.
    Source: librealsense, include/librealsense2/rsutil.h (2.43 and later), rs2_project_point_to_pixel.
    """
    (n1, n2, n3), (d1, d2, d3) = _radial(coefficients)
    p1, p2 = coefficients[2:4]
    r2 = rays[..., 0] ** 2 + rays[..., 1] ** 2
    factor = (1 + r2 * (n1 + r2 * (n2 + r2 * n3))) / (1 + r2 * (d1 + r2 * (d2 + r2 * d3)))
    bent = rays * factor[..., np.newaxis]
    x, y = np.moveaxis(bent if is_inverse else rays, -1, 0)
    return bent + np.stack((2 * p1 * x * y + p2 * (r2 + 2 * x * x), 2 * p2 * x * y + p1 * (r2 + 2 * y * y)), axis=-1)


def _solved_by_opencv(model: str, coefficients: np.ndarray, images: np.ndarray) -> np.ndarray:
    import cv2
    if model == EQUIDISTANT:
        # OpenCV returns 0 next to the axis, and wrong rays for images farther than pi/2, which `undistort` rejects.
        next_to_axis = np.abs(images).max(axis=-1, keepdims=True) <= ON_AXIS
        return np.where(next_to_axis, images, cv2.fisheye.undistortPoints(images, UNIT, coefficients))
    if not hasattr(cv2, 'undistortPointsIter'):  # OpenCV before 3.3.1, as in Ubuntu 18.04
        return cv2.undistortPoints(images, UNIT, coefficients)
    until = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 200, 1e-11)
    return cv2.undistortPointsIter(images, UNIT, coefficients, None, None, until)


def _radial(coefficients: Tuple[float, ...]) -> Tuple[Tuple[float, ...], Tuple[float, ...]]:
    """Radial coefficients: (k1, k2, k3) of the numerator and (k4, k5, k6) of the denominator."""
    k1, k2, _p1, _p2, k3 = coefficients[:5]
    return (k1, k2, k3), tuple(coefficients[5:]) or (0.0, 0.0, 0.0)


@functools.lru_cache(maxsize=64)
def _widest(model: str, coefficients: Tuple[float, ...]) -> float:
    """Distance of rays from the axis up to which the distortion increases monotonically, at most `WIDEST`."""
    if model == EQUIDISTANT:
        return np.tan(_turning_point(coefficients, (), np.arctan(WIDEST)))
    return _turning_point(*_radial(coefficients), WIDEST)


def _turning_point(numerator: Tuple[float, ...], denominator: Tuple[float, ...], limit: float) -> float:
    """Smallest r > 0 at which r (1 + n1 r^2 + ...) / (1 + d1 r^2 + ...) has a maximum or a pole, at most `limit`."""
    n, d, r2 = Polynomial((1,) + numerator), Polynomial((1,) + denominator), Polynomial((0, 1))
    slope = (n + 2 * r2 * n.deriv()) * d - 2 * r2 * n * d.deriv()
    roots = np.concatenate([polynomial.trim(1e-12).roots() for polynomial in (slope, d)])
    real = roots.real[(np.abs(roots.imag) < 1e-9 * np.abs(roots)) & (roots.real > 0)]
    return min([limit] + (np.sqrt(real) * (1 - 1e-6)).tolist())  # short of the pole
