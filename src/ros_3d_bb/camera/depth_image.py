"""Depth images."""
from typing import NamedTuple

import numpy as np

FARTHEST_M = 100.0  # farther away no depth camera measures anything


class DepthImage(NamedTuple):
    """A depth image as the camera sent it: `values` (height, width) of any numeric type, times `scale_m` is metres.

    Zero, negative, nan, inf and more than `FARTHEST_M` mean: no depth measured there.
    """

    values: np.ndarray
    scale_m: float

    def at(self, u, v):
        """Depth in metres at integer pixels (columns u, rows v: arrays, or slices for a grid), and whether it was
        measured; arrays of one shape."""
        depth_m = self.values[v, u].astype(float) * self.scale_m
        return depth_m, (depth_m > 0) & (depth_m <= FARTHEST_M)
