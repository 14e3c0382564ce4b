"""Walls in the grid of a depth image: vertical planes that are wider than people.

Seen from above, by the tangent of the bearing and the inverse distance ahead, a vertical plane is a straight line, and
the noise of stereo is uniform. A histogram of the points in this view is small, so that many lines can be compared.

Convention: `rays` are viewing rays (right, ahead, up) at depth 1 m, relative to the floor. On a plane, inverse depth is
a linear function of the ray, its `gradient` (3,); in the view from above, inverse distance is gradient[0] * tangent +
gradient[1].
"""
from typing import NamedTuple

import numpy as np

LOW_M, HIGH_M = 0.3, 2.6  # above the floor, of the points of walls: above skirting boards, below ceilings
MIN_POINTS, SAMPLES = 12, 300  # on a wall; and points that a plane is fitted to
STEREO_NOISE_PER_M = 0.0034  # depth noise is this * depth**2; Intel RealSense D435: 0.065 px at 19 px*m
NOISE = 2.5 * STEREO_NOISE_PER_M  # in inverse depth, of points on a wall
BUMP_M = 0.03  # further distance of points from a wall: plaster, posters
BEHIND_M = 0.3  # what is nearer behind a wall is noise: there is no room for a person
MAX_LEAN = 0.1  # of a wall, radians: the floor may be that wrong
MIN_WIDTH_M = 1.5  # people, also those with stretched arms, are narrower
SMALL_GAP_M, MAX_GAP_M = 0.3, 0.8  # along a wall, without points, and hidden by people
SEEN_THROUGH = 0.15  # points behind a column for each one on it: above a cupboard there are more
LEAST = 0.05  # 1/m: what is farther than 20 m is no wall
MAX_WALLS = 4
# Of the view from above: widths of its columns, in tangents, and rows, in 1/m, the nearest row, and the widest view.
COLUMN, ROW, NEAREST, WIDEST = 0.02, NOISE, 2.5, 2.0
APART = 4, 12  # columns between two points of a line that is tried
CLOSEST = 0.3  # ahead, m: the bearing of nearer points is undefined


class View(NamedTuple):
    """Points seen from above. `columns` are their tangents (k,); `counts` (rows + 1, k) of the points in each column
    that are farther than a row, of which the last is the nearest.
    """

    columns: np.ndarray
    counts: np.ndarray


def is_wall(rays, depth_m, height_m):
    """Which points (n,) are on a wall, from their rays (3, n), depths and heights above the floor, all float32."""
    result = np.zeros(len(depth_m), bool)
    usable = np.flatnonzero((height_m > LOW_M) & (height_m < HIGH_M) & (rays[1] * depth_m > CLOSEST))
    if len(usable) < MIN_POINTS:
        return result
    inverse, tangent = 1 / depth_m, rays[0] / np.maximum(rays[1], 1e-3)
    view = view_of(tangent[usable], inverse[usable] / rays[1, usable])
    sample = usable[::len(usable) // SAMPLES + 1]
    for gradient, filled in find_walls(view, rays[:, sample], inverse[sample]):
        predicted = _inverse_on(gradient, rays)
        steep = np.hypot(*gradient[:2])
        before = inverse - predicted
        near = np.flatnonzero((before < NOISE + BUMP_M * steep * inverse) & (before > -BEHIND_M * steep * inverse)
                              & (predicted > LEAST))
        columns = np.rint((tangent[near] - view.columns[0]) / COLUMN).astype(int)
        result[near] |= filled.take(columns, mode='clip') & (columns >= 0) & (columns < len(filled))
    return result


def _inverse_on(gradient, rays):
    """Inverse depths (n,) of a plane on rays (3, n)."""
    right, ahead, up = gradient
    return right * rays[0] + ahead * rays[1] + up * rays[2]


def view_of(tangents, inverse):
    """The View of points (n,) by their tangents and inverse distances ahead."""
    low, high = np.clip((tangents.min(), tangents.max()), -WIDEST, WIDEST)
    columns, rows = int((high - low) / COLUMN) + 1, int(NEAREST / ROW)
    column = ((tangents - low) / COLUMN).astype(int).clip(0, columns - 1)
    row = np.minimum(inverse / ROW, rows - 1).astype(int)
    counts = np.zeros((rows + 1, columns), np.int32)
    np.cumsum(np.bincount(row * columns + column, minlength=rows * columns).reshape(rows, columns), axis=0,
              out=counts[1:])
    return View((low + COLUMN * (np.arange(columns) + 0.5)).astype(np.float32), counts)


def find_walls(view, rays, inverse):
    """Walls in a View, fitted to a sample of its points by their rays (3, n) and inverse depths (n,).

    Returns a list of gradients (3,) and masks (k,) of the columns of the view that they fill.
    """
    gradients, walls = lines_of(view), []
    free = np.ones((len(gradients), len(view.columns)), bool)  # columns in which a line is on none of the walls
    on, behind, nearer, lengths_m = _columns_on(view, gradients)
    is_filled = _is_filled(on, behind)
    for _ in range(MAX_WALLS):
        widths_m = (lengths_m * (is_filled & free)).sum(axis=1)
        if not (widths_m >= MIN_WIDTH_M).any():
            break
        best = widths_m.argmax()
        gradient = _refined(rays, inverse, gradients[best])
        filled = _without_gaps(*_columns_on(view, gradient[None, :2]))
        if filled.any():
            walls.append((gradient, filled))
        for line in (gradient, gradients[best]):
            place = line[0] * view.columns + line[1]
            distance = np.abs(gradients[:, :1] * view.columns + gradients[:, 1:] - place)
            free &= distance > 3 * _tolerance(line[None], place)
    return walls


def lines_of(view):
    """Gradients (m, 2) of lines through the commonest inverse distances of two columns of a View."""
    counts = np.diff(view.counts, axis=0)
    rows = counts.argmax(axis=0)
    is_used = counts[rows, np.arange(len(rows))] >= 2
    place, gradients = (rows + 0.5) * ROW, []
    for apart in APART:
        slopes = (place[apart:] - place[:-apart]) / (apart * COLUMN)
        lines = np.stack((slopes, place[:-apart] - slopes * view.columns[:-apart]), axis=1)
        gradients.append(lines[is_used[apart:] & is_used[:-apart]])
    return np.concatenate(gradients)


def _tolerance(gradients, inverse):
    return NOISE + BUMP_M * np.hypot(gradients[:, :1], gradients[:, 1:2]) * inverse


def _columns_on(view, gradients):
    """Numbers of points on, behind and before lines (m, 2) in each column of a View, and the lengths of the lines in
    it, m, 4 x (m, k)."""
    place = gradients[:, :1] * view.columns + gradients[:, 1:2]
    is_ahead = (place > LEAST) & (place < NEAREST)
    place = place.clip(LEAST, NEAREST)
    rows, tolerance = place / ROW + 0.5, _tolerance(gradients, place) / ROW
    columns, last = np.arange(len(view.columns)), len(view.counts) - 1

    def farther(rows):
        """Numbers (m, k) of points farther than these rows."""
        return view.counts.take(rows.clip(0, last).astype(int) * len(columns) + columns)

    behind, before, after = farther(rows - 2 * tolerance), farther(rows - tolerance), farther(rows + tolerance)
    lengths_m = np.hypot(gradients[:, :1], gradients[:, 1:2]) * COLUMN / (place * place)
    return (after - before) * is_ahead, behind, view.counts[-1] - after, np.minimum(lengths_m, SMALL_GAP_M)


def _is_filled(on, behind):
    return (on > 0) & (behind <= SEEN_THROUGH * on)


def _refined(rays, inverse, gradient):
    """Fit a plane to the points near a gradient (2,) by least squares. Returns its gradient (3,), float32."""
    gradient = np.append(gradient, 0).astype(np.float32)
    for factor in (2, 1):
        on = np.abs(inverse - _inverse_on(gradient, rays)) < factor * _tolerance(gradient[None], inverse)[0]
        if np.count_nonzero(on) < MIN_POINTS:
            break
        near = rays[:, on].astype(float)
        products, values = near.dot(near.T), near.dot(inverse[on])
        products[2, 2] += 1e-6  # the least change of a vertical plane, if all points have the same height
        fitted = np.linalg.solve(products, values)
        if abs(fitted[2]) > MAX_LEAN * np.hypot(*fitted[:2]):
            fitted = np.append(np.linalg.solve(products[:2, :2], values[:2]), 0)
        gradient = fitted.astype(np.float32)
    return gradient


def _without_gaps(on, behind, nearer, lengths_m):
    """Which columns (k,) a line fills: long rows of columns with points, behind which little is visible."""
    on, behind, nearer, lengths_m = on[0], behind[0], nearer[0], lengths_m[0]
    filled = _is_filled(on, behind)
    for start, end in _runs(~filled):
        gap_m = lengths_m[start:end].sum()
        is_hidden = gap_m <= SMALL_GAP_M or gap_m <= MAX_GAP_M and nearer[start:end].any()
        filled[start:end] = 0 < start and end < len(filled) and is_hidden and not behind[start:end].any()
    for start, end in _runs(filled):
        filled[start:end] = lengths_m[start:end].sum() >= MIN_WIDTH_M
    return filled


def _runs(mask):
    """First and last index, exclusive, of each run of True in a mask (n,)."""
    return np.flatnonzero(np.diff(np.hstack((False, mask, False)).astype(np.int8))).reshape(-1, 2).tolist()
