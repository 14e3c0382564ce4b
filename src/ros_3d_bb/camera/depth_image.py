"""Depth images in the camera's raw units."""
from typing import NamedTuple

import numpy as np

FARTHEST_M = 100.0  # beyond the range of any depth camera


class DepthImage(NamedTuple):
    """A depth image: raw `values` (height, width) of any numeric type; depth in metres is `values` times `scale_m`.

    Depths that are zero, negative, nan, inf or greater than `FARTHEST_M` are invalid.
    """

    values: np.ndarray
    scale_m: float

    def at(self, u, v):
        """Return the depth, metres, at the pixels in columns u and rows v (arrays of int), and whether it is valid."""
        depth_m = self.values[v, u].astype(float) * self.scale_m
        return depth_m, (depth_m > 0) & (depth_m <= FARTHEST_M)
