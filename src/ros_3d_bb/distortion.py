"""Lens distortion, in both directions, for the models that sensor_msgs/CameraInfo names.

Convention: rays and their images are (..., 2), without unit. A ray is x/z and y/z of a point in the optical frame; its
image is (u - cx)/fx and (v - cy)/fy of the pixel that shows it. `distort_` takes rays to images, `undistort_` back.

A polynomial grows up to some distance from the axis and then folds back; no lens does that, so what lies beyond was
never calibrated. Rays there have no image, and images that only such rays would have, have no ray: both are nan.
"""
import functools
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import Polynomial

PLUMB_BOB, RATIONAL_POLYNOMIAL, EQUIDISTANT = 'plumb_bob', 'rational_polynomial', 'equidistant'  # of sensor_msgs
INVERSE_BROWN_CONRADY = 'inverse_brown_conrady'  # of librealsense
LARGEST = 1e6  # coefficient of any lens, and more; larger ones overflow
WIDEST = np.tan(np.radians(89))  # no flat image reaches farther from the axis
NEWTON_STEPS = 20  # two or three do, but where a polynomial is about to fold
TABLED = 500  # distances from the axis
EXACT = 1e-11  # where Newton stops: 1e-8 pixels
FOUND = 1e-10  # worse than this is no solution: 1e-7 pixels
DIFFERENCE = 1e-7  # for derivatives


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
    return MODELS[model].distort(np.asarray(rays, float), coefficients)


def undistort(model, coefficients, images):
    """Rays of images, nan where there is none. Inverse of `distort`."""
    return MODELS[model].undistort(np.asarray(images, float), coefficients)


def distort_brown(rays, coefficients):
    """Images of rays with plumb_bob (k1, k2, p1, p2, k3) or rational_polynomial (k1, k2, p1, p2, k3, k4, k5, k6).

    Source: OpenCV, calib3d, "Camera Calibration and 3D Reconstruction"; REP 104.
    """
    return _brown(_within(rays, _growth(*_radial(coefficients))), coefficients)


def undistort_brown(images, coefficients):
    """Rays of images. Inverse of `distort_brown`."""
    return _solve(lambda rays: _brown(rays, coefficients), images, _growth(*_radial(coefficients)))


def distort_inverse_brown_conrady(rays, coefficients):
    """Images of rays with what librealsense calls inverse Brown-Conrady, (k1, k2, p1, p2, k3).

    As plumb_bob, but for the tangential part, which is that of the radially distorted ray. In spite of its name it
    takes rays to images: librealsense aligns depth to colour with it, so that its inverse finds the measured points.
    Source: librealsense, include/librealsense2/rsutil.h (2.43 and later), rs2_project_point_to_pixel.
    """
    return _modified_brown(_within(rays, _growth(*_radial(coefficients))), coefficients)


def undistort_inverse_brown_conrady(images, coefficients):
    """Rays of images. Inverse of `distort_inverse_brown_conrady`."""
    return _solve(lambda rays: _modified_brown(rays, coefficients), images, _growth(*_radial(coefficients)))


def distort_equidistant(rays, coefficients):
    """Images of rays with the fisheye model of Kannala and Brandt, (k1, k2, k3, k4): by the angle to the axis.

    Source: OpenCV, calib3d, "Fisheye camera model"; sensor_msgs/distortion_models.h.
    """
    tangent = _radius(rays)
    angles = rays * _ratio(np.arctan(tangent), tangent)
    return _fisheye(_within(angles, _growth(coefficients, (), np.arctan(WIDEST))), coefficients)


def undistort_equidistant(images, coefficients):
    """Rays of images. Inverse of `distort_equidistant`."""
    growth = _growth(coefficients, (), np.arctan(WIDEST))
    angles = _solve(lambda angles: _fisheye(angles, coefficients), images, growth)
    angle = _radius(angles)
    return angles * _ratio(np.tan(angle), angle)


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
    INVERSE_BROWN_CONRADY: Model(5, 5, 'k1, k2, p1, p2, k3', distort_inverse_brown_conrady,
                                 undistort_inverse_brown_conrady),
    EQUIDISTANT: Model(4, 4, 'k1, k2, k3, k4', distort_equidistant, undistort_equidistant)}


def _brown(rays, coefficients):
    r2, bent = _bent(rays, coefficients)
    return bent + _tangential(rays, r2, coefficients)


def _modified_brown(rays, coefficients):
    r2, bent = _bent(rays, coefficients)
    return bent + _tangential(bent, r2, coefficients)


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


def _fisheye(angles, coefficients):
    k1, k2, k3, k4 = coefficients
    a2 = (angles[..., 0] ** 2 + angles[..., 1] ** 2)[..., np.newaxis]
    return angles * (1 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4))))


def _radial(coefficients):
    """(k1, k2, k3) of the numerator and (k4, k5, k6) of the denominator."""
    k1, k2, _p1, _p2, k3 = coefficients[:5]
    return (k1, k2, k3), tuple(coefficients[5:]) or (0.0, 0.0, 0.0)


class Growth(NamedTuple):
    """How images move away from the axis, tabled: `images` (n,) grow with `distances` (n,), up to the last of them."""

    distances: np.ndarray
    images: np.ndarray


@functools.lru_cache(maxsize=64)
def _growth(numerator, denominator, widest=WIDEST):
    """The growth of r (1 + n1 r^2 + ...) / (1 + d1 r^2 + ...) up to where it folds back or has a pole, or `widest`."""
    n, d, r2 = Polynomial((1,) + numerator), Polynomial((1,) + denominator), Polynomial((0, 1))
    slope = (n + 2 * r2 * n.deriv()) * d - 2 * r2 * n * d.deriv()
    roots = np.concatenate([polynomial.trim(1e-12).roots() for polynomial in (slope, d)])
    real = roots.real[(np.abs(roots.imag) < 1e-9 * np.abs(roots)) & (roots.real > 0)]
    limit = min([widest] + (np.sqrt(real) * (1 - 1e-6)).tolist())  # short of the pole
    distances = np.tan(np.linspace(0, np.arctan(limit), TABLED))
    return Growth(distances, distances * n(distances ** 2) / d(distances ** 2))


def _solve(function, images, growth):
    """Points (..., 2), as far from 0 as `growth` goes, that the function takes to the images; nan where there is none.

    Newton's method with derivatives by differences, from where the radial part has its solution: a few steps, all
    points at once.
    """
    distance = _radius(images)
    points = images * _ratio(np.interp(distance, growth.images, growth.distances, right=np.nan), distance)
    with np.errstate(all='ignore'):  # where there is no solution the steps may go anywhere
        for _step in range(NEWTON_STEPS):
            values = function(points)
            error = images - values
            if not np.any(np.abs(error) > EXACT):
                break
            points = points + _newton_step(function, points, values, error)
        found = np.abs(images - function(points)).max(axis=-1) <= FOUND
        return _within(np.where(found[..., np.newaxis], points, np.nan), growth)


def _newton_step(function, points, values, error):
    """By how much to move the points, so that the values of a linear function would grow by `error`."""
    along_x = (function(points + (DIFFERENCE, 0)) - values) / DIFFERENCE
    along_y = (function(points + (0, DIFFERENCE)) - values) / DIFFERENCE
    step = np.stack((_cross(error, along_y), _cross(along_x, error)), axis=-1)
    return step / _cross(along_x, along_y)[..., np.newaxis]


def _cross(a, b):
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _radius(points):
    """Distance from the axis, (..., 1)."""
    return np.hypot(points[..., :1], points[..., 1:])


def _within(points, growth):
    """The points no farther from the axis than images grow, nan for the others."""
    return np.where(_radius(points) <= growth.distances[-1], points, np.nan)


def _ratio(numerator, denominator):
    """numerator / denominator, 1 where the denominator is 0."""
    return np.where(denominator > 0, numerator / np.maximum(denominator, np.finfo(float).tiny), 1)
