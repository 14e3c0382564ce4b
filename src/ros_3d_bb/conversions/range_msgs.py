"""Laser scans and point clouds: their points, and the same messages without some of them."""
import copy

import numpy as np
from sensor_msgs.msg import LaserScan, PointCloud2, PointField

SUFFICIENT = 'x', 'y', 'z'


def scan_without(message: LaserScan, is_removed: np.ndarray) -> LaserScan:
    """A copy of a sensor_msgs/LaserScan in which some ranges, bool (n,), are NaN (REP 117: invalid)."""
    changed = copy.copy(message)
    changed.ranges = np.where(is_removed, np.nan, message.ranges).tolist()
    return changed


def points_of_cloud(message: PointCloud2) -> np.ndarray:
    """Points (height * width, 3) of a sensor_msgs/PointCloud2, float32. Raises ValueError if it has no x, y and z of
    this type, or too few bytes."""
    offsets = {field.name: field.offset for field in message.fields if field.datatype == PointField.FLOAT32}
    count = message.height * message.width
    if not set(SUFFICIENT) <= set(offsets) or max(offsets[name] for name in SUFFICIENT) + 4 > message.point_step:
        raise ValueError('it has the fields %s; x, y and z of type FLOAT32 expected'
                         % ', '.join(field.name for field in message.fields))
    if message.row_step != message.width * message.point_step or len(message.data) != count * message.point_step:
        raise ValueError('it has %d bytes in rows of %d, for %d x %d points of %d bytes; rows without gaps expected'
                         % (len(message.data), message.row_step, message.height, message.width, message.point_step))
    kind = np.dtype({'names': SUFFICIENT, 'formats': ['>f4' if message.is_bigendian else '<f4'] * 3,
                     'offsets': [offsets[name] for name in SUFFICIENT], 'itemsize': message.point_step})
    points = np.frombuffer(message.data, kind, count)
    return np.column_stack([points[name] for name in SUFFICIENT])


def cloud_without(message: PointCloud2, is_removed: np.ndarray) -> PointCloud2:
    """A copy of a sensor_msgs/PointCloud2 without some points, bool (n,). In an image of points (height > 1), the
    bytes of these points are those of NaN."""
    rows = np.frombuffer(message.data, np.uint8).reshape(-1, message.point_step)
    changed = copy.copy(message)
    if message.height == 1:
        rows = rows[~is_removed]
        changed.width = len(rows)
        changed.row_step = changed.width * changed.point_step
    else:
        rows, changed.is_dense = rows.copy(), False
        rows[is_removed] = 255  # a NaN as FLOAT32
    changed.data = rows.tobytes()
    return changed
