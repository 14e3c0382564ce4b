"""Measurement model: convert the detections of one image to positions, covariances, viewing rays and sizes."""
from typing import NamedTuple

import numpy as np

from ros_3d_bb.core.params import Param, parameters
from ros_3d_bb.tracking.kalman_filter import Measurements
from ros_3d_bb.tracking.occlusion import NEARER_M, wrapped

FLOOR_M = 0.02  # lower bound of the standard deviation of a centre: people sway as they walk
PERSON_WIDTH_M = 0.5
USUAL_PERIOD_S = 1 / 30.0  # image period assumed for the first image of a camera
PART_M = 0.3  # a truncated box narrower than this shows only a part of the body's width
MAX_SHIFT_M = 0.2
CUT_SIGMA_M = 0.08  # additional lateral standard deviation of truncated or partly occluded boxes
NEAR_M = 0.01  # the viewing ray of a closer box is undefined; the optical axis is used instead
TOUCHING_RAD = 0.03  # a nearer box occludes another one if the gap between them is smaller than this
BOX_ERRORS = 'kalman: errors of boxes (their covariance comes from the error model of bbox3d_node)'


@parameters(BOX_ERRORS)
class NoiseParams(NamedTuple):
    """Parameters of the position errors of boxes."""

    noise_unknown: float = Param(0.1, 'Standard deviation of boxes without a covariance.', 'm', live=(0, 1))
    noise_correlated: float = Param(
        0.035, 'Up to this standard deviation, errors are correlated from image to image.', 'm', live=(0, 0.3))
    noise_correlation_time: float = Param(0.15, 'How long they are correlated.', 's', live=(0, 1))


class MeasurementBatch(NamedTuple):
    """The detections of one image as arrays: positions on the ground plane, extents (n, 3), height of the centre and
    its variance, (n,), and whether the image border truncates the box at the left, top, right and bottom, (n, 4)."""

    ground: Measurements
    sizes_m: np.ndarray
    z_m: np.ndarray
    z_m2: np.ndarray
    truncated_edges: np.ndarray

    @property
    def cut_sideways(self):
        """Whether the image border truncates the width, (n,)."""
        return self.truncated_edges[:, 0] | self.truncated_edges[:, 2]

    @property
    def vertical_cuts(self):
        """Whether the image border truncates the lower and the upper end, (n, 2)."""
        return self.truncated_edges[:, [3, 1]]

    def select(self, columns):
        """The batch reduced to the measurements in `columns`."""
        ground, *others = self
        return MeasurementBatch(Measurements(*(values[columns] for values in ground)),
                                *(values[columns] for values in others))


class _ObservedDetections(NamedTuple):
    """Detections relative to the camera in the ground plane: positions and rays (n, 2); distances, bearings and angular
    half widths (n,), radians."""

    positions_m: np.ndarray
    rays: np.ndarray
    distances_m: np.ndarray
    bearings: np.ndarray
    half_widths: np.ndarray

    @property
    def sides(self):
        """Unit vectors (n, 2) perpendicular to the rays, to the left."""
        return np.stack((-self.rays[:, 1], self.rays[:, 0]), axis=1)


def measurement_batch_of(detections, view, elapsed_s, params):
    """Convert the detections of one image to measurements for the Kalman filter.

    Position errors are correlated from image to image. A filter that treats them as independent underestimates its
    covariance. The correlated part of the covariance is therefore multiplied by the number of images over which it is
    correlated, which makes the filter independent of the frame rate.

    If a nearer person partly occludes a detection, or the image border leaves only a part of its width, the centre is
    shifted to half a person's width from the visible edge. The lateral position of such a box is less certain.

    Parameters
    ----------
    detections : sequence of Detection, n
    view : CameraView
    elapsed_s : float
        Time since the previous image of the same camera; 0 for the first.
    params : NoiseParams

    Returns
    -------
    MeasurementBatch
    """
    positions_m = np.array([detection.position_m for detection in detections]).reshape(-1, 3)
    sizes_m = np.array([detection.size_m for detection in detections]).reshape(-1, 3)
    truncated_edges = np.array([detection.truncated_edges for detection in detections], bool).reshape(-1, 4)
    unknown = np.eye(3) * params.noise_unknown ** 2
    covariances = np.array([unknown if detection.covariance_m2 is None else detection.covariance_m2
                            for detection in detections]).reshape(-1, 3, 3)
    seen = _seen(positions_m[:, :2], sizes_m[:, 0], view)
    hidden = _hidden_side(seen)
    is_part = sizes_m[:, 0] < PART_M
    cut_left, cut_right = truncated_edges[:, 0], truncated_edges[:, 2]
    cut = cut_left | cut_right
    side = np.where(cut, (cut_left.astype(int) - cut_right) * is_part, hidden)
    shift_m = np.clip((PERSON_WIDTH_M - sizes_m[:, 0]) / 2, 0, MAX_SHIFT_M)
    noise_m2 = _noise(covariances[:, :2, :2], seen, cut | (hidden != 0), elapsed_s, params)
    ground = Measurements(seen.positions_m + (side * shift_m)[:, None] * seen.sides, noise_m2, seen.rays)
    return MeasurementBatch(ground, sizes_m, positions_m[:, 2], covariances[:, 2, 2], truncated_edges)


def _seen(positions_m, widths_m, view):
    distances_m, bearings = view.bearings(positions_m)
    is_near = distances_m < NEAR_M
    distances_m = np.maximum(distances_m, NEAR_M)
    rays = (positions_m - view.fixed_from_camera[:2, 3]) / distances_m[:, None]
    rays[is_near] = view.ahead
    return _ObservedDetections(positions_m, rays, distances_m, bearings, np.arctan2(widths_m / 2, distances_m))


def _hidden_side(seen):
    """Side on which a nearer detection partly occludes each detection: 1 left, -1 right, 0 neither or both; (n,)."""
    depths_m = seen.distances_m * np.cos(seen.bearings)
    to_left = wrapped(seen.bearings[None, :] - seen.bearings[:, None])
    gaps = np.abs(to_left) - seen.half_widths[None, :] - seen.half_widths[:, None]
    hides = (depths_m[None, :] < depths_m[:, None] - NEARER_M) & (gaps < TOUCHING_RAD)
    left, right = (hides & (to_left > 0)).any(axis=1), (hides & (to_left <= 0)).any(axis=1)
    return left.astype(int) - right


def _noise(covariances, seen, cut, elapsed_s, params):
    """Covariances (n, 2, 2) for the filter, from the single-image covariances."""
    images = max(1.0, 2 * params.noise_correlation_time / (elapsed_s or USUAL_PERIOD_S))
    noise = np.zeros(covariances.shape)
    for axes, extra_m2 in ((seen.rays, 0), (seen.sides, cut * CUT_SIGMA_M ** 2)):
        variance = ((covariances @ axes[..., None])[..., 0] * axes).sum(axis=1)
        variance += (images - 1) * np.minimum(variance, params.noise_correlated ** 2) + FLOOR_M ** 2 + extra_m2
        noise += variance[:, None, None] * axes[:, :, None] * axes[:, None, :]
    return noise
