"""Data association: assign the detections of an image to tracks."""
import numpy as np
from scipy.optimize import linear_sum_assignment

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking import kalman_filter

RECENT_NS = 7 * NS // 10  # tracks matched less than this ago are associated before the others
UNSURE_SHARE = 0.1  # upper bound of the new-target density, relative to the peak density of the detection
HEAD_SIGMAS = 2.0  # standard deviation of the head top relative to that of the height: the camera tilts during driving
HIDDEN_FEET_COST = 4.0  # cost of a box whose top matches but whose height does not: its lower part is occluded


def associate(tracks, measurements, stamp_ns, params, classes):
    """Assign measurements to tracks (arrays of TRACK and MEASUREMENT) in a cascade: recently matched, then missed, then
    tentative tracks. Returns the rows of the tracks and the columns of the measurements of the pairs.

    A pair is allowed only if the track explains the detection better than a new target does, and both have the same
    group of classes (ClassNumbers).
    """
    cost = kalman_filter.negative_log_likelihood(tracks['mean'], tracks['covariance'], measurements, params)
    cost += _height_cost(tracks, measurements, params.height_sigma)
    # An uncertain detection fits a new target and a track about equally well; the track takes precedence.
    noise_m2 = measurements['noise_m2']
    determinant = noise_m2[:, 0, 0] * noise_m2[:, 1, 1] - noise_m2[:, 0, 1] * noise_m2[:, 1, 0]
    largest_density = 1 / (2 * np.pi * np.sqrt(determinant))
    density = np.minimum(params.new_target_density, UNSURE_SHARE * largest_density)
    cost[cost >= -np.log(density)] = np.inf
    cost[classes.group[tracks['class_number']][:, None] != classes.group[measurements['class_number']]] = np.inf
    is_missed = stamp_ns - tracks['last_ns'] >= RECENT_NS
    priority = np.where(tracks['confirmed'], is_missed.astype(int), 2)
    pairs, free = [np.zeros((2, 0), int)], np.arange(cost.shape[1])
    for rank in sorted(set(priority.tolist())):
        candidates = (priority == rank).nonzero()[0]
        rows, columns = assign(cost[candidates[:, None], free])
        pairs.append((candidates[rows], free[columns]))
        free = free[unmatched(len(free), columns)]
    return np.concatenate(pairs, axis=1)


def _height_cost(tracks, measurements, sigma_m):
    """Association cost (n, m) of the height differences: their negative log likelihood, 0 for the same height.

    The height is unknown if the image border truncates the box, or has truncated all previous boxes of the track. The
    tops of the heads are then compared if both are known; otherwise the cost is 0. Where the height is known, the cost
    is at most that of the tops plus `HIDDEN_FEET_COST`, because furniture occludes only the lower part of a body.
    """
    seen, cut = tracks['end_hits'] > 0, measurements['cut_ends']
    cost = ((tracks['size_m'][:, 2:] - measurements['size_m'][:, 2]) / sigma_m) ** 2 / 2
    tops_m = tracks['z_m'] + tracks['size_m'][:, 2] / 2, measurements['z_m'] + measurements['size_m'][:, 2] / 2
    top_cost = ((tops_m[0][:, None] - tops_m[1]) / (HEAD_SIGMAS * sigma_m)) ** 2 / 2
    top_cost[~(seen[:, 1:] & ~cut[:, 1])] = 0
    heights_known = seen.all(axis=1)[:, None] & ~cut.any(axis=1)
    return np.where(heights_known, np.minimum(cost, top_cost + HIDDEN_FEET_COST), top_cost)


def match_greedily(distances):
    """Pair rows with columns of `distances` (n, m) greedily (thesis 3.6). Each row and column is used at most once.

    Returns a list of min(n, m) pairs (row, column) by increasing distance; ties are ordered by row, then column.
    """
    distances = np.asarray(distances, float)
    pairs, rows, columns = [], set(), set()
    for row, column in zip(*np.unravel_index(np.argsort(distances, axis=None, kind='mergesort'), distances.shape)):
        if row not in rows and column not in columns:
            pairs.append((int(row), int(column)))
            rows.add(row)
            columns.add(column)
    return pairs


def plane_distances(positions, others):
    """Distances (n, m) in the x-y plane between points (n, 3) and (m, 3), metres."""
    difference = np.asarray(positions, float)[:, None, :2] - np.asarray(others, float)[None, :, :2]
    return np.linalg.norm(difference, axis=2)


def assign(costs):
    """Rows and columns (k,) of the maximum number of allowed pairs with the minimum total cost; `costs` (n, m) are inf
    for pairs that are not allowed.
    """
    allowed = np.isfinite(costs)
    forbidden = 1e6 + np.abs(costs[allowed]).sum()
    rows, columns = linear_sum_assignment(np.where(allowed, costs, forbidden))
    is_allowed = allowed[rows, columns]
    return rows[is_allowed], columns[is_allowed]


def unmatched(count, matched):
    """Indices (k,) below `count` that are not in `matched`, in increasing order. Faster than np.setdiff1d."""
    is_unmatched = np.ones(count, bool)
    is_unmatched[matched] = False
    return is_unmatched.nonzero()[0]
