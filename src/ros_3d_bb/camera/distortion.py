"""Lens distortion, in both directions, for the models that sensor_msgs/CameraInfo names.

Convention: rays and their images are (..., 2), without unit. A ray is x/z and y/z of a point in the optical frame; its
image is (u - cx)/fx and (v - cy)/fy of the pixel that shows it. `distort_` takes rays to images, `undistort_` back.

A polynomial grows up to some distance from the axis and then folds back; no lens does that, so what lies beyond was
never calibrated. Rays there have no image, and images that only such rays would have, have no ray: both are nan.
OpenCV inverts the models. Its fixed-point iteration diverges for images that move away from the axis more than twice as
fast as in proportion to their rays; they have no ray either. Within the image, no real lens stretches that much.
"""
import functools
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.polynomial import Polynomial

PLUMB_BOB, RATIONAL_POLYNOMIAL, EQUIDISTANT = 'plumb_bob', 'rational_polynomial', 'equidistant'  # of sensor_msgs
INVERSE_BROWN_CONRADY = 'inverse_brown_conrady'  # of librealsense
LARGEST = 1e6  # coefficient of any lens, and more; larger ones overflow
WIDEST = np.tan(np.radians(89))  # no flat image reaches farther from the axis
UNTIL = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 200, 1e-11)  # iterations of OpenCV
STEPS = 10  # corrections of what OpenCV returns
STEPS_BEFORE_3_3_1 = 100  # when it iterated five times only
EXACT = 1e-10  # where they stop: 1e-7 pixels
FOUND = 1e-9  # worse than this is no solution: 1e-6 pixels
ON_AXIS = 1e-8  # `cv2.fisheye` takes less for 0
UNIT = np.eye(3)  # camera matrix of images without unit


def checked_distortion(model, coefficients):
    """A distortion as `geometry.Camera` keeps it: ('', ()) for none, else the model with all of its coefficients.

    All zero is none whatever the model, but for the equidistant one, which is a fisheye even then. Some drivers fill
    the list up with zeros: those are cut off.

    Raises
    ------
    ValueError
        If the model is not one of `MODELS`, or its coefficients are too few, too many or not finite.
    """
    coefficients = tuple(float(coefficient) for coefficient in coefficients)
    if not any(coefficients) and not (model == EQUIDISTANT and coefficients):
        return '', ()
    if model not in MODELS:
        raise ValueError('distortion model is %r; one of %s expected' % (model, ', '.join(sorted(MODELS))))
    fewest, most, order, _distort, _undistort = MODELS[model]
    if len(coefficients) < fewest or any(coefficients[most:]):
        raise ValueError('distortion %s has %d coefficients %s; %d expected (%s)'
                         % (model, len(coefficients), coefficients, most, order))
    if not all(abs(coefficient) < LARGEST for coefficient in coefficients):
        raise ValueError('distortion %s has coefficients %s; finite and below %g expected'
                         % (model, coefficients, LARGEST))
    return model, (coefficients + (0.0,) * most)[:most]


def distort(model, coefficients, rays):
    """Images of rays, nan where there is none. Inverse of `undistort`."""
    rays = np.asarray(rays, float)
    if not rays.size:
        return rays  # OpenCV takes no empty array
    radius = np.hypot(rays[..., 0], rays[..., 1])
    with np.errstate(all='ignore'):  # rays that have no image may overflow
        images = MODELS[model].distort(rays, coefficients)
    return np.where((radius <= _widest(model, coefficients))[..., np.newaxis], images, np.nan)


def undistort(model, coefficients, images):
    """Rays of images, nan where there is none. Inverse of `distort`.

    OpenCV's solution is corrected until `distort` takes it to the images. That is one step where OpenCV is exact; its
    own model of the lens may differ a little, and before 3.3.1 it stopped after five iterations.
    """
    steps = STEPS if hasattr(cv2, 'undistortPointsIter') else STEPS_BEFORE_3_3_1
    targets = images = np.asarray(images, float)
    if not images.size:
        return images  # OpenCV takes no empty array
    for _step in range(steps):
        rays = MODELS[model].undistort(targets.reshape(-1, 1, 2), coefficients).reshape(images.shape)
        errors = images - distort(model, coefficients, rays)
        if not np.any(np.abs(errors) > EXACT):
            break
        targets = targets + errors
    return np.where(np.abs(errors).max(axis=-1, keepdims=True) <= FOUND, rays, np.nan)


def distort_brown(rays, coefficients):
    """Images of rays with plumb_bob (k1, k2, p1, p2, k3) or rational_polynomial (k1, k2, p1, p2, k3, k4, k5, k6).

    In closed form: `cv2.projectPoints` also computes 24 derivatives of each point.
    Source: OpenCV, calib3d, "Camera Calibration and 3D Reconstruction"; REP 104.
    """
    r2, bent = _bent(rays, coefficients)
    return bent + _tangential(rays, r2, coefficients)


def undistort_brown(images, coefficients):
    """Rays (n, 1, 2) of images (n, 1, 2). Inverse of `distort_brown`."""
    if not hasattr(cv2, 'undistortPointsIter'):  # OpenCV before 3.3.1, as in Ubuntu 18.04
        return cv2.undistortPoints(images, UNIT, np.array(coefficients))
    return cv2.undistortPointsIter(images, UNIT, np.array(coefficients), None, None, UNTIL)


def distort_inverse_brown_conrady(rays, coefficients):
    """Images of rays with what librealsense calls inverse Brown-Conrady, (k1, k2, p1, p2, k3).

    As plumb_bob, but for the tangential part, which is that of the radially distorted ray. In spite of its name it
    takes rays to images: librealsense aligns depth to colour with it, so that its inverse finds the measured points.
    Source: librealsense, include/librealsense2/rsutil.h (2.43 and later), rs2_project_point_to_pixel.
    """
    r2, bent = _bent(rays, coefficients)
    return bent + _tangential(bent, r2, coefficients)


def distort_equidistant(rays, coefficients):
    """Images of rays with the fisheye model of Kannala and Brandt, (k1, k2, k3, k4): by the angle to the axis.

    Source: OpenCV, calib3d, "Fisheye camera model"; sensor_msgs/distortion_models.h.
    """
    return cv2.fisheye.distortPoints(rays.reshape(-1, 1, 2), UNIT, np.array(coefficients)).reshape(rays.shape)


def undistort_equidistant(images, coefficients):
    """Rays (n, 1, 2) of images (n, 1, 2). Inverse of `distort_equidistant`.

    OpenCV returns 0 next to the axis, and a wrong ray for images farther from it than pi/2, which `undistort` drops.
    """
    next_to_axis = np.abs(images).max(axis=-1, keepdims=True) <= ON_AXIS
    return np.where(next_to_axis, images, cv2.fisheye.undistortPoints(images, UNIT, np.array(coefficients)))


class Model(NamedTuple):
    """A distortion model: how few and how many coefficients it has, their order, and its pair of functions."""

    fewest: int
    most: int
    order: str
    distort: Any
    undistort: Any


MODELS = {
    PLUMB_BOB: Model(4, 5, 'k1, k2, p1, p2, k3', distort_brown, undistort_brown),
    RATIONAL_POLYNOMIAL: Model(8, 8, 'k1, k2, p1, p2, k3, k4, k5, k6', distort_brown, undistort_brown),
    INVERSE_BROWN_CONRADY: Model(5, 5, 'k1, k2, p1, p2, k3', distort_inverse_brown_conrady, undistort_brown),
    EQUIDISTANT: Model(4, 4, 'k1, k2, k3, k4', distort_equidistant, undistort_equidistant)}


def _bent(rays, coefficients):
    """Squared distance of rays from the axis, and the rays with the radial distortion only."""
    (n1, n2, n3), (d1, d2, d3) = _radial(coefficients)
    r2 = rays[..., 0] ** 2 + rays[..., 1] ** 2
    factor = (1 + r2 * (n1 + r2 * (n2 + r2 * n3))) / (1 + r2 * (d1 + r2 * (d2 + r2 * d3)))
    return r2, rays * factor[..., np.newaxis]


def _tangential(rays, r2, coefficients):
    p1, p2 = coefficients[2:4]
    x, y = rays[..., 0], rays[..., 1]
    return np.stack((2 * p1 * x * y + p2 * (r2 + 2 * x * x), 2 * p2 * x * y + p1 * (r2 + 2 * y * y)), axis=-1)


def _radial(coefficients):
    """(k1, k2, k3) of the numerator and (k4, k5, k6) of the denominator."""
    k1, k2, _p1, _p2, k3 = coefficients[:5]
    return (k1, k2, k3), tuple(coefficients[5:]) or (0.0, 0.0, 0.0)


@functools.lru_cache(maxsize=64)
def _widest(model, coefficients):
    """Distance of rays from the axis up to which images move away from it as well, at most `WIDEST`."""
    if model == EQUIDISTANT:
        return np.tan(_turning_point(coefficients, (), np.arctan(WIDEST)))
    return _turning_point(*_radial(coefficients), WIDEST)


def _turning_point(numerator, denominator, limit):
    """Up to where r (1 + n1 r^2 + ...) / (1 + d1 r^2 + ...) grows: it folds back there or has a pole, or `limit`."""
    n, d, r2 = Polynomial((1,) + numerator), Polynomial((1,) + denominator), Polynomial((0, 1))
    slope = (n + 2 * r2 * n.deriv()) * d - 2 * r2 * n * d.deriv()
    roots = np.concatenate([polynomial.trim(1e-12).roots() for polynomial in (slope, d)])
    real = roots.real[(np.abs(roots.imag) < 1e-9 * np.abs(roots)) & (roots.real > 0)]
    return min([limit] + (np.sqrt(real) * (1 - 1e-6)).tolist())  # short of the pole
