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
        """Depth at pixels.

        Parameters
        ----------
        u, v : numpy.ndarray of int or slice
            Columns and rows; slices select a grid.

        Returns
        -------
        depth_m : numpy.ndarray
            Metres.
        valid : numpy.ndarray of bool
            Whether depth was measured, with the shape of depth_m.
        """
        depth_m = self.values[v, u].astype(float) * self.scale_m
        return depth_m, (depth_m > 0) & (depth_m <= FARTHEST_M)
