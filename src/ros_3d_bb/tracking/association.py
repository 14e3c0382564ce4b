"""Which detection belongs to which track."""
import numpy as np
from scipy.optimize import linear_sum_assignment


def match_greedily(distances):
    """Pair rows with columns, nearest pair first, each at most once (thesis 3.6).

    Parameters
    ----------
    distances : array_like, (n, m)

    Returns
    -------
    list of (int, int)
        min(n, m) pairs (row, column), nearest first; ties by row, then column.
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
    """Distances (n, m) between points (n, 3) and (m, 3) seen from above, in the x-y plane, metres."""
    difference = np.asarray(positions, float)[:, None, :2] - np.asarray(others, float)[None, :, :2]
    return np.linalg.norm(difference, axis=2)


def assign(costs):
    """Pair rows with columns so that as many pairs as can be are made and the sum of their costs is least.

    Parameters
    ----------
    costs : array_like, (n, m)
        inf where a pair is not allowed.

    Returns
    -------
    list of (int, int)
        Pairs (row, column).
    """
    costs = np.asarray(costs, float)
    allowed = np.isfinite(costs)
    if not allowed.any():
        return []
    forbidden = 1e6 + np.abs(costs[allowed]).sum()
    pairs = zip(*linear_sum_assignment(np.where(allowed, costs, forbidden)))
    return [(int(row), int(column)) for row, column in pairs if allowed[row, column]]


def remaining(count, numbers):
    """The numbers (k,) below `count` that are not among `numbers`, in order."""
    left = np.ones(count, bool)
    left[numbers] = False
    return np.flatnonzero(left)
