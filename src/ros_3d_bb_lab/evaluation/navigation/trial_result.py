"""Results of trials of the navigation benchmark, and the map of a scene."""
import numpy as np

from ros_3d_bb_lab.simulation.collision import Rectangle

CELL_M = 0.05
OCCUPIED = 100
STANDING_MPS, DRIVING_MPS = 0.05, 0.15


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


def summary(trials):
    """Summarise the trials of one mode, a list of dictionaries with the keys of the record of navigation_trial_node.

    `collisions` is their sum; `time_to_goal_s` the mean of the trials that reached the goal, None if there is none;
    `min_distance_m` the smallest distance of all trials; `stops` their mean per trial.
    """
    times_s = [trial['time_to_goal_s'] for trial in trials if trial['time_to_goal_s'] is not None]
    return {'runs': len(trials), 'collisions': sum(trial['collisions'] for trial in trials),
            'runs_with_collisions': sum(trial['collisions'] > 0 for trial in trials),
            'reached': len(times_s), 'time_to_goal_s': float(np.mean(times_s)) if times_s else None,
            'min_distance_m': min(trial['min_distance_m'] for trial in trials),
            'stops': float(np.mean([trial['stops'] for trial in trials]))}


def summaries(trials):
    """Summarise trials by scene and mode, and by mode alone, in the form of the JSON file."""
    scenes, modes = (sorted(set(trial[key] for trial in trials)) for key in ('scene', 'mode'))

    def of(**given):
        return [trial for trial in trials if all(trial[key] == value for key, value in given.items())]

    return {'scenes': {scene: {mode: summary(of(scene=scene, mode=mode)) for mode in modes if of(scene=scene, mode=mode)}
                       for scene in scenes},
            'all': {mode: summary(of(mode=mode)) for mode in modes}}
