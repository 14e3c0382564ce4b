"""Contact of the robot, a rectangle, with people, furniture and walls. Convention: map frame, metres, radians."""
from typing import NamedTuple, Tuple

import numpy as np


class Rectangle(NamedTuple):
    """Rectangle on the floor; `size` is its length along `yaw` and its width."""

    center: Tuple[float, float]
    yaw: float
    size: Tuple[float, float]

    def corners(self):
        """Corners (4, 2) in the map."""
        return self.center + (np.array(self.size) / 2 * ((1, 1), (-1, 1), (-1, -1), (1, -1))).dot(self._axes())

    def nearest_point(self, point):
        """Point (2,) of the rectangle, including its interior, that is nearest to a point."""
        local = self._axes().dot(np.subtract(point, self.center))
        half = np.array(self.size) / 2
        return self.center + np.clip(local, -half, half).dot(self._axes())

    def signed_distances_m(self, points):
        """Distances (n,) of points (n, 2) from the edge, negative inside."""
        beyond = np.abs(np.subtract(points, self.center).dot(self._axes().T)) - np.array(self.size) / 2
        return np.hypot(*np.maximum(beyond, 0).T) + np.minimum(beyond.max(axis=1), 0)

    def overlaps(self, other):
        """Whether two rectangles overlap: neither has an axis on which their projections are separate."""
        for axis in np.concatenate([self._axes(), other._axes()]):
            ours, theirs = self.corners().dot(axis), other.corners().dot(axis)
            if ours.max() < theirs.min() or theirs.max() < ours.min():
                return False
        return True

    def is_within(self, bounds):
        (x_min, y_min), (x_max, y_max) = self.corners().min(axis=0), self.corners().max(axis=0)
        return bool(bounds[0] < x_min and x_max < bounds[1] and bounds[2] < y_min and y_max < bounds[3])

    def _axes(self):
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return np.array([[c, s], [-s, c]])


def nearest_wall_points(point, bounds):
    """Points (4, 2) of the walls of a room (x0, x1, y0, y1) that are nearest to a point inside."""
    x, y = point
    x0, x1, y0, y1 = bounds
    return np.array([(x0, y), (x1, y), (x, y0), (x, y1)])
