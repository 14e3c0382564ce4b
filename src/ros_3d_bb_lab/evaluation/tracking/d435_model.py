"""Model of a D435 on a robot: visibility of people as vertical cylinders, and errors of their measured positions.

Convention: bearings are relative to the optical axis and positive to the left; `depth` is along the optical axis,
`range` is the horizontal distance to the person.
"""
from typing import NamedTuple

import numpy as np

from ros_3d_bb.camera.camera_model import Camera

SIZE_PX = 1280, 720
BODY_RADIUS_M = 0.25
BLIND_M = 0.2  # nearer people do not occlude others: they are above the camera or behind its cover glass
# Thesis 5.2: measured minus true depth, polynomial of depth in metres. Fitted up to 3 m; proportional to depth beyond.
THESIS_BIAS, THESIS_BIAS_UP_TO_M = (-0.04, 0.06, 0.008), 3.0
HEIGHT_SIGMA_M = 0.1  # of the centre, as in the error models in config/error_models


class CameraModel(NamedTuple):
    """Camera with its detector and its calibration; lengths in metres, times in seconds.

    Depth errors consist of the stereo error with `matching_px`, of `depth_floor_m` (independent in each image), and of
    `slow_depth_m` with the correlation time `slow_s`. Outliers are intervals with a depth error between the limits
    `outlier_m`, as from background in the box. Outliers and misses have a share of the time and a mean length.
    """

    field_of_view: float = np.radians(69.0)  # radians
    nearest_m: float = 0.3  # depth from which the image is sharp
    farthest_m: float = 6.0  # range up to which it is
    focal_px: float = 614.7
    baseline_m: float = 0.05
    matching_px: float = 0.08
    depth_floor_m: float = 0.008
    side_floor_m: float = 0.009
    slow_depth_m: float = 0.035
    slow_side_m: float = 0.015
    slow_s: float = 0.5
    sway_m: float = 0.02  # amplitude of the lateral sway of a walking person
    bias_left: float = 0.2  # share of the thesis' bias that remains after calibration
    outlier_share: float = 0.05
    outlier_s: float = 0.05
    outlier_m: tuple = (0.15, 1.0)
    miss_share: float = 0.1
    miss_s: float = 0.1
    false_rate: float = 0.01  # probability per image of a new false detection
    false_s: float = 0.1  # its mean duration
    double_share: float = 0.02  # probability that a detection has a duplicate

    @property
    def intrinsics(self):
        """Camera with this field of view, without distortion, with square pixels and an aspect ratio of 16:9."""
        width, height = SIZE_PX
        focal_px = width / 2.0 / np.tan(self.field_of_view / 2)
        return Camera(width, height, focal_px, focal_px, (width - 1) / 2.0, (height - 1) / 2.0)

    def depth_sigma_m(self, depth_m):
        """Standard deviation of the depth error that is independent in each image."""
        return np.hypot(self.depth_floor_m, np.square(depth_m) * self.matching_px / (self.focal_px * self.baseline_m))

    def covariance_m2(self, bearing, depth_m):
        """Covariance of a position, (3, 3) in the optical frame, of the independent and the slow errors."""
        along_m2 = self.depth_sigma_m(depth_m) ** 2 + self.slow_depth_m ** 2
        across_m2 = self.side_floor_m ** 2 + self.slow_side_m ** 2
        right, forward = -np.sin(bearing), np.cos(bearing)
        mixed_m2 = right * forward * (along_m2 - across_m2)
        return np.array([[right ** 2 * along_m2 + forward ** 2 * across_m2, 0, mixed_m2],
                         [0, HEIGHT_SIGMA_M ** 2, 0],
                         [mixed_m2, 0, forward ** 2 * along_m2 + right ** 2 * across_m2]])


def thesis_bias_m(depth_m):
    depth_m = np.asarray(depth_m, float)
    at_end_m = np.polyval(THESIS_BIAS, THESIS_BIAS_UP_TO_M)
    return np.where(depth_m <= THESIS_BIAS_UP_TO_M, np.polyval(THESIS_BIAS, depth_m),
                    at_end_m / THESIS_BIAS_UP_TO_M * depth_m)


def half_width(range_m):
    return np.arcsin(BODY_RADIUS_M / np.maximum(range_m, BODY_RADIUS_M + 0.02))


def shown(bearing, half, range_m, half_view):
    """Visible parts of cylinders (n,) with angular half-widths around their bearings, occluded by nearer ones.

    The field of view extends from -`half_view` to `half_view`. Returns arrays (n,) of the largest visible part of each:
    its share of the width, its bearing (that of the cylinder if none is visible), and whether the image border cuts it.
    """
    share, middle, cut = np.zeros(len(bearing)), np.array(bearing, float), np.zeros(len(bearing), bool)
    nearer = []
    for person in np.argsort(range_m):
        left, right = bearing[person] + half[person], bearing[person] - half[person]
        pieces = _without(nearer, max(right, -half_view), min(left, half_view))
        if pieces:
            low, high = max(pieces, key=lambda piece: piece[1] - piece[0])
            share[person] = (high - low) / (left - right)
            middle[person] = (low + high) / 2
            cut[person] = low <= -half_view or high >= half_view
        if range_m[person] > BLIND_M:
            nearer.append((right, left))
    return share, middle, cut


def _without(covers, low, high):
    """Parts (low, high) of an interval that no cover (low, high) hides."""
    pieces = [(low, high)] if high > low else []
    for cover_low, cover_high in covers:
        if cover_high > low and cover_low < high:
            pieces = [piece for begin, end in pieces
                      for piece in ((begin, min(end, cover_low)), (max(begin, cover_high), end)) if piece[1] > piece[0]]
    return pieces
