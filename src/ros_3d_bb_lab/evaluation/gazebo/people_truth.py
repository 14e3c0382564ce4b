"""True tracks of the people in a world of Gazebo, from its model states."""
import numpy as np

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.types import OCCLUDED, OUT_OF_VIEW, VISIBLE, TrackedObject, prediction_times_s
from ros_3d_bb_lab.simulation.gazebo_world import PERSON_NAME

SIZE_M = np.array([0.5, 0.5, 1.75])
PREDICTION_S, PREDICTION_STEP_S = 2.0, 0.25
SWAY_S = 0.5  # the position is that of the pelvis, which sways in each step; velocities are means over this time
HALF_VIEW_RAD = np.arctan(320 / 614.7) - 0.03  # of the colour images; people at the edge of them are out of view
BODY_M = 0.2  # half the width of what must not be hidden of a person
MOVING_MPS = 0.2


class PeopleTruth(object):
    """Positions of people over time, from pairs of the simulated time in seconds and gazebo_msgs/ModelStates."""

    def __init__(self, states):
        times_s, positions_m = [], []
        for time_s, message in states:
            people = [number for number, name in enumerate(message.name) if name.startswith(PERSON_NAME)]
            times_s.append(time_s)
            positions_m.append([(message.pose[number].position.x, message.pose[number].position.y)
                                for number in people])
        if not times_s:
            raise ValueError('no model states; a run of gazebo.launch expected')
        self._times_s, self._positions_m = np.array(times_s), np.array(positions_m)  # (n,), (n, people, 2)

    def positions_at(self, time_s):
        """Positions (people, 2) at a time, metres."""
        return np.array([[np.interp(time_s, self._times_s, path) for path in person.T]
                         for person in self._positions_m.transpose(1, 0, 2)])

    def velocities_at(self, time_s):
        """Mean velocities (people, 2) around a time, m/s."""
        return (self.positions_at(time_s + SWAY_S / 2) - self.positions_at(time_s - SWAY_S / 2)) / SWAY_S

    def tracks_at(self, stamp_ns, view):
        """Tracks (list of TrackedObject) of all people at a stamp, with their status in a CameraView."""
        time_s = stamp_ns / NS
        positions_m, velocities_mps = self.positions_at(time_s), self.velocities_at(time_s)
        future_m = np.array([self.positions_at(time_s + ahead_s)
                             for ahead_s in prediction_times_s(PREDICTION_S, PREDICTION_STEP_S)])
        return [TrackedObject(number + 1, np.append(position_m, SIZE_M[2] / 2), SIZE_M, np.append(velocity_mps, 0),
                              status, bool(np.hypot(*velocity_mps) > MOVING_MPS), stamp_ns,
                              stamp_ns, np.c_[path_m, np.full(len(path_m), SIZE_M[2] / 2)], PREDICTION_STEP_S)
                for number, (position_m, velocity_mps, status, path_m) in enumerate(zip(
                    positions_m, velocities_mps, statuses(positions_m, view), future_m.transpose(1, 0, 2)))]


def statuses(positions_m, view):
    """VISIBLE, OCCLUDED or OUT_OF_VIEW of people at positions (n, 2): a nearer person hides those behind it."""
    distances_m, bearings = view.bearings(positions_m)
    result = []
    for distance_m, bearing in zip(distances_m, bearings):
        apart_m = np.abs(np.sin(bearings - bearing)) * distance_m
        is_hidden = ((distances_m < distance_m - BODY_M) & (apart_m < 2 * BODY_M)).any()
        result.append(OUT_OF_VIEW if abs(bearing) > HALF_VIEW_RAD else OCCLUDED if is_hidden else VISIBLE)
    return result
