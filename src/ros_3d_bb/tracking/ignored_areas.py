"""Places where no track starts: polygons, and occupied cells of a static map. Fixed frame, metres."""
import json
import math
from typing import List, NamedTuple, Optional, Sequence

import numpy as np

from ros_3d_bb.camera.camera_model import Vector

STEP_M = 0.05  # between the points of a line of sight that are looked up in the map


class OccupiedCells(NamedTuple):
    """Occupied cells of a static map, as in nav_msgs/OccupancyGrid.

    `cells` (rows, columns) are bool, with rows along y and columns along x of the map, whose origin in the fixed frame
    is `origin`, (x, y, yaw). `resolution_m` is the size of a cell.
    """

    cells: np.ndarray
    resolution_m: float
    origin: tuple

    def at(self, points_m: np.ndarray) -> np.ndarray:
        """Whether points (n, 2) lie in occupied cells, bool (n,); not outside of the map."""
        x, y, yaw = self.origin
        offsets_m = np.subtract(points_m, (x, y))
        along_x = offsets_m.dot((math.cos(yaw), math.sin(yaw)))
        along_y = offsets_m.dot((-math.sin(yaw), math.cos(yaw)))
        rows, columns = (np.floor(np.divide(along, self.resolution_m)).astype(int) for along in (along_y, along_x))
        is_inside = (0 <= rows) & (rows < self.cells.shape[0]) & (0 <= columns) & (columns < self.cells.shape[1])
        found = np.zeros(len(offsets_m), bool)
        found[is_inside] = self.cells[rows[is_inside], columns[is_inside]]
        return found


class IgnoredAreas(NamedTuple):
    """Where no track starts.

    `polygons` are arrays (n, 2), `occupied` an OccupiedCells, None without a map. The centre of a box of a
    poster lies in the wall or, as it is half a body behind the visible surface, up to `map_depth_m` behind it.
    """

    polygons: Sequence[np.ndarray] = ()
    occupied: Optional[OccupiedCells] = None
    map_depth_m: float = 0.0

    def differs_from(self, other: 'IgnoredAreas') -> bool:
        """Whether polygons or `map_depth_m` differ from those of other IgnoredAreas."""
        polygons, others = ([polygon.tolist() for polygon in areas.polygons] for areas in (self, other))
        return polygons != others or self.map_depth_m != other.map_depth_m

    def contains(self, position_m: Vector, camera_m: Vector) -> bool:
        """Whether the centre of a box, (2,) or (3,), seen from a camera at (2,) or (3,), lies in an ignored area."""
        x, y = map(float, position_m[:2])
        return any(_is_inside(x, y, polygon) for polygon in self.polygons) or self._is_on_the_map(x, y, camera_m)

    def _is_on_the_map(self, x: float, y: float, camera_m: Vector) -> bool:
        if self.occupied is None:
            return False
        to_camera = np.array([camera_m[0] - x, camera_m[1] - y])
        distance_m = max(float(np.linalg.norm(to_camera)), 1e-6)
        nearer_m = np.arange(0, min(self.map_depth_m, distance_m) + 1e-9, STEP_M)
        return bool(self.occupied.at((x, y) + np.outer(nearer_m / distance_m, to_camera)).any())


def polygons_from(text: str) -> List[np.ndarray]:
    """Polygons, a list of arrays (n, 2), from a text such as `[[[1, 2], [3, 2], [3, 4]]]`; none from an empty text.

    Raises ValueError if it is not a list of polygons with at least three finite corners each.
    """
    try:
        polygons = [np.array(polygon, float) for polygon in json.loads(text or '[]')]
        is_valid = all(polygon.ndim == 2 and polygon.shape[1] == 2 and len(polygon) >= 3 and np.isfinite(polygon).all()
                       for polygon in polygons)
    except (TypeError, ValueError):
        is_valid = False
    if not is_valid:
        raise ValueError('parameter ~ignored_areas is %r; a list of polygons with three or more corners expected, such '
                         'as [[[1, 2], [3, 2], [3, 4]]]' % text)
    return polygons


def _is_inside(x: float, y: float, polygon: np.ndarray) -> bool:
    """Whether a point lies in a polygon (n, 2): a ray along x crosses its edges an odd number of times."""
    inside = False
    for (x1, y1), (x2, y2) in zip(polygon, np.roll(polygon, -1, axis=0)):
        if (y1 > y) != (y2 > y) and x < x1 + (y - y1) * (x2 - x1) / (y2 - y1):
            inside = not inside
    return inside
