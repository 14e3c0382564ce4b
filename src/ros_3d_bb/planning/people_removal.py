"""Which measurements of other sensors show tracked people. Metres."""
import numpy as np

from ros_3d_bb.core.object_classes import PERSON, PERSON_CLASS
from ros_3d_bb.planning.planner_view import covariances_after, position_after

# Duration of a part of a scan that is taken at one time, chosen: at 1.5 rad/s, half of it is 0.015 rad; and longest
# duration of a scan: no laser is as slow.
PART_S, LONGEST_SCAN_S = 0.02, 1.0


def cylinders_of(tracks, ahead_s, margin_m):
    """Upright cylinders (n, 5) that contain people `ahead_s` seconds after their stamp: x, y, radius, lower and upper
    end.

    The radius is that of the body, a margin and the standard deviation of the predicted position. People reach the
    floor, also where furniture hides their legs from the camera: it is not further below their heads than the tallest
    person is tall.
    """
    rows = []
    for track in tracks:
        if track.label == PERSON:
            x, y, z = position_after(track, ahead_s)
            std_m = np.sqrt(np.maximum(np.linalg.eigvalsh(covariances_after(track, [ahead_s])[0, :2, :2]), 0)[-1])
            half_m = track.size_m[2] / 2
            low_m = z + half_m - max(PERSON_CLASS.largest_m[1], track.size_m[2])
            rows.append((x, y, track.size_m[0] / 2 + margin_m + std_m, low_m - margin_m, z + half_m + margin_m))
    return np.reshape(rows, (-1, 5))


def are_inside(points_m, cylinders):
    """Whether points (..., 3) lie in one of the cylinders, bool (...); not for nan."""
    found = np.zeros(points_m.shape[:-1], bool)
    with np.errstate(invalid='ignore'):
        for x, y, radius_m, low_m, high_m in cylinders:
            is_near = (points_m[..., 0] - x) ** 2 + (points_m[..., 1] - y) ** 2 < radius_m ** 2
            found |= is_near & (points_m[..., 2] > low_m) & (points_m[..., 2] < high_m)
    return found


def scan_points(ranges_m, first_angle, step):
    """Points (n, 3) of a planar scan in the frame of the laser; nan for beams without a range."""
    ranges_m = np.where(np.isfinite(ranges_m), ranges_m, np.nan)
    angles = first_angle + step * np.arange(len(ranges_m))
    return np.column_stack((ranges_m * np.cos(angles), ranges_m * np.sin(angles), 0 * ranges_m))


def scan_parts(count, increment_s):
    """Parts of a scan of `count` beams, `increment_s` apart, that are measured at about the same time: (slice, time
    after the first beam in seconds). A single one if the time between beams is not known, or implausible."""
    if not 0 < count * increment_s < LONGEST_SCAN_S:
        return [(slice(None), 0.0)]
    length = max(int(PART_S / increment_s), 1)
    return [(slice(first, first + length), (first + (min(length, count - first) - 1) / 2) * increment_s)
            for first in range(0, count, length)]
