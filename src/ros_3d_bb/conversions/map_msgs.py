"""Conversion of static maps."""
import numpy as np

from ros_3d_bb.tracking.ignored_areas import OccupiedCells

OCCUPIED = 65  # of 100, as from map_server (occupied_thresh)


def occupied_from_msg(message):
    """Convert a nav_msgs/OccupancyGrid to OccupiedCells. Raises ValueError if it is invalid."""
    info, place, turn = message.info, message.info.origin.position, message.info.origin.orientation
    yaw = 2 * np.arctan2(turn.z, turn.w)
    if len(message.data) != info.width * info.height or not info.resolution > 0 or not np.isfinite(
            [place.x, place.y, yaw, info.resolution]).all():
        raise ValueError('it has %d cells of %g m, %d x %d at (%g, %g); cells of a positive size, their number, and '
                         'a finite place expected' % (len(message.data), info.resolution, info.width, info.height,
                                                      place.x, place.y))
    cells = np.reshape(np.array(message.data, np.int8), (info.height, info.width)) >= OCCUPIED
    return OccupiedCells(cells, info.resolution, (place.x, place.y, float(yaw)))
