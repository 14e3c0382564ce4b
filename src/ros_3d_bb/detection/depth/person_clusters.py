"""Person-sized clusters of depth pixels above the floor.

Convention: clusters are found on a subsampled grid of the depth image. The cell (row, column) covers the pixel rows
[step * row, step * (row + 1)) and the pixel columns [step * column, step * (column + 1)).
"""
import functools
from typing import Any, NamedTuple

import cv2
import numpy as np

from ros_3d_bb.core.params import Param, parameters
from ros_3d_bb.detection.depth.walls import NOISE, is_wall

CELL_RAD = 0.0065  # of the grid of depth pixels that are used: 4 pixels of a RealSense at 640x480
FLOOR_M, CEILING_M = 0.12, 2.15  # what is lower above the floor is floor, what is higher is ceiling
# A step in depth of STEP_M + STEP_GROWTH_PER_M * depth^2, which grows as the error of stereo, separates two surfaces.
STEP_M, STEP_GROWTH_PER_M = 0.08, 0.006
MIN_WIDTH_M, MAX_WIDTH_M = 0.2, 1.15  # of a person; the largest with the arms stretched out
MAX_THICKNESS_M = 0.9  # along the line of sight: a long stride
MAX_TOP_M, MAX_BOTTOM_M = 2.1, 0.8  # above the floor: of the head, and of the lowest visible part; legs may be hidden
MIN_VISIBLE_M = 0.9  # height of the visible part of a standing person whose head is in the image
MIN_CELLS = 20  # smaller clusters are ignored; a person 6 m away has about 300 cells
HEADROOM_M = 0.15  # minimum depth of the valley between the heads of two people side by side
BORDER_M = 0.15  # of a body, that may be below it in the image and not belong to the blob
SIDE_M = 0.2  # of the legs beside the trunk
HIP_M = 0.95  # lower peaks do not count: in an image cut above the hips, the legs of one person form a valley, too
# Smallest height of the top and of the visible part of a person who crouches or bends, the latter also where the image
# ends below the head; chosen.
LOW_TOP_M, LOW_VISIBLE_M = 0.7, 0.5
# Smallest width and height, and smallest height of the top, of the visible part of a person whom someone hides; chosen:
# the place of legs alone is not that of the trunk.
PART_WIDTH_M, PART_VISIBLE_M, PART_TOP_M = 0.1, 0.25, 1.0
TWO_LAYERS = 0.7  # between-class share of the variance of two depth layers; 0.64 for noise, 0.75 for a slanted wall


@parameters('Detector depth')
class DepthPeopleParams(NamedTuple):
    """What counts as a person, who may be smaller if cut by the image border, and limits of a fitted floor."""

    min_depth: float = Param(0.4, 'Nearest person, along the optical axis.', 'm', live=(0, 3))
    max_depth: float = Param(
        6.5, 'Farthest person. Farther away a person is too few pixels and too much noise.', 'm', live=(1, 15))
    min_top: float = Param(
        1.25, 'Smallest height of the top of the head above the floor. Children and people who sit are lower.', 'm',
        limits=(0, MAX_TOP_M), live=(0.5, 1.8))
    min_camera_height: float = Param(
        0.08, 'Smallest height of the camera above a floor that is fitted to the depth image, where tf gives none.',
        'm', live=(0, 2))
    max_camera_height: float = Param(3.2, 'Largest height of the camera above a fitted floor.', 'm', live=(0.2, 5))
    max_camera_tilt: float = Param(
        1.1, 'Largest angle by which the camera looks down on a fitted floor; 63 degrees.', 'rad',
        limits=(0.1, 1.4), live=(0.1, 1.4))
    min_score: float = Param(
        0.7, 'Smallest score, 0 to 1, of shape and HOG together. Lower values detect more people, and more '
        'false ones.', live=(0, 1))


class Grid(NamedTuple):
    """Depth image sampled every `step` pixels. Arrays are (rows, columns), float32, metres."""

    depth_m: np.ndarray  # 0 where it is unknown
    height_m: np.ndarray  # above the floor
    ahead_m: np.ndarray  # along the floor: constant over an upright surface, even if the camera is tilted
    rays: Any  # to the right, ahead and up, along and above the floor, at a depth of 1 m
    step: int
    ends: Any  # first and last column with depth (2,), and of each column the first and last row with depth


class Blob(NamedTuple):
    """Connected cells: `mask` (rows, columns), whose first cell is (row, column) of the grid."""

    row: int
    column: int
    mask: np.ndarray

    def of(self, values):
        """Values (n,) of a grid array in the cells of the blob."""
        return self.window(values)[self.mask]

    def window(self, values):
        """View of a grid array in the bounding rectangle of the blob, of the shape of `mask`."""
        rows, columns = self.mask.shape
        return values[self.row:self.row + rows, self.column:self.column + columns]


class Shape(NamedTuple):
    """Size of a blob, heights above the floor, and the image borders that cut it."""

    depth_m: float
    cell_m: float  # width of a cell at this depth
    width_m: float
    thickness_m: float
    bottom_m: float
    top_m: float
    cut_top: bool
    cut_bottom: bool
    cut_side: bool


def grid_of(depth, camera, floor, params):
    step = max(1, int(round(CELL_RAD * camera.fx)))
    values = depth.part(slice(step // 2, None, step), slice(step // 2, None, step))
    depth_m = values.astype(np.float32) * np.float32(depth.scale_m)
    with np.errstate(invalid='ignore'):  # nan
        depth_m[~((depth_m > params.min_depth) & (depth_m < 100))] = 0
    rays = _rays(camera, step, *floor.normal.tolist())
    return Grid(depth_m, depth_m * rays[2] + np.float32(floor.offset_m), depth_m * rays[1], rays, step,
                _ends(depth_m > 0))


def _ends(valid):
    """First and last column of a grid with depth, and of each column the first and last row with depth."""
    columns = np.flatnonzero(valid.any(axis=0))
    sides = columns[[0, -1]] if len(columns) else (0, 0)
    return sides, valid.argmax(axis=0), len(valid) - 1 - valid[::-1].argmax(axis=0)


@functools.lru_cache(maxsize=8)  # undistortion takes longer than the rest
def _camera_rays(camera, step):
    return camera.rays(np.arange(step // 2, camera.width, step), np.arange(step // 2, camera.height, step)[:, None])


@functools.lru_cache(maxsize=8)  # a floor that is known from tf seldom changes
def _rays(camera, step, *normal):
    """Viewing rays (3, rows, columns) of the cells of a grid: to the right, ahead and up, given the normal of the
    floor."""
    x, y = _camera_rays(camera, step)
    ahead = np.array([0, 0, 1]) - normal[2] * np.array(normal)
    ahead /= np.linalg.norm(ahead)
    return np.stack([np.float32(axis[0] * x + axis[1] * y + axis[2])
                     for axis in (np.cross(ahead, normal), ahead, normal)])


def find_person_clusters(grid, camera, params):
    """Return (Blob, Shape) of each blob of human size, of people who crouch, too, and of parts of people."""
    clusters = _merge_stacked(_split_blobs(grid, camera, params), grid, camera)
    return [(blob, shape) for blob, shape in clusters
            if shape.depth_m < params.max_depth and (is_human(shape) or _is_part(shape))]


def max_step(depth_m):
    """Largest difference of depth, metres, between neighbouring cells of one surface."""
    return STEP_M + STEP_GROWTH_PER_M * depth_m ** 2


def _foreground_cells(grid, params):
    """Cells between floor and ceiling, off the walls, that no depth step crosses, (rows, columns) bool.

    They reach as much beyond `max_depth` as the noise of the farthest person, who would otherwise be in pieces.

    Of two cells at a depth step the farther one is removed. This separates the surfaces and keeps the outline of the
    nearer one. The threshold grows with the square of depth, like the error of stereo.
    """
    depth_m = grid.depth_m
    cells = (depth_m > 0) & (grid.height_m > FLOOR_M)
    used = np.flatnonzero(cells)
    cells.ravel()[used] = ~is_wall(grid.rays.reshape(3, -1).take(used, axis=1), depth_m.take(used),
                                   grid.height_m.take(used))
    cells &= (depth_m < params.max_depth + NOISE * params.max_depth ** 2) & (grid.height_m < CEILING_M)
    for after, before in ((np.s_[:, 1:], np.s_[:, :-1]), (np.s_[1:], np.s_[:-1])):
        change_m = depth_m[after] - depth_m[before]
        max_step_m = max_step(np.minimum(depth_m[after], depth_m[before]))
        cells[after] &= change_m <= max_step_m
        cells[before] &= change_m >= -max_step_m
    return cells


def shape_of(blob, grid, camera):
    """Measure a blob. Percentiles replace minima and maxima, because depth noise is unbounded. Returns Shape."""
    rows, columns = blob.mask.shape
    depth_m, ahead_m, height_m = (np.sort(blob.of(values)) for values in (grid.depth_m, grid.ahead_m, grid.height_m))
    last = depth_m.size - 1
    middle = float(depth_m[last // 2])
    rays = grid.rays[0][blob.row + rows // 2, blob.column:blob.column + columns]
    cell_m = middle * float(rays[-1] - rays[0]) / (columns - 1) if columns > 1 else grid.step * middle / camera.fx
    return Shape(middle, cell_m, columns * cell_m, ahead_m[last - last // 20] - ahead_m[last // 20],
                 height_m[last // 100], height_m[last - last // 100], *_cuts(blob, grid, camera, middle))


def _cuts(blob, grid, camera, depth_m):
    """Whether the upper, lower, and a lateral end of a blob is no end of the body.

    No depth is measured beyond such an end up to the border of the image, or the lower one is hidden by something
    nearer.
    """
    rows, columns = blob.mask.shape
    (left, right), first, last = grid.ends
    here, end = slice(blob.column, blob.column + columns), blob.row + rows
    margin = BORDER_M * camera.fy / (grid.step * depth_m)
    top, bottom = blob.mask[:3].any(axis=0), blob.mask[-3:].any(axis=0)
    below_m = grid.depth_m[end:end + 3, here][:, bottom]
    nearer = ((below_m > 0) & (below_m < depth_m - max_step(depth_m))).any(axis=0)
    return (np.mean(first[here][top] >= blob.row - 1) > 0.5,
            np.mean((last[here][bottom] <= end + margin) | nearer) > 0.5,
            blob.column <= left + 1 or blob.column + columns >= right)


def quantile_of(values, share):
    """Quantile of values (n,). np.quantile gives the same in seven times the time."""
    return np.interp(share * (len(values) - 1), np.arange(len(values)), np.sort(values))


def _is_part(shape):
    return (PART_WIDTH_M <= shape.width_m <= MAX_WIDTH_M and shape.thickness_m <= MAX_THICKNESS_M
            and shape.top_m - shape.bottom_m >= PART_VISIBLE_M and PART_TOP_M <= shape.top_m <= MAX_TOP_M)


def is_human(shape):
    """Whether a blob has the size of a whole person, who may stand, crouch, or be cut by the image border."""
    cut = 0.6 if shape.cut_side else 1.0
    return (cut * MIN_WIDTH_M <= shape.width_m <= MAX_WIDTH_M
            and shape.thickness_m <= MAX_THICKNESS_M and shape.top_m - shape.bottom_m >= LOW_VISIBLE_M
            and (shape.cut_top or LOW_TOP_M <= shape.top_m) and shape.top_m <= MAX_TOP_M
            and (shape.cut_bottom or shape.bottom_m <= MAX_BOTTOM_M))


def is_standing(shape, params):
    is_high = shape.top_m >= params.min_top and (shape.cut_bottom or shape.top_m - shape.bottom_m >= MIN_VISIBLE_M)
    return is_human(shape) and (shape.cut_top or is_high)


def _connected(cells, row=0, column=0):
    count, labels, stats, _ = cv2.connectedComponentsWithStats(cells.astype(np.uint8), connectivity=4)
    for label in range(1, count):
        x, y, width, height, size = stats[label].tolist()
        if size >= MIN_CELLS:
            yield Blob(row + y, column + x, labels[y:y + height, x:x + width] == label)


def _may_be_part(blob, grid, camera):
    """Whether a blob has half of the area of the smallest part of a person, at the depth of one of its cells, or the
    image border cuts it.
    """
    (rows, columns), (height, width) = blob.mask.shape, grid.depth_m.shape
    if min(blob.row, blob.column) == 0 or blob.row + rows == height or blob.column + columns == width:
        return True
    depth_m = grid.depth_m[blob.row, blob.column + blob.mask[0].argmax()]
    area_m2 = np.count_nonzero(blob.mask) * (grid.step * depth_m / camera.fx) ** 2
    return area_m2 > PART_WIDTH_M * PART_VISIBLE_M / 2


def _split_blobs(grid, camera, params):
    """Foreground blobs and their shapes; blobs that have two heads or are too large for one person are split."""
    to_split = [(blob, 0) for blob in _connected(_foreground_cells(grid, params)) if _may_be_part(blob, grid, camera)]
    parts = []
    while to_split:
        blob, splits = to_split.pop()
        shape = shape_of(blob, grid, camera)
        trunk = _without_sides(blob, grid, shape)
        if trunk is not blob:
            blob, shape = trunk, shape_of(trunk, grid, camera)
        too_large = shape.width_m > MAX_WIDTH_M or shape.thickness_m > MAX_THICKNESS_M
        pieces = _split_between_heads(blob, grid) if shape.width_m > 2 * MIN_WIDTH_M else []
        if too_large and not pieces:
            pieces = _split_in_depth(blob, grid)
        if pieces and splits < 4:
            to_split.extend((piece, splits + 1) for piece in pieces)
        elif not too_large:
            parts.append((blob, shape))
    return parts


def _without_sides(blob, grid, shape):
    """A blob without what is beside the trunk and lower than the hips, such as a chair beside a person."""
    outline = np.where(blob.mask, blob.window(grid.height_m), 0).max(axis=0)
    trunk = np.flatnonzero(outline > HIP_M)
    if not len(trunk):
        return blob
    margin = int(SIDE_M / shape.cell_m) + 1
    left, right = max(trunk[0] - margin, 0), trunk[-1] + margin + 1
    if left == 0 and right >= blob.mask.shape[1]:
        return blob
    pieces = list(_connected(blob.mask[:, left:right], blob.row, blob.column + left))
    return max(pieces, key=lambda piece: np.count_nonzero(piece.mask), default=blob)


def _split_in_depth(blob, grid):
    """Split a blob into a nearer and a farther part by Otsu's threshold of inverse depth, whose noise is uniform.

    Returns an empty list if the blob has no two layers (such as a straight or slanted wall), because the fragments of a
    noisy wall can have any shape.
    """
    inverse = 1 / blob.of(grid.ahead_m)
    low, high = inverse.min(), inverse.max()
    levels = ((inverse - low) * (255 / max(high - low, 1e-6))).astype(np.uint8)
    near = levels > cv2.threshold(levels.reshape(1, -1), 0, 255, cv2.THRESH_OTSU)[0]
    between = near.mean() * (1 - near.mean()) * (levels[near].mean() - levels[~near].mean()) ** 2 if near.any() else 0
    if between < TWO_LAYERS * levels.var():
        return []
    nearer = np.zeros_like(blob.mask)
    nearer[blob.mask] = near
    return [piece for cells in (nearer, blob.mask & ~nearer) for piece in _connected(cells, blob.row, blob.column)]


def _split_between_heads(blob, grid):
    """Split a blob at the deepest valley of its outline, if both sides rise above the valley by HEADROOM_M."""
    outline = np.where(blob.mask, blob.window(grid.height_m), 0).max(axis=0)
    left, right = np.maximum.accumulate(outline), np.maximum.accumulate(outline[::-1])[::-1]
    peaks = np.minimum(left, right)
    rise = np.where(peaks > HIP_M, peaks - outline, 0)
    valley = int(rise.argmax())
    if rise[valley] < HEADROOM_M:
        return []
    halves = [blob.mask.copy(), blob.mask.copy()]
    halves[0][:, valley:] = False
    halves[1][:, :valley] = False
    return [piece for half in halves for piece in _connected(half, blob.row, blob.column)]


def _merge_stacked(parts, grid, camera):
    """Merge parts at one depth and above each other, such as a person behind the arm of another person."""
    remaining = sorted(parts, key=lambda part: -part[0].mask.size)
    merged = []
    while remaining:
        part, shape = remaining.pop(0)
        blob = part
        for i in range(len(remaining) - 1, -1, -1):
            other, other_shape = remaining[i]
            if _are_stacked(blob, shape, other, other_shape):
                blob = _union(blob, other)
                del remaining[i]
        merged.append((blob, shape if blob is part else shape_of(blob, grid, camera)))
    return merged


def _are_stacked(blob, shape, other, other_shape):
    columns = _overlap(blob.column, blob.mask.shape[1], other.column, other.mask.shape[1])
    rows = _overlap(blob.row, blob.mask.shape[0], other.row, other.mask.shape[0])
    step_m = 0.2 + 2 * STEP_GROWTH_PER_M * shape.depth_m ** 2
    return (columns > 0.5 and rows < 0.6 and abs(shape.depth_m - other_shape.depth_m) < step_m
            and max(shape.top_m, other_shape.top_m) < MAX_TOP_M)


def _overlap(start, length, other_start, other_length):
    """Overlap of two ranges relative to the shorter one; negative if there is a gap."""
    common = min(start + length, other_start + other_length) - max(start, other_start)
    return common / float(min(length, other_length))


def _union(blob, other):
    row, column = min(blob.row, other.row), min(blob.column, other.column)
    mask = np.zeros((max(b.row + b.mask.shape[0] for b in (blob, other)) - row,
                     max(b.column + b.mask.shape[1] for b in (blob, other)) - column), bool)
    for part in (blob, other):
        Blob(part.row - row, part.column - column, part.mask).window(mask)[part.mask] = True
    return Blob(row, column, mask)
