"""Matching of tracks and detections with the ground truth."""
import numpy as np
from scipy.optimize import linear_sum_assignment


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
