"""Motion of people and of the robot: the moves of a scenario as smooth functions of time.

A motion is linear between knots. The state at a time is the mean over an interval of `SMOOTHING_S` around it, so that
velocity and heading do not jump. Convention: map frame, metres, radians, seconds.
"""
import bisect
from typing import NamedTuple

import numpy as np

from ros_3d_bb_lab.simulation.gait import Posture, stride_m

SMOOTHING_S = 0.6
WALKING_MPS = 1.3  # speed at which legs and arms reach their full swing
FOLLOW_STEP_S = 0.05
OBJECT_HEIGHT_M = 1.0  # of an object, for the length of its steps, which it does not show
AFTER_S = 3.0  # moves continue beyond the end of the scene, for the predictions in the ground truth
MIN_ROUND_S = 0.1  # rounds of moves that take less time are not repeated
COLUMNS = X, Y, HEADING, PHASE, SWING, CROUCH = range(6)


class State(NamedTuple):
    """`position_m` (2,), `velocity_mps` (2,), heading (counter-clockwise from x), and posture."""

    position_m: np.ndarray
    velocity_mps: np.ndarray
    heading_rad: float
    posture: Posture


class Motion(object):
    """Motion through knots at ascending times (n,), with values (n, 6) in the order of `COLUMNS`.

    Two knots at the same time are a jump.
    """

    def __init__(self, times_s, values):
        self._times_s, self._values = list(times_s), np.asarray(values, float)
        steps_s = np.diff(self._times_s)[:, None]
        means = (self._values[1:] + self._values[:-1]) / 2
        self._integrals = np.concatenate([np.zeros((1, len(COLUMNS))), np.cumsum(steps_s * means, axis=0)])
        slopes = np.diff(self._values, axis=0) / np.where(steps_s > 0, steps_s, 1)
        self._slopes = np.concatenate([slopes, np.zeros((1, len(COLUMNS)))])  # nothing moves after the last knot

    def at(self, time_s):
        """State at a time since the start. Before the first and after the last knot nothing moves."""
        before, after = (self._evaluated(time_s + shift) for shift in (-SMOOTHING_S / 2, SMOOTHING_S / 2))
        mean = (after[1] - before[1]) / SMOOTHING_S
        velocity = (after[0] - before[0]) / SMOOTHING_S
        return State(mean[:2], velocity[:2], float(mean[HEADING]),
                     Posture(float(mean[PHASE]), float(mean[SWING]), float(mean[CROUCH])))

    def _evaluated(self, time_s):
        interval = bisect.bisect_right(self._times_s, time_s) - 1  # -1: before the first knot, as after the last one
        knot = max(interval, 0)
        beyond_s = time_s - self._times_s[knot]
        moved = self._slopes[interval] * beyond_s
        return self._values[knot] + moved, self._integrals[knot] + beyond_s * (self._values[knot] + moved / 2)


def person_motion(person, height_m, duration_s):
    return _Knots(person.start, person.facing, person.crouch, height_m).motion(person, duration_s)


def object_motion(scene_object, duration_s):
    """Motion of a `scenario.SceneObject` that is not pushed. It faces the direction of its moves, as people do."""
    return _Knots(scene_object.start, scene_object.facing, 0.0, OBJECT_HEIGHT_M).motion(scene_object, duration_s)


def robot_motion(robot, people, duration_s):
    """Motion of the robot (`scenario.Robot`). `people` is the list of the motions of people, which it may follow."""
    if robot.follow is not None:
        return _following_motion(robot, people[robot.follow.person - 1], duration_s)
    return _Knots(robot.pose[:2], robot.pose[2]).motion(robot, duration_s)


class _Knots(object):
    """Builds the knots of a motion from moves. Without a body height it is a robot: it turns before it drives."""

    def __init__(self, position, heading, crouch=0.0, height_m=None):
        self._height_m, self._time_s = height_m, 0.0
        self._value = np.array([position[0], position[1], heading, 0, 0, crouch], float)
        self._times_s, self._values = [0.0], [self._value.copy()]

    def motion(self, mover, duration_s):
        """With `repeat`, the moves are repeated until `AFTER_S` after the scene."""
        start_s = -np.inf
        while self._time_s <= duration_s + AFTER_S and self._time_s >= start_s + MIN_ROUND_S:
            start_s = self._time_s
            for move in mover.moves:
                self._move(move)
            if not mover.repeat:
                break
        return Motion(self._times_s, self._values)

    def _move(self, move):
        if move.to is not None:
            if self._height_m is None:
                self._turn(self._angle_to(move.to), move.rate)
            self._walk(move.to, move.speed)
        elif move.turn is not None:
            self._turn(move.turn, move.rate)
        else:
            self._wait(move)

    def _angle_to(self, position):
        x, y = position - self._value[:2]
        return wrapped(np.arctan2(y, x) - self._value[HEADING]) if x or y else 0.0

    def _walk(self, position, speed_mps):
        position = np.array(position, float)
        distance_m = np.linalg.norm(position - self._value[:2])
        swing = min(1.0, speed_mps / WALKING_MPS) ** .5 if self._height_m else 0.0
        self._value[HEADING] += self._angle_to(position)
        self._value[SWING], self._value[CROUCH] = swing, 0
        self._add(0)
        self._value[:2] = position
        self._value[PHASE] += distance_m / stride_m(self._height_m, swing) if self._height_m else 0
        self._add(distance_m / speed_mps)
        self._value[SWING] = 0
        self._add(0)

    def _turn(self, angle, rate):
        self._value[HEADING] += angle
        self._add(abs(angle) / rate)

    def _wait(self, move):
        if move.facing is not None:
            self._value[HEADING] += wrapped(move.facing - self._value[HEADING])
        self._value[CROUCH] = move.crouch
        self._add(0)
        self._add(move.wait)

    def _add(self, elapsed_s):
        self._time_s += elapsed_s
        self._times_s.append(self._time_s)
        self._values.append(self._value.copy())


def wrapped(angle):
    return (angle + np.pi) % (2 * np.pi) - np.pi


def _following_motion(robot, person, duration_s):
    follow, (x, y, heading) = robot.follow, robot.pose
    values, times_s = [], np.arange(0, duration_s + SMOOTHING_S, FOLLOW_STEP_S)
    for time_s in times_s:
        values.append([x, y, heading, 0, 0, 0])
        dx, dy = person.at(time_s).position_m - (x, y)
        angle = wrapped(np.arctan2(dy, dx) - heading)
        heading += np.clip(angle, -follow.rate * FOLLOW_STEP_S, follow.rate * FOLLOW_STEP_S)
        step_m = np.clip(np.hypot(dx, dy) - follow.distance, 0, follow.speed * FOLLOW_STEP_S) * max(0, np.cos(angle))
        x, y = x + step_m * np.cos(heading), y + step_m * np.sin(heading)
    return Motion(times_s, values)
