"""Matching of tracks and detections with the ground truth."""
import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist


def plane_distances(positions, others):
    """Distances (n, m) in the x-y plane between points (n, 3) and (m, 3), metres."""
    return cdist(np.asarray(positions, float)[:, :2], np.asarray(others, float)[:, :2])


def assign(costs):
    """Rows and columns (k,) of the maximum number of allowed pairs with the minimum total cost; `costs` (n, m) are inf
    for pairs that are not allowed.
    """
    allowed = np.isfinite(costs)
    forbidden = 1e6 + np.abs(costs[allowed]).sum()
    rows, columns = linear_sum_assignment(np.where(allowed, costs, forbidden))
    is_allowed = allowed[rows, columns]
    return rows[is_allowed], columns[is_allowed]
