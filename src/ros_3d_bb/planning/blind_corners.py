"""Blind corners: the edges of obstacles behind which people may be hidden. Metres, radians."""
import numpy as np

from ros_3d_bb.planning.people_removal import scan_points

# Chosen: there is room for a person behind an obstacle whose edge is so much nearer than what is seen beside it, and
# which is at least so wide. Legs are narrower.
LEAST_ROOM_M, LEAST_WIDTH_M = 0.5, 0.35


def blind_corners(ranges_m, limits_m, first_angle, step):
    """Blind corners (n, 3) in a planar scan, in the frame of the laser.

    The ranges (n,) are as in REP 117: infinite without a return, nan if they are invalid; `limits_m` are the least and
    the largest one of the laser. The angles are those of the first beam and between two beams.
    """
    least_m, largest_m = limits_m
    limited_m = np.minimum(ranges_m, largest_m)
    with np.errstate(invalid='ignore'):  # nan
        is_valid = limited_m >= least_m
    points_m, limited_m = scan_points(limited_m, first_angle, step)[is_valid], limited_m[is_valid]
    count = len(limited_m)
    if abs(step) * (len(ranges_m) + 1) > 2 * np.pi:  # a full circle is taken twice: obstacles across its ends are whole
        points_m, limited_m = np.tile(points_m, (2, 1)), np.tile(limited_m, 2)
    jumps_m = np.diff(limited_m)
    before, = np.nonzero(np.abs(jumps_m) > LEAST_ROOM_M)  # the last beams on obstacles
    if not len(before):
        return np.zeros((0, 3))
    first, last = np.append(0, before + 1), np.append(before, len(limited_m) - 1)  # beams on each obstacle
    is_wide = np.linalg.norm(points_m[last] - points_m[first], axis=1) >= LEAST_WIDTH_M
    is_next = (jumps_m[before] < 0).astype(int)  # whether the nearer obstacle is the next one
    corners = (before + is_next)[is_wide[np.arange(len(before)) + is_next]]
    return points_m[np.unique(corners % count)]
