"""Measurement model: convert the detections of one image to positions, covariances, viewing rays and sizes.

The noise of boxes without a covariance is assumed, and its scale is learned from innovations. The innovations of a
filter with the right noise are white (Kailath 1968), and their autocorrelation shows what is wrong (Mehra 1970). With
too much noise, the filter lags behind a person who turns, and successive innovations have the same direction. With too
little, it follows the errors of the boxes, and they have opposite directions. The variance is lowered or raised
accordingly. Unlike the size of innovations, their correlation hardly depends on how much people turn.
"""
import math
from typing import Any, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from ros_3d_bb.core.detector_model import DetectorModel
from ros_3d_bb.core.object_classes import ObjectClass, ObjectClasses
from ros_3d_bb.core.params import Param, parameters
from ros_3d_bb.tracking.types import NEARER_M, CameraView, Detection, wrapped

FLOOR_M = 0.02  # lower bound of the standard deviation of a centre; chosen: people sway as they walk
WIDER_M = 0.04  # chosen: people are wider than the usual width, to which the estimator completes truncated boxes
USUAL_PERIOD_S = 1 / 30.0  # image period assumed for the first image of a camera; chosen: that of a D435
# Spectral density of the position noise, m² s. Chosen: with it and the default acceleration, errors of the D435, which
# last 0.5 s, count as if they lasted 0.15 s, as before their duration was measured.
NOISE_DENSITY = 0.08 * 0.3273 ** 4
PART_M = 0.3  # a narrower truncated box shows only a part of the body's width; chosen: less than the usual 0.5 m
MAX_SHIFT_M = 0.2  # chosen: less than half of the usual width
CUT_SIGMA_M = 0.08  # additional lateral standard deviation of truncated or partly occluded boxes; chosen
NEAR_M = 0.01  # the viewing ray of a closer box is undefined; the optical axis is used instead
TOUCHING_RAD = 0.03  # a nearer box occludes another one if the gap between them is smaller than this; chosen
DEFAULT_RANGE_M = 8.0  # of a D435 and YOLOv5n; chosen
RANGE_GAIN = 0.05  # of the filter that learns the range; chosen
# Scale of the assumed noise. Chosen; test_noise_scale.py shows the effect.
GAIN = 0.2  # change of the logarithm of the variance by a pair of innovations, relative to their correlation
LARGEST = 3.0  # correlations are limited to this multiple of the expected squared innovation
SETTLED_HITS = 3  # innovations of newer tracks show their unknown velocity
MIN_LOG_SCALE, MAX_LOG_SCALE = 2 * math.log(0.05), 2 * math.log(2)  # of the variance, for 0.05 to 2 times the deviation
BOX_ERRORS = 'errors of boxes (their covariance comes from the error model of bbox3d_node)'


@parameters(BOX_ERRORS)
class NoiseParams(NamedTuple):
    """Parameters of the position errors of boxes."""

    noise_unknown: float = Param(
        0.1, 'Standard deviation of boxes without a covariance, lasting errors included.', 'm', live=(0, 1))


class Kind(NamedTuple):
    """A class: its name and group, the names of all classes of the group, and `object_classes.ObjectClass`."""

    label: str
    group: object
    members: Tuple[str, ...]
    known: ObjectClass


class Kinds(dict):
    """Kind by class name. A class that the table `object_classes.ObjectClasses` does not list is a group of its own."""

    def __init__(self, table: ObjectClasses) -> None:
        super(Kinds, self).__init__()
        self._default = table.default
        for label, known in table.listed.items():
            group = table.group_of(label)
            members = tuple(other for other in table.listed if table.group_of(other) == group)
            self[label] = Kind(label, group, members, known)

    def __missing__(self, label: str) -> Kind:
        return Kind(label, (label,), (label,), self._default)


class BoxNoise(NamedTuple):
    """Noise of the boxes of one image: the standard deviation where it is unknown, and the learned scale of its
    variance; the standard deviation of lasting errors, and the number of images over which they are correlated.
    """

    unknown_m: float
    unknown_scale: float
    lasting_m: float
    images: float


class Measurement(NamedTuple):
    """A detection as the filter uses it.

    Centre; covariance (xx, xy, yy) in the plane and variance of the height; whether the covariance is assumed; extents;
    distance from the camera and unit vector from the camera in the plane; Kind; the Detection, and its number in the
    image; whether it is nearer than its track by the offset of outliers.
    """

    x: float
    y: float
    z: float
    xx: float
    xy: float
    yy: float
    zz: float
    is_assumed: bool
    size_m: Tuple[float, float, float]
    distance_m: float
    ray_x: float
    ray_y: float
    kind: Kind
    detection: Detection
    number: int
    is_nearer: bool = False


def correlated_images(elapsed_s: Optional[float], detector: DetectorModel, acceleration: float) -> float:
    """Number of images over which position errors are correlated.

    A filter that treats them as independent underestimates its covariance. The lasting part is therefore multiplied by
    this number, which makes the filter independent of the frame rate. Errors that last much longer than the memory M of
    the filter shift the track and hardly change its velocity: with the correlation time T, white noise of the density
    2 T / (1 + w² T²) has the same power at the frequency w = 1 / M. This is the natural frequency of the steady filter,
    (q / r)^(1/4), where r is the density of the position noise and q that of the acceleration.
    """
    time_s = detector.correlation_time_s
    correlated_s = time_s / (1 + time_s ** 2 * math.sqrt(acceleration / NOISE_DENSITY))
    return max(1.0, 2 * correlated_s / (elapsed_s or USUAL_PERIOD_S))


def measurements_of(detections: Sequence[Detection], view: CameraView, noise: BoxNoise,
                    kinds: Kinds) -> List[Measurement]:
    """Convert the detections of one image to a list of Measurement, given its BoxNoise and the Kinds.

    If a nearer object partly occludes a detection, or the image border leaves only a part of its width, the centre is
    shifted to half the usual width of the class from the visible edge. The lateral position of such a box is less
    certain.
    """
    if not detections:
        return []
    camera_m, ahead = view.fixed_from_camera[:2, 3].tolist(), view.ahead.tolist()
    measurements = []
    for number, (detection, side) in enumerate(zip(detections, _hidden_sides(detections, view))):
        x, y, _z = map(float, detection.position_m)
        to_x, to_y = x - camera_m[0], y - camera_m[1]
        distance_m = math.hypot(to_x, to_y)
        direction = (distance_m, to_x / distance_m, to_y / distance_m) if distance_m >= NEAR_M else (NEAR_M, *ahead)
        measurements.append(_measurement(detection, number, side, kinds[detection.label], direction, noise))
    return measurements


def _measurement(detection: Detection, number: int, side: int, kind: Kind, direction: Tuple[float, float, float],
                 noise: BoxNoise) -> Measurement:
    (x, y, z), (ray_x, ray_y) = map(float, detection.position_m), direction[1:]
    size_m: Any = tuple(map(float, detection.size_m))
    is_assumed, lasting_m2 = False, noise.lasting_m ** 2
    if detection.covariance_m2 is None:
        xx = yy = zz = noise.unknown_m ** 2
        cross, is_assumed = 0.0, True
    else:
        (xx, xy, _xz), (yx, yy, _yz), (_zx, _zy, zz) = detection.covariance_m2
        cross = xy + yx
    # Rounding may have made the variances of a covariance that is nearly singular negative.
    along = max(float(xx * ray_x * ray_x + cross * ray_x * ray_y + yy * ray_y * ray_y), 0.0)
    across = max(float(xx * ray_y * ray_y - cross * ray_x * ray_y + yy * ray_x * ray_x), 0.0)
    along += (noise.images - 1) * min(along, lasting_m2) + FLOOR_M ** 2
    across += (noise.images - 1) * min(across, lasting_m2) + FLOOR_M ** 2
    cut_left, _top, cut_right, _bottom = detection.truncated_edges
    if side or cut_left or cut_right:
        across += CUT_SIGMA_M ** 2
    if is_assumed:
        along, across = noise.unknown_scale * along, noise.unknown_scale * across
    if cut_left or cut_right:
        side = int(cut_left) - int(cut_right) if size_m[0] < PART_M else 0
    shift_m = side * min(max((kind.known.width + WIDER_M - size_m[0]) / 2, 0.0), MAX_SHIFT_M)
    return Measurement(
        x - shift_m * ray_y, y + shift_m * ray_x, z, along * ray_x * ray_x + across * ray_y * ray_y,
        (along - across) * ray_x * ray_y, along * ray_y * ray_y + across * ray_x * ray_x, float(zz), is_assumed, size_m,
        *direction, kind=kind, detection=detection, number=number)


def _hidden_sides(detections: Sequence[Detection], view: CameraView) -> List[int]:
    """Side on which a nearer detection partly occludes each one: 1 left, -1 right, 0 neither or both; a list of int."""
    if len(detections) == 1:
        return [0]
    distances_m, bearings = view.bearings([detection.position_m for detection in detections])
    distances_m = np.maximum(distances_m, NEAR_M)
    half_widths = np.arctan2([detection.size_m[0] / 2 for detection in detections], distances_m)
    depths_m = distances_m * np.cos(bearings)
    to_left = wrapped(bearings - bearings[:, None])
    gaps = np.abs(to_left) - half_widths - half_widths[:, None]
    hides = (depths_m < depths_m[:, None] - NEARER_M) & (gaps < TOUCHING_RAD)
    left, right = (hides & (to_left > 0)).any(axis=1), (hides & (to_left <= 0)).any(axis=1)
    return (left.astype(int) - right).tolist()


def scaled(measurement: Measurement, scale: float) -> Measurement:
    """The measurement with the variances of assumed noise multiplied by `scale`."""
    if not measurement.is_assumed or scale == 1:
        return measurement
    return measurement._replace(xx=scale * measurement.xx, xy=scale * measurement.xy, yy=scale * measurement.yy)


def learned_log_scale(log_scale: float, matches: Sequence[Tuple[Any, Measurement]]) -> float:
    """The logarithm of the scale of the assumed variance after an image.

    In the matches (Track, Measurement), the tracks are predicted to the image, and the measurements have the noise for
    the association, with a scale of 1 or more. Errors that last are not in the innovations. The learned noise is that
    part of `noise_unknown` which changes from image to image; the rest is added to the published covariances
    (`prediction.learned_prediction`).
    """
    scale, total = math.exp(min(log_scale, 0)), 0.0
    for track, measurement in matches:
        if measurement.is_assumed and track.hits >= SETTLED_HITS and not measurement.is_nearer:
            (before_x, before_y), state = track.innovation_m, track.state
            product = before_x * (measurement.x - state.x) + before_y * (measurement.y - state.y)
            expected = state.xx + state.yy + scale * (measurement.xx + measurement.yy)
            total += min(max(product / expected, -LARGEST), LARGEST)
    return min(max(log_scale - GAIN * total, MIN_LOG_SCALE), MAX_LOG_SCALE)


def learned_range(range_m: float, matches: Sequence[Tuple[Any, Measurement]]) -> float:
    """Range of the detector after an image with matches (Track, Measurement): `DEFAULT_RANGE_M`, or the filtered mean
    distance of the confirmed tracks that are detected farther away. Beyond it, detectors miss people often."""
    far_m = [measurement.distance_m for track, measurement in matches
             if measurement.distance_m > DEFAULT_RANGE_M and track.is_confirmed]
    if not far_m:
        return range_m
    return range_m + (1 - (1 - RANGE_GAIN) ** len(far_m)) * (sum(far_m) / len(far_m) - range_m)
