"""Comparison of costmaps with the true positions of people: recall, false cells and trails.

Times are seconds since the start of the scene; positions are (n, 2) in the map, metres.
"""
from typing import NamedTuple

import numpy as np

from ros_3d_bb.camera.camera_model import transform_points

NEAR_M = 0.6  # a lethal cell closer than this to a person is correct
AHEAD_S = 1.0  # also where people will be within this time
STEP_S = 0.1
BODY_M = 0.3  # a person has left a place at this distance
WALKING_MPS = 0.4
TRACKED_M = 0.5  # maximum distance between a person and a matching track
SETTLED_S = 0.3  # from the image of a new track until its marks count: latency of the pipeline and a cycle


class Costmap(NamedTuple):
    """One costmap: its time, which cells (rows along y, columns along x) are lethal, and where it lies."""

    time_s: float
    lethal: np.ndarray
    origin_m: np.ndarray            # (2,), outer corner of the first cell, in the frame of the costmap
    resolution_m: float
    map_from_costmap: np.ndarray    # (4, 4)

    def lethal_m(self):
        """Centres (n, 2) of the lethal cells in the map."""
        rows, columns = np.nonzero(self.lethal)
        places_m = self.origin_m + (np.column_stack((columns, rows)) + 0.5) * self.resolution_m
        return transform_points(self.map_from_costmap, np.column_stack((places_m, np.zeros(len(places_m)))))[:, :2]

    def is_lethal(self, places_m):
        """Whether the cells at places (n, 2) of the map are lethal; a float (n,), NaN outside of the costmap."""
        places_m = np.column_stack((places_m, np.zeros(len(places_m))))
        inside_m = transform_points(np.linalg.inv(self.map_from_costmap), places_m)[:, :2] - self.origin_m
        columns, rows = np.floor(inside_m / self.resolution_m).astype(int).T
        height, width = self.lethal.shape
        found = np.full(len(places_m), np.nan)
        inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
        found[inside] = self.lethal[rows[inside], columns[inside]]
        return found


class Sighting(NamedTuple):
    """What one image shows: its time, which people (n,) are visible, and the published tracks (m, 2)."""

    time_s: float
    visible: np.ndarray
    tracks_m: np.ndarray


def score_costmaps(costmaps, sightings, positions_at):
    """Score the costmaps of a scene. `positions_at` is a function that returns true positions (n, 2) at a time.

    A person counts `SETTLED_S` after a track was within `TRACKED_M`, until the next image in which the person is not
    visible. Returns a dictionary: `recall`, the share of tracked people whose centre is lethal; `false_cells`, the
    share of lethal cells more than `NEAR_M` from any person now and in the next `AHEAD_S`; `trail_p95_s`, how long
    places stay lethal after a walking person has left them; and the numbers that they are shares of. None where nothing
    was counted.
    """
    hits = _hits(costmaps, _counted(sightings, positions_at), positions_at)
    false = [_is_false(costmap, positions_at) for costmap in costmaps]
    trails_s = _trails_s(costmaps, positions_at)
    lethal, wrong = sum(len(cells) for cells in false), sum(int(cells.sum()) for cells in false)
    return {'costmaps': len(costmaps), 'people': len(hits), 'recall': float(np.mean(hits)) if len(hits) else None,
            'lethal_cells': lethal, 'false_cells': wrong / lethal if lethal else None,
            'trails': len(trails_s), 'trail_p95_s': float(np.percentile(trails_s, 95)) if len(trails_s) else None}


def _counted(sightings, positions_at):
    """Times, and which people (n,) count at each."""
    rows, since_s = [], np.inf
    for sighting in sightings:
        people_m = positions_at(sighting.time_s)
        off_m = np.linalg.norm(people_m[:, None] - sighting.tracks_m.reshape(1, -1, 2), axis=2)
        first_s = np.where((off_m < TRACKED_M).any(axis=1), sighting.time_s, np.inf)
        since_s = np.where(sighting.visible, np.minimum(since_s, first_s), np.inf)
        rows.append(sighting.time_s - since_s >= SETTLED_S)
    return np.array([sighting.time_s for sighting in sightings]), rows


def _hits(costmaps, counted, positions_at):
    """Whether each counted person's centre is lethal, over all costmaps."""
    times_s, rows = counted
    hits = [np.zeros(0)]
    for costmap in costmaps:
        number = np.searchsorted(times_s, costmap.time_s, side='right') - 1
        if number >= 0:
            hits.append(costmap.is_lethal(positions_at(costmap.time_s)[rows[number]]))
    hits = np.concatenate(hits)
    return hits[~np.isnan(hits)]


def _is_false(costmap, positions_at):
    """Whether each lethal cell is far from everybody now and soon."""
    cells_m = costmap.lethal_m()
    nearest_m = np.full(len(cells_m), np.inf)
    for ahead_s in np.arange(0, AHEAD_S + STEP_S / 2, STEP_S):
        for person_m in positions_at(costmap.time_s + ahead_s):
            nearest_m = np.minimum(nearest_m, np.linalg.norm(cells_m - person_m, axis=1))
    return nearest_m > NEAR_M


def _trails_s(costmaps, positions_at):
    """How long lethal places stay lethal after a walking person has left them.

    Places that another person comes near, or that the person returns to, are not counted.
    """
    times_s = np.array([costmap.time_s for costmap in costmaps])
    trails_s = []
    for costmap, start_s in zip(costmaps, times_s):
        people_m = positions_at(start_s)
        speeds_mps = np.linalg.norm(positions_at(start_s + STEP_S) - people_m, axis=1) / STEP_S
        for person in np.flatnonzero((speeds_mps > WALKING_MPS) & (costmap.is_lethal(people_m) == 1)):
            gone_s = start_s + BODY_M / speeds_mps[person]
            later = costmaps[np.searchsorted(times_s, gone_s):]
            lasted_s = _lasted_s(later, people_m[person], person, gone_s, positions_at)
            if lasted_s is not None:
                trails_s.append(lasted_s)
    return trails_s


def _lasted_s(costmaps, place_m, person, gone_s, positions_at):
    """How long after `gone_s` a place stays lethal; None if a person comes near or the scene ends before."""
    lasted_s = 0.0
    for costmap in costmaps:
        lethal, = costmap.is_lethal(place_m[None])
        if lethal == 0:
            return lasted_s
        off_m = np.linalg.norm(positions_at(costmap.time_s) - place_m, axis=1)
        limits_m = np.where(np.arange(len(off_m)) == person, BODY_M, NEAR_M)
        if np.isnan(lethal) or (off_m < limits_m).any():
            return None
        lasted_s = costmap.time_s - gone_s
    return None
