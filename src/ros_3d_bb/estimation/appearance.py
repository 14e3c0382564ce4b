"""Colours of people's clothes: of the upper and of the lower body, in the depth layer of the person only.

The appearance of a person is a tuple of six numbers, 0 where they are unknown: for the upper and for the lower body,
the medians of the logarithms of red / green and of blue / green, and of the brightness. Ratios of colours depend little
on how bright the light is. Each part lies at a fixed distance below the head, which is known unless the image border
truncates it: pixels of what hides the body, or is behind it, are at other depths.
"""
from typing import Optional, Tuple

import numpy as np

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.estimation.box3d import Box3D
from ros_3d_bb.estimation.depth_samples import BODY_HALF_DEPTH_MM, grid_in

# Distances below the head: between shoulders and hips, and between hips and ankles. These are 0.182, 0.470 and 0.961 of
# the height below the head (Drillis and Contini, Body Segment Parameters, 1966): 0.31, 0.80 and 1.63 m of 1.7 m.
PARTS_M = (0.30, 0.75), (0.95, 1.40)
LEAST_SAMPLES = 25  # of a part: the standard deviation of their median is a quarter of theirs (1.25 / sqrt(25))
DARKEST = 8.0  # added to 8-bit colours: those of dark pixels are mostly noise


def appearance_of(box: Box3D, color: np.ndarray, depth: DepthImage, camera: Camera) -> Optional[Tuple[float, ...]]:
    """The appearance of the person in a Box3D, given an RGB image (height, width, 3) and the DepthImage of the same
    pixels; None if both parts are unknown, and in grey images, as of an infrared camera: all clothes are alike there.
    """
    rows, columns = grid_in(box.rect_px, depth.shape)
    _left, is_head_cut, _right, _bottom = box.truncated_edges
    if is_head_cut or rows.start >= rows.stop or columns.start >= columns.stop:
        return None
    distance_m, color = float(box.center_m[2]), color[rows, columns]
    if (color == color[..., :1]).all():
        return None
    with np.errstate(invalid='ignore'):  # nan
        is_person = np.abs(depth.part(rows, columns) * depth.scale_m - distance_m) < BODY_HALF_DEPTH_MM / 1000.0
    below_m = (np.arange(rows.start, rows.stop, rows.step) - box.rect_px[1]) * distance_m / camera.fy
    parts: Tuple[float, ...] = ()
    for start_m, end_m in PARTS_M:
        in_part = (below_m > start_m) & (below_m < end_m)
        parts += _colors(color[in_part][is_person[in_part]])
    return parts if any(parts) else None


def _colors(pixels: np.ndarray) -> Tuple[float, ...]:
    if len(pixels) < LEAST_SAMPLES:
        return 0.0, 0.0, 0.0
    red, green, blue = np.log(pixels.T + DARKEST)
    return tuple(np.median((red - green, blue - green, (red + green + blue) / 3), axis=1).tolist())
