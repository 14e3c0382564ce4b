"""Colours of people's clothes: of the upper and of the lower body, in the depth layer of the person only.

The appearance of a person is a tuple of six numbers, 0 where they are unknown: for the upper and for the lower body,
the medians of the logarithms of red / green and of blue / green, and of the brightness. Ratios of colours depend little
on how bright the light is. Each part lies at a fixed distance below the head, which is known unless the image border
truncates it: pixels of what hides the body, or is behind it, are at other depths.
"""
import numpy as np

# All are chosen.
PARTS_M = (0.30, 0.75), (0.95, 1.40)  # distances below the head: between neck and waist, and between hip and ankle
LAYER_M = 0.35  # half the depth of the layer of a body
COLUMNS, ROWS = 24, 48  # minimum number of samples in a larger box
LEAST_SAMPLES = 25  # of a part
DARKEST = 8.0  # added to 8-bit colours: those of dark pixels are mostly noise
UNKNOWN = (0.0,) * 3  # no brightness is 0
TOP = 1  # of Box3D.truncated_edges


def appearance_of(box, color, depth, camera):
    """The appearance of the person in a Box3D, given an RGB image (height, width, 3) and the DepthImage of the same
    pixels; None if both parts are unknown."""
    x1, y1, x2, y2 = box.rect_px
    columns, rows = _steps(x1, x2, camera.width, COLUMNS), _steps(y1, y2, camera.height, ROWS)
    if box.truncated_edges[TOP] or columns.start >= columns.stop or rows.start >= rows.stop:
        return None
    distance_m, color = float(box.center_m[2]), color[rows, columns]
    with np.errstate(invalid='ignore'):  # nan
        is_person = np.abs(depth.part(rows, columns) * depth.scale_m - distance_m) < LAYER_M
    below_m = (np.arange(rows.start, rows.stop, rows.step) - y1) * distance_m / camera.fy
    parts = ()
    for start_m, end_m in PARTS_M:
        in_part = (below_m > start_m) & (below_m < end_m)
        pixels = color[in_part][is_person[in_part]]
        parts += _colors(pixels) if len(pixels) >= LEAST_SAMPLES else UNKNOWN
    return parts if any(parts) else None


def _steps(start, end, size, count):
    """A slice of at least `count` pixels between two edges, as far as they are inside the image."""
    start, end = max(start, 0), min(end, size)
    return slice(start, end, max((end - start) // count, 1))


def _colors(pixels):
    red, green, blue = np.log(pixels.T + DARKEST)
    return tuple(np.median((red - green, blue - green, (red + green + blue) / 3), axis=1).tolist())
