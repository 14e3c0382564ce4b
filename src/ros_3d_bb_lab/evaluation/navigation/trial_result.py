"""Trials of the navigation benchmark: their pace, the inputs of move_base, and the results."""
import collections

import numpy as np

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.types import VISIBLE
from ros_3d_bb_lab.simulation.collision import Rectangle

CELL_M = 0.05
OCCUPIED = 100
STANDING_MPS, DRIVING_MPS = 0.05, 0.15
CONTACT_SPEEDS = 3  # odometry of 60 ms
SHINS_M = 0.15  # radius of a person at the height of a planar laser, both legs


class Pace(object):
    """Limit of the simulated time: `LEAD_S` after the oldest of the newest times heard from several sources.

    A source that is silent for `PATIENCE_S` of the machine's time does not stop the time, but slows it down: move_base
    sends no commands while it plans. `late` counts such steps of `LEAD_S`.
    """

    LEAD_S = 0.2
    PATIENCE_S = 0.5

    def __init__(self):
        self._heard_ns, self._needed, self._limit_ns, self._raised_s = {}, [], None, None
        self.late = 0

    @property
    def sources(self):
        return set(self._heard_ns)

    def heard(self, source, time_ns):
        self._heard_ns[source] = time_ns

    def start(self, time_ns, needed):
        """Start at a time, with the names of the sources that limit the time from now on."""
        self._heard_ns = dict(self._heard_ns, **{source: time_ns for source in needed})
        self._needed = needed

    def new_limit(self, now_s):
        """Return the limit if it has grown, or None. `now_s` is the time of the machine."""
        limit_ns = min(self._heard_ns[source] for source in self._needed) + int(self.LEAD_S * NS)
        if self._limit_ns is not None and limit_ns <= self._limit_ns:
            if now_s - self._raised_s < self.PATIENCE_S:
                return None
            self.late += 1
            limit_ns = self._limit_ns + int(self.LEAD_S * NS)
        self._limit_ns, self._raised_s = limit_ns, now_s
        return limit_ns


class VisiblePeople(object):
    """People in view of at least one camera. The cameras take turns, and each reports all people with a status."""

    def __init__(self, cameras):
        self._visible = collections.deque(maxlen=cameras)

    def of(self, tracks):
        """Those of the tracks (with `id` and `status`) that are visible in the newest image of any camera."""
        self._visible.append({track.id for track in tracks if track.status == VISIBLE})
        return [track for track in tracks if any(track.id in visible for visible in self._visible)]


def distance_m(one, other):
    return float(np.hypot(*np.subtract(one, other)))


def occupancy(room):
    """Occupancy (rows, columns), int8, of a room: walls and furniture; its cell (0, 0) lies at the corner x0, y0."""
    x0, x1, y0, y1 = room.bounds
    x, y = (np.arange(low + CELL_M / 2, high, CELL_M) for low, high in ((x0, x1), (y0, y1)))
    cells = np.zeros((len(y), len(x)), np.int8)
    centers = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    for item in room.furniture:
        inside = Rectangle(item.at, item.yaw, item.size[:2]).signed_distances_m(centers) <= CELL_M / 2
        cells[inside.reshape(cells.shape)] = OCCUPIED
    cells[[0, -1]] = cells[:, [0, -1]] = OCCUPIED
    return cells


def stops(speeds_mps):
    """Number of times that a robot stood still after it had driven."""
    count, is_driving = 0, False
    for speed_mps in np.abs(speeds_mps):
        if is_driving and speed_mps < STANDING_MPS:
            count, is_driving = count + 1, False
        elif speed_mps > DRIVING_MPS:
            is_driving = True
    return count


def was_driving(speeds_mps):
    """Whether the robot was driving within the last speeds, before a contact stopped it."""
    return bool(len(speeds_mps) and np.abs(speeds_mps[-CONTACT_SPEEDS:]).max() > STANDING_MPS)


def summary(trials):
    """Summarise the trials of one mode, a list of dictionaries with the keys of the record of navigation_trial_node.

    `collisions` is the number of contacts with people in all trials, `collisions_driving` that of contacts during which
    the robot did not stand; `time_to_goal_s` the mean of the trials that reached the goal, None if there is none;
    `min_distance_m` the smallest distance of all trials; `stops` their mean per trial.
    """
    times_s = [trial['time_to_goal_s'] for trial in trials if trial['time_to_goal_s'] is not None]
    return {'runs': len(trials), 'collisions': sum(trial['collisions'] for trial in trials),
            'collisions_driving': sum(trial['collisions_driving'] for trial in trials),
            'runs_with_collisions': sum(trial['collisions'] > 0 for trial in trials),
            'reached': len(times_s), 'time_to_goal_s': float(np.mean(times_s)) if times_s else None,
            'min_distance_m': min(trial['min_distance_m'] for trial in trials),
            'stops': float(np.mean([trial['stops'] for trial in trials]))}


def summaries(trials):
    """Summarise trials by scene and mode, and by mode alone, in the form of the JSON file."""
    scenes, modes = (sorted(set(trial[key] for trial in trials)) for key in ('scene', 'mode'))

    def of(**given):
        return [trial for trial in trials if all(trial[key] == value for key, value in given.items())]

    by_scene = {scene: {mode: summary(of(scene=scene, mode=mode)) for mode in modes if of(scene=scene, mode=mode)}
                for scene in scenes}
    return {'scenes': by_scene, 'all': {mode: summary(of(mode=mode)) for mode in modes}}
