"""Walls in the grid of a depth image: vertical planes that are wider than people.

Convention: `rays` are viewing rays (right, ahead, up) at depth 1 m, relative to the floor. On a plane, inverse depth is
a linear function of the ray, its `gradient` (3,), and the noise of stereo is uniform in it.
"""
from typing import NamedTuple

import numpy as np

MAX_WALLS, HYPOTHESES, SAMPLES = 4, 80, 500  # of planes, pairs of points tried for each, and points
LOW_M, HIGH_M = 0.3, 2.6  # above the floor, of these points: above skirting boards, below ceilings
MIN_POINTS = 12  # on a wall
STEREO_NOISE_PER_M = 0.0034  # depth noise is this * depth**2; Intel RealSense D435: 0.065 px at 19 px*m
NOISE = 2.5 * STEREO_NOISE_PER_M  # in inverse depth, of points on a wall
BUMP_M = 0.03  # further distance of points from a wall: plaster, posters
BEHIND_M = 0.3  # what is nearer behind a wall is noise: there is no room for a person
MAX_LEAN = 0.1  # of a wall, radians: the floor may be that wrong
BIN_M, MIN_BINS, BINS = 0.1, 15, 200  # along a wall; people, also those with stretched arms, are narrower than 1.5 m
SMALL_GAP, MAX_GAP = 3, 8  # bins without points of the sample, and bins that people hide
SEEN_THROUGH = 0.15  # points behind a bin for each one on it: above a cupboard there are more
LEAST = 0.05  # 1/m: what is farther than 20 m is no wall

# The same random numbers serve for all images.
_RANDOM = np.random.RandomState(0)
SAMPLE, PAIRS = _RANDOM.rand(SAMPLES), _RANDOM.rand(MAX_WALLS, 2, HYPOTHESES)


class Wall(NamedTuple):
    """The gradient of a plane, and which bins along it, from the point nearest to the camera, are a wall (BINS,)."""

    gradient: np.ndarray
    filled: np.ndarray


def is_wall(rays, depth_m, height_m):
    """Which points (n,) are on a wall, from their rays (3, n), depths and heights above the floor, all float32."""
    usable = np.flatnonzero((height_m > LOW_M) & (height_m < HIGH_M))
    result = np.zeros(len(depth_m), bool)
    if len(usable) < SAMPLES // 4:
        return result
    inverse = 1 / depth_m
    sample = usable[(SAMPLE * len(usable)).astype(int)]
    for wall in find_walls(rays[:, sample], inverse[sample]):
        predicted = wall.gradient.dot(rays)
        steep = np.hypot(*wall.gradient[:2])
        before = inverse - predicted
        near = np.flatnonzero((before < NOISE + BUMP_M * steep * inverse) & (before > -BEHIND_M * steep * inverse)
                              & (predicted > LEAST))
        result[near] |= wall.filled[_bins(wall.gradient, rays[:, near], predicted[near])]
    return result


def find_walls(rays, inverse):
    """Walls through a sample of points, from their rays (3, n) and inverse depths (n,), by RANSAC; a list of Wall."""
    walls, everything = [], (rays, inverse)  # also of other walls, which may be behind
    for pairs in PAIRS:
        if len(inverse) < MIN_POINTS:
            break
        gradients = _through(rays, inverse, (pairs * len(inverse)).astype(int))
        voters = rays[:2, ::2], inverse[::2]  # half of the points: they take most of the time
        votes = np.abs(voters[1] - gradients.dot(voters[0])) < _tolerance(gradients, voters[1])
        gradient = gradients[np.count_nonzero(votes, axis=1).argmax()]
        on = np.abs(inverse - gradient.dot(rays[:2])) < _tolerance(gradient[None], inverse)[0]
        if np.count_nonzero(on) < MIN_POINTS:
            break
        gradient, refined = _refined(rays, inverse, on)
        wall = Wall(gradient, _filled(gradient, rays, inverse, everything))
        if wall.filled.any():
            walls.append(wall)
        rays, inverse = rays[:, ~(on | refined)], inverse[~(on | refined)]
    return walls


def _through(rays, inverse, pairs):
    """Gradients (k, 2) of the vertical planes through pairs of points (2, k)."""
    (a, c), (b, d) = rays[:2, pairs].astype(float)
    one, other = inverse[pairs]
    determinant = a * d - b * c
    determinant[np.abs(determinant) < 0.01] = np.inf  # two points above each other: no plane
    gradients = np.stack(((d * one - b * other) / determinant, (a * other - c * one) / determinant), axis=1)
    return gradients.astype(np.float32)


def _tolerance(gradients, inverse):
    """Largest deviation (k, n) of inverse depths (n,) from planes (k, 2)."""
    return NOISE + BUMP_M * np.hypot(gradients[:, :1], gradients[:, 1:2]) * inverse


def _refined(rays, inverse, on):
    """Fit a plane to the points of a mask (n,) by least squares. Returns its gradient, and the mask of those on it."""
    for _ in range(2):
        near = rays[:, on].astype(float)
        products, values = near.dot(near.T), near.dot(inverse[on])
        products[2, 2] += 1e-6  # the least change of a vertical plane, if all points have the same height
        gradient = np.linalg.solve(products, values)
        if abs(gradient[2]) > MAX_LEAN * np.hypot(*gradient[:2]):
            gradient = np.append(np.linalg.solve(products[:2, :2], values[:2]), 0)
        gradient = gradient.astype(np.float32)
        refined = np.abs(inverse - gradient.dot(rays)) < _tolerance(gradient[None], inverse)[0]
        if np.count_nonzero(refined) < MIN_POINTS:
            break
        on = refined
    return gradient, on


def _bins(gradient, rays, predicted):
    """Numbers (n,) of the bins along a plane that rays (3, n) meet."""
    across = (gradient[1] * rays[0] - gradient[0] * rays[1]) / (np.hypot(*gradient[:2]) * BIN_M)
    return (across / predicted + BINS // 2).clip(0, BINS - 1).astype(int)


def _counts(gradient, rays, inverse):
    """Numbers of points on, behind and before each bin along a plane, 3 x (BINS,)."""
    predicted = gradient.dot(rays)
    ahead = predicted > LEAST
    before, tolerance = (inverse - predicted)[ahead], _tolerance(gradient[None], inverse[ahead])[0]
    bins = _bins(gradient, rays[:, ahead], predicted[ahead])
    return [np.bincount(bins[chosen], minlength=BINS)
            for chosen in (np.abs(before) < tolerance, before < -2 * tolerance, before > tolerance)]


def _filled(gradient, rays, inverse, everything):
    """Which bins along a plane are a wall: long rows of bins with points, behind which little is visible."""
    on = _counts(gradient, rays, inverse)[0]
    _on, behind, nearer = _counts(gradient, *everything)
    filled = (on > 0) & (behind <= SEEN_THROUGH * on)
    for start, end in _runs(~filled):
        is_hidden = end - start <= SMALL_GAP or end - start <= MAX_GAP and nearer[start:end].any()
        filled[start:end] = 0 < start and end < BINS and is_hidden and not behind[start:end].any()
    for start, end in _runs(filled):
        filled[start:end] = end - start >= MIN_BINS
    return filled


def _runs(mask):
    """First and last index, exclusive, of each run of True in a mask (n,)."""
    return np.flatnonzero(np.diff(np.hstack((False, mask, False)).astype(np.int8))).reshape(-1, 2).tolist()
