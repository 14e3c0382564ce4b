"""Depth images in the camera's raw units."""
from typing import NamedTuple, Optional, Tuple

import numpy as np

FARTHEST_M = 100.0  # beyond the range of any depth camera
WIDEST_BORDER, BORDER_STEP = 0.05, 12  # of images without depth: share of the image; pixels between samples


class DepthImage(NamedTuple):
    """A depth image: raw `values` (height, width) of any numeric type; depth in metres is `values` times `scale_m`.

    Depths that are zero, negative, nan, inf or more than `FARTHEST_M` are invalid. `area_px`: measured area, if known.
    """

    values: np.ndarray
    scale_m: float
    area_px: Optional[Tuple[int, int, int, int]] = None

    @property
    def shape(self):
        """Height and width."""
        return self.values.shape

    def part(self, rows, columns):
        """The values in rows and columns (slices)."""
        return self.values[rows, columns]

    def at(self, u, v):
        """Return the depth, metres, at the pixels in columns u and rows v (arrays of int), and whether it is valid."""
        depth_m = self.values[v, u].astype(float) * self.scale_m
        with np.errstate(invalid='ignore'):  # nan, of which the numpy of Ubuntu 20.04 warns
            return depth_m, (depth_m > 0) & (depth_m <= FARTHEST_M)

    def measured_area(self):
        """Rectangle (x1, y1, x2, y2) of the image without its black border, where registration leaves no depth.

        A border of more than `WIDEST_BORDER` of the width or height is not due to registration: its background is far
        away.
        """
        if self.area_px is not None:
            return self.area_px
        height, width = self.values.shape
        left, right = _black_ends(self.values[::BORDER_STEP].T)
        top, bottom = _black_ends(self.values[:, ::BORDER_STEP])
        return left, top, width - right, height - bottom


def _black_ends(lines):
    """Number of lines without depth at both ends of an array (lines, pixels); 0 if there are more than the widest."""
    widest = int(WIDEST_BORDER * len(lines))
    with np.errstate(invalid='ignore'):  # nan
        return [int(np.logical_or.reduce(end > 0, axis=1).argmax())
                for end in (lines[:widest + 1], lines[:-widest - 2:-1])]
