"""What a D435 on a robot shows of people who are upright cylinders, and how far off their measured positions are.

Convention: the camera looks along its bearing 0, bearings grow to the left; `depth` is along the optical axis, `range`
along the ground to the person.
"""
from typing import NamedTuple

import numpy as np

from ros_3d_bb.camera.camera_model import Camera

SIZE_PX = 1280, 720
BODY_RADIUS_M = 0.25
BLIND_M = 0.2  # who is nearer stands above the camera or behind its glass, and hides nobody
# Thesis 5.2: what is measured minus what is, by depth in metres; measured up to 3 m, so beyond it grows with depth.
THESIS_BIAS, THESIS_BIAS_UP_TO_M = (-0.04, 0.06, 0.008), 3.0
HEIGHT_SIGMA_M = 0.1  # of the centre, as the error models that ship with the package say


class CameraModel(NamedTuple):
    """A camera with its detector and its calibration.

    `field_of_view` in radians, sharp from `nearest_m` of depth to `farthest_m` of range. Depth errors: the stereo law
    of `matching_px`, `focal_px` and `baseline_m`, `depth_floor_m` in each image, and `slow_depth_m`, which changes
    over `slow_s`; sideways `side_floor_m` and `slow_side_m`. `bias_left` is the share of the thesis' bias that
    calibration leaves. An outlier is `outlier_m` (from, to) too deep, as background in the box makes it.
    `sway_m` is what a walking body moves sideways by. Shares are of the time, with stretches of the given length.
    """

    field_of_view: float = np.radians(69.0)
    nearest_m: float = 0.3
    farthest_m: float = 6.0
    focal_px: float = 614.7
    baseline_m: float = 0.05
    matching_px: float = 0.08
    depth_floor_m: float = 0.008
    side_floor_m: float = 0.009
    slow_depth_m: float = 0.035
    slow_side_m: float = 0.015
    slow_s: float = 0.5
    sway_m: float = 0.02
    bias_left: float = 0.2
    outlier_share: float = 0.05
    outlier_s: float = 0.05
    outlier_m: tuple = (0.15, 1.0)
    miss_share: float = 0.1
    miss_s: float = 0.1
    false_rate: float = 0.01
    false_s: float = 0.1
    double_share: float = 0.02

    @property
    def intrinsics(self):
        """A camera without distortion that sees as wide, with square pixels and 16:9."""
        width, height = SIZE_PX
        focal_px = width / 2.0 / np.tan(self.field_of_view / 2)
        return Camera(width, height, focal_px, focal_px, (width - 1) / 2.0, (height - 1) / 2.0)

    def depth_sigma_m(self, depth_m):
        """Standard deviation of the depth's error from image to image."""
        return np.hypot(self.depth_floor_m, np.square(depth_m) * self.matching_px / (self.focal_px * self.baseline_m))

    def covariance_m2(self, bearing, depth_m):
        """What an error model says of a position: (3, 3) in the optical frame, square metres.

        Along the ray and across it, each with the slow part, as a fit to many measurements finds them.
        """
        along_m2 = self.depth_sigma_m(depth_m) ** 2 + self.slow_depth_m ** 2
        across_m2 = self.side_floor_m ** 2 + self.slow_side_m ** 2
        right, forward = -np.sin(bearing), np.cos(bearing)
        mixed_m2 = right * forward * (along_m2 - across_m2)
        return np.array([[right ** 2 * along_m2 + forward ** 2 * across_m2, 0, mixed_m2],
                         [0, HEIGHT_SIGMA_M ** 2, 0],
                         [mixed_m2, 0, forward ** 2 * along_m2 + right ** 2 * across_m2]])


class Shown(NamedTuple):
    """What an image shows of people (n,): the largest visible `share` of each one's width, 0..1, the bearing of its
    `middle`, and whether the image border cuts it.
    """

    share: np.ndarray
    middle: np.ndarray
    cut: np.ndarray


def thesis_bias_m(depth_m):
    """The thesis' error of depth, metres."""
    depth_m = np.asarray(depth_m, float)
    at_end_m = np.polyval(THESIS_BIAS, THESIS_BIAS_UP_TO_M)
    return np.where(depth_m <= THESIS_BIAS_UP_TO_M, np.polyval(THESIS_BIAS, depth_m),
                    at_end_m / THESIS_BIAS_UP_TO_M * depth_m)


def half_width(range_m):
    """Half of the angle under which a person is seen."""
    return np.arcsin(BODY_RADIUS_M / np.maximum(range_m, BODY_RADIUS_M + 0.02))


def shown(bearing, half, range_m, half_view):
    """Who is seen: cylinders of a half width around their bearings, behind nearer ones, in a view of +-`half_view`.

    Parameters
    ----------
    bearing, half, range_m : numpy.ndarray, (n,)

    Returns
    -------
    Shown
        `middle` is the bearing itself where nothing is seen.
    """
    result = Shown(np.zeros(len(bearing)), np.array(bearing, float), np.zeros(len(bearing), bool))
    nearer = []
    for person in np.argsort(range_m):
        left, right = bearing[person] + half[person], bearing[person] - half[person]
        pieces = _without(nearer, max(right, -half_view), min(left, half_view))
        if pieces:
            low, high = max(pieces, key=lambda piece: piece[1] - piece[0])
            result.share[person] = (high - low) / (left - right)
            result.middle[person] = (low + high) / 2
            result.cut[person] = low <= -half_view or high >= half_view
        if range_m[person] > BLIND_M:
            nearer.append((right, left))
    return result


def _without(covers, low, high):
    """The pieces (low, high) of an interval that no cover (low, high) hides."""
    pieces = [(low, high)] if high > low else []
    for cover_low, cover_high in covers:
        if cover_high > low and cover_low < high:
            pieces = [piece for begin, end in pieces
                      for piece in ((begin, min(end, cover_low)), (max(begin, cover_high), end)) if piece[1] > piece[0]]
    return pieces
