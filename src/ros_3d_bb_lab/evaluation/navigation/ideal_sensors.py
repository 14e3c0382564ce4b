"""What ideal sensors of the robot show of the people: cameras without errors, and a planar laser.

Convention: metres, radians.
"""
import collections

import numpy as np

from ros_3d_bb.tracking.types import VISIBLE

SCAN_ANGLE_RAD, SCAN_BEAMS, SCAN_RANGE_M = 1.5 * np.pi, 541, 10.0  # 270 degrees, as the laser scanner of a Jackal
SHINS_M = 0.15  # radius of a person at the height of the scan, both legs


class VisiblePeople(object):
    """People whom at least one camera shows. The cameras take turns, and each reports all people with a status."""

    def __init__(self, cameras):
        self._visible = collections.deque(maxlen=cameras)

    def of(self, tracks):
        """Those of the tracks (with `id` and `status`) that are visible in the newest image of any camera."""
        self._visible.append({track.id for track in tracks if track.status == VISIBLE})
        return [track for track in tracks if any(track.id in visible for visible in self._visible)]


def scan_angles():
    """Bearings (SCAN_BEAMS,) of the beams from the x axis of the robot."""
    return np.linspace(-SCAN_ANGLE_RAD / 2, SCAN_ANGLE_RAD / 2, SCAN_BEAMS)


def scan_ranges(origin, yaw, people, rectangles):
    """Distances (SCAN_BEAMS,) from a laser at `origin` (2,) to people at (n, 2) and to `collision.Rectangle`s, in the
    map; infinite beyond `SCAN_RANGE_M`.
    """
    angles = scan_angles() + yaw
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    segments = [np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
                for corners in (rectangle.corners() for rectangle in rectangles)]
    ranges = np.stack([_to_circle(directions, np.subtract(person, origin), SHINS_M) for person in people]
                      + [_to_segment(directions, start - origin, end - origin)
                         for rectangle in segments for start, end in rectangle]
                      + [np.full(SCAN_BEAMS, np.inf)]).min(axis=0)
    return np.where(ranges <= SCAN_RANGE_M, ranges, np.inf)


def _to_circle(directions, center, radius):
    """Distances along unit vectors (n, 2) from the origin to a circle, infinite without an intersection."""
    along = directions.dot(center)
    half_squared = radius ** 2 - (center.dot(center) - along ** 2)
    nearest = along - np.sqrt(np.maximum(half_squared, 0))
    return np.where((half_squared >= 0) & (nearest > 0), nearest, np.inf)


def _to_segment(directions, start, end):
    """Distances along unit vectors (n, 2) from the origin to a segment, infinite without an intersection."""
    edge = end - start
    determinant = directions[:, 0] * edge[1] - directions[:, 1] * edge[0]
    with np.errstate(divide='ignore', invalid='ignore'):
        distance = (start[0] * edge[1] - start[1] * edge[0]) / determinant
        share = (start[0] * directions[:, 1] - start[1] * directions[:, 0]) / determinant
        return np.where((distance > 0) & (0 <= share) & (share <= 1), distance, np.inf)
