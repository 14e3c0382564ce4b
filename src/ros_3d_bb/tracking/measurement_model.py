"""Measurement model: convert the detections of one image to positions, covariances, viewing rays and sizes."""
from typing import NamedTuple

import numpy as np

from ros_3d_bb.core.params import Param, parameters
from ros_3d_bb.tracking.types import NEARER_M, wrapped

# Position (x, y), its covariance and whether that is assumed, the distance from the camera and the unit vector from the
# camera in the ground plane; extents; height of the centre and its variance; whether the image border truncates the
# width, and the lower and the upper end; support; number of the class (`class_numbers.ClassNumbers`), score, and
# `Detection.index`.
MEASUREMENT = np.dtype([('position_m', float, 2), ('noise_m2', float, (2, 2)), ('noise_assumed', bool),
                        ('distance_m', float), ('ray', float, 2), ('size_m', float, 3), ('z_m', float), ('z_m2', float),
                        ('cut_sideways', bool), ('cut_ends', bool, 2), ('support', float), ('class_number', int),
                        ('score', float), ('detection', int)])
FLOOR_M = 0.02  # lower bound of the standard deviation of a centre: people sway as they walk
WIDER_M = 0.04  # people are wider than the usual width, to which the estimator completes truncated boxes
USUAL_PERIOD_S = 1 / 30.0  # image period assumed for the first image of a camera
FILTER_MEMORY_S = 0.3273  # of the position, with the default parameters
PART_M = 0.3  # a truncated box narrower than this shows only a part of the body's width
MAX_SHIFT_M = 0.2
CUT_SIGMA_M = 0.08  # additional lateral standard deviation of truncated or partly occluded boxes
NEAR_M = 0.01  # the viewing ray of a closer box is undefined; the optical axis is used instead
TOUCHING_RAD = 0.03  # a nearer box occludes another one if the gap between them is smaller than this
BOX_ERRORS = 'kalman: errors of boxes (their covariance comes from the error model of bbox3d_node)'


@parameters(BOX_ERRORS)
class NoiseParams(NamedTuple):
    """Parameters of the position errors of boxes."""

    noise_unknown: float = Param(
        0.1, 'Standard deviation of boxes without a covariance, lasting errors included.', 'm', live=(0, 1))


def measurements_of(detections, view, elapsed_s, params, classes, detector):
    """Convert the detections of one image to an array of MEASUREMENT; `elapsed_s` is the time since the previous image
    of the same camera, 0 for the first; `params` are NoiseParams, `classes` ClassNumbers, `detector` a DetectorModel.

    If a nearer object partly occludes a detection, or the image border leaves only a part of its width, the centre is
    shifted to half the usual width of the class from the visible edge. The lateral position of such a box is less
    certain.
    """
    measurements = np.zeros(len(detections), MEASUREMENT)
    if not len(detections):
        return measurements
    (positions_m, sizes_m, covariances_m2, truncated_edges, measurements['support'], labels, measurements['score'],
     measurements['detection']) = zip(*detections)
    measurements['class_number'] = numbers = [classes.of(label) for label in labels]
    positions_m, sizes_m, truncated_edges = np.array(positions_m), np.array(sizes_m), np.array(truncated_edges, bool)
    unknown_m2 = np.eye(3) * params.noise_unknown ** 2
    measurements['noise_assumed'] = [known is None for known in covariances_m2]
    covariances_m2 = np.array([unknown_m2 if known is None else known for known in covariances_m2])

    distances_m, bearings = view.bearings(positions_m)
    is_near = distances_m < NEAR_M
    distances_m = np.maximum(distances_m, NEAR_M)
    rays = (positions_m[:, :2] - view.fixed_from_camera[:2, 3]) / distances_m[:, None]
    rays[is_near] = view.ahead
    left_of_rays = np.stack((-rays[:, 1], rays[:, 0]), axis=1)

    hidden = _hidden_side(distances_m, bearings, np.arctan2(sizes_m[:, 0] / 2, distances_m))
    cut_left, top, cut_right, bottom = truncated_edges.T
    cut_sideways = cut_left | cut_right
    cut_side = (cut_left.astype(int) - cut_right) * (sizes_m[:, 0] < PART_M)
    missing_m = classes.width_m[numbers] + WIDER_M - sizes_m[:, 0]
    shift_m = np.where(cut_sideways, cut_side, hidden) * np.clip(missing_m / 2, 0, MAX_SHIFT_M)

    measurements['position_m'] = positions_m[:, :2] + shift_m[:, None] * left_of_rays
    lateral_m2 = (cut_sideways | (hidden != 0)) * CUT_SIGMA_M ** 2
    for axes, extra_m2 in ((rays, 0), (left_of_rays, lateral_m2)):
        measurements['noise_m2'] += _noise_along(axes, covariances_m2[:, :2, :2], extra_m2, elapsed_s, detector)
    measurements['distance_m'], measurements['ray'], measurements['size_m'] = distances_m, rays, sizes_m
    measurements['z_m'], measurements['z_m2'] = positions_m[:, 2], covariances_m2[:, 2, 2]
    measurements['cut_sideways'], measurements['cut_ends'] = cut_sideways, np.stack((bottom, top), axis=1)
    return measurements


def _hidden_side(distances_m, bearings, half_widths):
    """Side on which a nearer detection partly occludes each detection: 1 left, -1 right, 0 neither or both; (n,)."""
    depths_m = distances_m * np.cos(bearings)
    to_left = wrapped(bearings[None, :] - bearings[:, None])
    gaps = np.abs(to_left) - half_widths[None, :] - half_widths[:, None]
    hides = (depths_m[None, :] < depths_m[:, None] - NEARER_M) & (gaps < TOUCHING_RAD)
    left, right = (hides & (to_left > 0)).any(axis=1), (hides & (to_left <= 0)).any(axis=1)
    return left.astype(int) - right


def _noise_along(axes, covariances_m2, extra_m2, elapsed_s, detector):
    """Covariances (n, 2, 2) along unit vectors (n, 2), from the single-image covariances.

    Position errors are correlated from image to image. A filter that treats them as independent underestimates its
    covariance. The lasting part is therefore multiplied by the number of images over which it is correlated, which
    makes the filter independent of the frame rate. Errors that last much longer than the memory of the filter shift the
    track and hardly change its velocity: with the correlation time T, white noise of the density 2 T / (1 + w² T²) has
    the same power at the frequency w = 1 / `FILTER_MEMORY_S`.
    """
    correlated_s = detector.correlation_time_s / (1 + (detector.correlation_time_s / FILTER_MEMORY_S) ** 2)
    images = max(1.0, 2 * correlated_s / (elapsed_s or USUAL_PERIOD_S))
    variance = ((covariances_m2 @ axes[..., None])[..., 0] * axes).sum(axis=1)
    variance += (images - 1) * np.minimum(variance, detector.lasting_sigma_m ** 2) + FLOOR_M ** 2 + extra_m2
    return variance[:, None, None] * axes[:, :, None] * axes[:, None, :]
