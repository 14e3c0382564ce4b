"""What the detections of one image tell a tracker: where, how sure, from which direction, and how large."""
from typing import NamedTuple

import numpy as np

from ros_3d_bb.core.params import Param, parameters
from ros_3d_bb.tracking.kalman_filter import Measurements
from ros_3d_bb.tracking.occlusion import NEARER_M, wrapped

FLOOR_M = 0.02  # nobody's centre is known better than that: people sway as they walk
PERSON_WIDTH_M = 0.5
USUAL_PERIOD_S = 1 / 30.0  # of images, for the first one
PART_M = 0.3  # a box that the image border cuts and that is narrower shows only a part of the width
MAX_SHIFT_M = 0.2
CUT_SIGMA_M = 0.08  # what is not seen of a cut person leaves the side open by so much
NEAR_M = 0.01  # a box closer to the camera is seen from no direction; it is taken to lie straight ahead
TOUCHING_RAD = 0.03  # a nearer box hides another one if there is not more between them
BOX_ERRORS = 'kalman: errors of boxes (their covariance comes from the error model of bbox3d_node)'


@parameters(BOX_ERRORS)
class NoiseParams(NamedTuple):
    """Errors of the positions of boxes."""

    noise_unknown: float = Param(0.1, 'Standard deviation of boxes without a covariance.', 'm', live=(0, 1))
    noise_correlated: float = Param(
        0.035, 'Up to this standard deviation, errors are correlated from image to image.', 'm', live=(0, 0.3))
    noise_correlation_time: float = Param(0.15, 'How long they are correlated.', 's', live=(0, 1))


class MeasurementBatch(NamedTuple):
    """The detections of one image as arrays: where they are on the ground, extents (n, 3), height of the centre and
    its variance, (n,), and whether the image border cuts them on the left, at the top, on the right and at the bottom,
    (n, 4)."""

    ground: Measurements
    sizes_m: np.ndarray
    z_m: np.ndarray
    z_m2: np.ndarray
    truncated: np.ndarray

    @property
    def cut_sideways(self):
        """Whether the image border hides a part of the width, (n,)."""
        return self.truncated[:, 0] | self.truncated[:, 2]

    @property
    def vertical_cuts(self):
        """Whether the image border hides the lower and the upper end, (n, 2)."""
        return self.truncated[:, [3, 1]]

    def select(self, columns):
        """Those in `columns` alone."""
        ground, *others = self
        return MeasurementBatch(Measurements(*(values[columns] for values in ground)),
                                *(values[columns] for values in others))


class _ObservedDetections(NamedTuple):
    """Detections as the camera saw them: on the ground, (n, 2); distances, bearings, half widths in radians, (n,)."""

    positions_m: np.ndarray
    rays: np.ndarray
    distances_m: np.ndarray
    bearings: np.ndarray
    half_widths: np.ndarray

    @property
    def sides(self):
        """Directions (n, 2) to the left of the rays."""
        return np.stack((-self.rays[:, 1], self.rays[:, 0]), axis=1)


def measurement_batch_of(detections, view, elapsed_s, params):
    """The detections of one image, with the noise that a filter may believe.

    An error that lasts for several images would be taken for certainty if each image counted as a new opinion. The part
    of the covariance that lasts is therefore widened by how many images it lasts for, which makes the filter the same
    at any frame rate. The centre of a person whom somebody nearer hides in part, or of whom the image border leaves
    only a part of the width, is put half a width behind the edge that is seen. The side of a cut box is less sure.

    Parameters
    ----------
    detections : sequence of Detection, n
    view : View
    elapsed_s : float
        Since the image before of the same camera; 0 for the first.
    params : NoiseParams

    Returns
    -------
    MeasurementBatch
    """
    positions_m = np.array([detection.position_m for detection in detections]).reshape(-1, 3)
    sizes_m = np.array([detection.size_m for detection in detections]).reshape(-1, 3)
    truncated = np.array([detection.truncated_edges for detection in detections], bool).reshape(-1, 4)
    unknown = np.eye(3) * params.noise_unknown ** 2
    covariances = np.array([unknown if detection.covariance_m2 is None else detection.covariance_m2
                            for detection in detections]).reshape(-1, 3, 3)
    seen = _seen(positions_m[:, :2], sizes_m[:, 0], view)
    hidden = _hidden_side(seen)
    is_part = sizes_m[:, 0] < PART_M
    cut_left, cut_right = truncated[:, 0], truncated[:, 2]
    cut = cut_left | cut_right
    side = np.where(cut, (cut_left.astype(int) - cut_right) * is_part, hidden)
    shift_m = np.clip((PERSON_WIDTH_M - sizes_m[:, 0]) / 2, 0, MAX_SHIFT_M)
    noise_m2 = _noise(covariances[:, :2, :2], seen, cut | (hidden != 0), elapsed_s, params)
    ground = Measurements(seen.positions_m + (side * shift_m)[:, None] * seen.sides, noise_m2, seen.rays)
    return MeasurementBatch(ground, sizes_m, positions_m[:, 2], covariances[:, 2, 2], truncated)


def _seen(positions_m, widths_m, view):
    distances_m, bearings = view.bearings(positions_m)
    is_near = distances_m < NEAR_M
    distances_m = np.maximum(distances_m, NEAR_M)
    rays = (positions_m - view.fixed_from_camera[:2, 3]) / distances_m[:, None]
    rays[is_near] = view.ahead
    return _ObservedDetections(positions_m, rays, distances_m, bearings, np.arctan2(widths_m / 2, distances_m))


def _hidden_side(seen):
    """On which side somebody nearer hides each in part: 1 left, -1 right, 0 on none, or on both."""
    depths_m = seen.distances_m * np.cos(seen.bearings)
    to_left = wrapped(seen.bearings[None, :] - seen.bearings[:, None])
    gaps = np.abs(to_left) - seen.half_widths[None, :] - seen.half_widths[:, None]
    hides = (depths_m[None, :] < depths_m[:, None] - NEARER_M) & (gaps < TOUCHING_RAD)
    left, right = (hides & (to_left > 0)).any(axis=1), (hides & (to_left <= 0)).any(axis=1)
    return left.astype(int) - right


def _noise(covariances, seen, cut, elapsed_s, params):
    """Covariances (n, 2, 2) for the filter, from those of single images."""
    images = max(1.0, 2 * params.noise_correlation_time / (elapsed_s or USUAL_PERIOD_S))
    noise = np.zeros(covariances.shape)
    for axes, extra_m2 in ((seen.rays, 0), (seen.sides, cut * CUT_SIGMA_M ** 2)):
        variance = ((covariances @ axes[..., None])[..., 0] * axes).sum(axis=1)
        variance += (images - 1) * np.minimum(variance, params.noise_correlated ** 2) + FLOOR_M ** 2 + extra_m2
        noise += variance[:, None, None] * axes[:, :, None] * axes[:, None, :]
    return noise
