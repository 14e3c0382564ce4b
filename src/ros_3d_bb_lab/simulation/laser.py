"""Planar laser in the frame of the robot, which sees walls, furniture and people as upright cylinders.

Convention: map frame, metres, radians.
"""
import numpy as np

from ros_3d_bb_lab.simulation.collision import Rectangle

BEAMS, FIELD_OF_VIEW, RANGE_M = 541, np.radians(270), 10.0  # as a Hokuyo or SICK of a Jackal


def planar_pose(map_from_base):
    """Convert a transform (4, 4) to (x, y, yaw)."""
    return np.append(map_from_base[:2, 3], np.arctan2(map_from_base[1, 0], map_from_base[0, 0]))


def scan_ranges(pose, room, people_m, radii_m):
    """Ranges (n,) of the beams from a pose (x, y, yaw) to walls, furniture and people, at most `RANGE_M`; infinite
    without a return. `people_m` (m, 2) and `radii_m` (m,) are cylinders."""
    angles = pose[2] + np.linspace(-FIELD_OF_VIEW / 2, FIELD_OF_VIEW / 2, BEAMS)
    beams = np.column_stack((np.cos(angles), np.sin(angles)))
    ranges_m = np.min([_to_segments(pose[:2], beams, rectangle.corners()) for rectangle in rectangles_of(room)], axis=0)
    for place_m, radius_m in zip(people_m, radii_m):
        along_m = beams.dot(np.subtract(place_m, pose[:2]))
        half_m2 = radius_m ** 2 + along_m ** 2 - np.sum(np.subtract(place_m, pose[:2]) ** 2)
        hit_m = np.where((half_m2 > 0) & (along_m > 0), along_m - np.sqrt(np.maximum(half_m2, 0)), np.inf)
        ranges_m = np.minimum(ranges_m, np.maximum(hit_m, 0))
    return np.where(ranges_m <= RANGE_M, ranges_m, np.inf)


def _to_segments(origin, beams, corners):
    """Distances (n,) along beams (n, 2) to the edges of a polygon (k, 2); infinite where there is none."""
    found = np.full(len(beams), np.inf)
    for start, end in zip(corners, np.roll(corners, -1, axis=0)):
        edge, offset = end - start, start - origin
        with np.errstate(divide='ignore', invalid='ignore'):
            cross = beams[:, 0] * edge[1] - beams[:, 1] * edge[0]
            distance_m = (offset[0] * edge[1] - offset[1] * edge[0]) / cross
            share = (offset[0] * beams[:, 1] - offset[1] * beams[:, 0]) / cross
        is_hit = (distance_m > 0) & (0 <= share) & (share <= 1)
        found = np.where(is_hit, np.minimum(found, np.where(is_hit, distance_m, np.inf)), found)
    return found


def rectangles_of(room):
    x0, x1, y0, y1 = room.bounds
    walls = Rectangle(((x0 + x1) / 2, (y0 + y1) / 2), 0.0, (x1 - x0, y1 - y0))
    return [walls] + [Rectangle(item.at, item.yaw, item.size[:2]) for item in room.furniture]
