"""Follow one person: which track is the person, and the velocity with which the robot keeps its distance.

Positions are in the frame of the tracks, or in that of the robot where this is stated; metres, radians, seconds.
"""
import math
from typing import NamedTuple

import numpy as np

from ros_3d_bb.camera.camera_model import transform_points
from ros_3d_bb.core.object_classes import PERSON
from ros_3d_bb.core.params import Param, parameters
from ros_3d_bb.core.time_sync import JUMP_NS, NS
from ros_3d_bb.planning.planner_view import position_after, predicted_to
from ros_3d_bb.planning.safe_speed import highest_safe_speed
from ros_3d_bb.tracking.types import OCCLUDED, VISIBLE, TrackedObject

# A lost person is within NEAR_M of the prediction, and TURNING_MPS more for each second, up to FARTHEST_M; chosen.
NEAR_M, TURNING_MPS, FARTHEST_M = 0.5, 1.0, 2.0
# A change of IDs is searched for in the last PATH_NS, and changes a track from SWITCHING_NS before the new one; chosen.
PATH_NS, SWITCHING_NS = 3 * NS, NS // 2
MISSED_NS = NS // 2  # who is not visible for at most this time was missed by the detector, and not hidden; chosen
# A distance (see `_normalized_distance`) is clearly less than another one by this ratio and this difference; chosen.
CLEARLY, LEAST_DIFFERENCE = 0.5, 0.3
LONGEST_PREDICTION_S = 2.0  # people who are lost for longer have probably turned or stopped; chosen
GAIN = 1.0  # speed by distance, 1/s; chosen
TURN_GAIN = 2.0  # rate by bearing, 1/s; chosen
NEW_GOAL_M, NEW_GOAL_RAD = 0.2, 0.3  # changes of a goal for which it is sent again; chosen
SLOWEST_MPS = 0.1  # speed from which the path counts in which the robot starts to move


@parameters('following')
class FollowParams(NamedTuple):
    track_id: int = Param(
        0, 'Track ID of the person to follow; 0: the nearest visible person.', limits=(0, 2 ** 31 - 1),
        live=(0, 100000))
    distance: float = Param(
        2.0, 'Distance from the axis of the person to the origin of the robot.', 'm', limits=(0.3, 10.0),
        live=(0.5, 4))
    max_speed: float = Param(
        1.0, 'Highest speed. This and the other limits of speed, rate and acceleration, and the safe speed, do not '
        'apply to goals.', 'm/s', limits=(0.05, 10.0), live=(0.1, 2))
    max_rate: float = Param(1.0, 'Highest angular velocity.', 'rad/s', limits=(0.05, 10.0), live=(0.1, 3))
    acceleration: float = Param(
        0.8, 'Highest acceleration. The highest deceleration is ~deceleration.', 'm/s^2', limits=(0.05, 10.0),
        live=(0.1, 3))
    angular_acceleration: float = Param(
        2.0, 'Highest angular acceleration.', 'rad/s^2', limits=(0.05, 50.0), live=(0.5, 5))
    lost_after: float = Param(
        1.0, 'The robot stops when the person has not been visible for this time. Until then it follows the '
        'prediction.', 's', limits=(0.0, 10.0), live=(0, 3))
    recover_within: float = Param(
        15.0, 'For this time the robot waits for a lost person, and follows again when the same track is visible, or a '
        'new one that is clearly that of the person. Then it stands until it is enabled again.', 's',
        limits=(0.0, 600.0), live=(0, 60))


class _Seen(NamedTuple):
    """A TrackedObject when it was last visible, the stamp of that, and the stamp when it was last published at all."""

    track: TrackedObject
    stamp_ns: int
    published_ns: int


class TargetSelector(object):
    """Which track is the person to follow.

    The first one is chosen by ID, or is the nearest visible person. From then on no other person is chosen. If the
    tracker has lost the person, it gives a new ID to the person who reappears. That track is recognised by its place:
    it must be clearly nearer to where the person is expected than other new tracks, and than it is to where another
    lost person is expected. If the former track is visible again and fits clearly better, it is the person after all.

    Attributes: `target`, the TrackedObject when the person was last visible, None before the choice, and
    `has_given_up`, whether the person was lost for too long.
    """

    def __init__(self):
        self.target, self.has_given_up = None, False
        self._seen = {}  # _Seen by track ID
        self._path = []  # _Seen of the target in the last PATH_NS, up to a change of its ID
        self._changed_ns = None  # stamp of that change
        # (_Seen before, if any, _Seen then) of tracks that became visible at most PATH_NS ago, by ID
        self._begun = {}
        self._latest_ns = None  # stamp of the latest tracks

    def select(self, tracks, stamp_ns, robot_m, params):
        """The track of the person at a stamp, predicted if it is not among the tracks; None if the person is lost.

        `robot_m` (2,) is the position of the robot, `params` are FollowParams.
        """
        if self.target is None:
            self.target = _chosen(tracks, robot_m, params.track_id)
        if self.target is None or self.has_given_up:
            return None
        lost_ns = stamp_ns - self._seen[self.target.id].stamp_ns if self._seen else 0
        if not -JUMP_NS <= lost_ns <= params.recover_within * NS:  # also without tracks, or if the clock went back
            self.has_given_up = True
            return None
        self._update(tracks, stamp_ns, params.recover_within)
        self._check_identity(tracks, stamp_ns)
        if self._seen[self.target.id].stamp_ns < stamp_ns:
            self._change_to_nearest(tracks, self._seen[self.target.id], stamp_ns, [])
        self.target, seen_ns, _published_ns = self._seen[self.target.id]
        lost_s = (stamp_ns - seen_ns) / NS
        if lost_s > params.lost_after:
            return None
        predicted, = predicted_to([self.target], lost_s)
        return next((track for track in tracks if track.id == self.target.id), predicted._replace(status=OCCLUDED))

    def _update(self, tracks, stamp_ns, longest_s):
        """Note which tracks are visible, and which are published. Others are forgotten after `longest_s` seconds."""
        self._seen = {key: seen for key, seen in self._seen.items()
                      if key == self.target.id or stamp_ns - seen.stamp_ns <= longest_s * NS}
        self._begun = {key: begun for key, begun in self._begun.items() if stamp_ns - begun[1].stamp_ns <= PATH_NS}
        for track in tracks:
            seen, now = self._seen.get(track.id), _Seen(track, stamp_ns, stamp_ns)
            if track.status == VISIBLE:
                if not seen or seen.stamp_ns < min(self._latest_ns, stamp_ns - MISSED_NS):
                    self._begun[track.id] = seen, now
                self._seen[track.id] = now
            elif seen:
                self._seen[track.id] = seen._replace(published_ns=stamp_ns)
        self._latest_ns = stamp_ns

    def _check_identity(self, tracks, stamp_ns):
        """Change to another track where the tracker has confused the person with one who crosses: the old track has
        left the path that was predicted before the other one began, or was visible again, and that began on it and is
        on it. Change back to the former track if this is on the path."""
        own = self._seen[self.target.id]
        if own.stamp_ns < stamp_ns and not self._has_changed(stamp_ns):
            return
        self._path = [seen for seen in self._path if 0 <= stamp_ns - seen.stamp_ns <= PATH_NS]
        tracks = [track._replace(first_seen_ns=self._begun[track.id][1].stamp_ns) if self._before_hidden(track.id)
                  else track for track in tracks]
        new_ns = [track.first_seen_ns for track in tracks
                  if self._path and track.first_seen_ns > self._path[0].stamp_ns + SWITCHING_NS]
        if new_ns:
            before = [seen for seen in self._path if seen.stamp_ns < min(new_ns) - SWITCHING_NS][-1]
            old = predicted_to([own.track], (stamp_ns - own.stamp_ns) / NS)[0]._replace(first_seen_ns=stamp_ns)
            continuing = [track for track in tracks if track.id != own.track.id and (
                track.id == before.track.id or self._has_begun_near(track.id, before))]
            self._change_to_nearest(continuing, before, stamp_ns, [_normalized_distance(old, before, stamp_ns)])
        if not self._has_changed(stamp_ns):
            self._path.append(own)

    def _has_changed(self, stamp_ns):
        return self._changed_ns is not None and stamp_ns - self._changed_ns <= PATH_NS

    def _before_hidden(self, track_id):
        """The _Seen of a track before it was hidden, if it has been visible again for at most PATH_NS; else None."""
        return self._begun.get(track_id, (None, None))[0]

    def _has_begun_near(self, track_id, before):
        """Whether a track became visible at most PATH_NS ago, within NEAR_M of where `before` was expected then."""
        if track_id not in self._begun:
            return False
        _before_hidden, begun = self._begun[track_id]
        return np.linalg.norm(begun.track.position_m[:2] - _expected_m(before, begun.stamp_ns)) <= NEAR_M

    def _change_to_nearest(self, tracks, before, stamp_ns, others):
        """Make the track that is nearest to where `before`, a _Seen, is expected the target, if its distance is clearly
        less than those of the other tracks, than `others`, and than its own as that of another lost person."""
        visible = set(track.id for track in tracks if track.status == VISIBLE)
        near = sorted(((_normalized_distance(track, before, stamp_ns), track.id) for track in tracks
                       if track.id in visible and track.label == self.target.label), key=lambda each: each[0])
        if not near or near[0][0] > 1:
            return
        distance, track_id = near[0]
        lost = [seen for key, seen in self._seen.items() if key != self.target.id and seen.stamp_ns < stamp_ns]
        if self._before_hidden(track_id) and track_id != before.track.id:
            lost.append(self._before_hidden(track_id))
        others = others + [other for other, _id in near[1:]] + [
            _normalized_distance(self._seen[track_id].track, seen, stamp_ns) for seen in lost]
        if max(distance / CLEARLY, distance + LEAST_DIFFERENCE) < min(others, default=np.inf):
            del self._seen[self.target.id]
            self.target, self._changed_ns = self._seen[track_id].track, stamp_ns


def _chosen(tracks, robot_m, track_id):
    """The visible track with this ID; for 0, the nearest visible person. None without one."""
    people = [track for track in tracks if track.status == VISIBLE and (
        track.id == track_id if track_id else track.label == PERSON)]
    return min(people, key=lambda track: np.linalg.norm(track.position_m[:2] - robot_m), default=None)


def _normalized_distance(track, seen, stamp_ns):
    """Distance of a track from where a lost one, a _Seen, is expected, relative to the distance within which it must
    be; infinite if both are of different people, as they existed at the same time. As long as the lost one is
    published, it is still tracked, and must be near."""
    lost, seen_ns, published_ns = seen
    if track.first_seen_ns <= seen_ns and track.id != lost.id:
        return np.inf
    farthest_m = min(NEAR_M + TURNING_MPS * (stamp_ns - published_ns) / NS, FARTHEST_M)
    return np.linalg.norm(track.position_m[:2] - _expected_m(seen, stamp_ns)) / farthest_m


def _expected_m(seen, stamp_ns):
    return position_after(seen.track, min((stamp_ns - seen.stamp_ns) / NS, LONGEST_PREDICTION_S))[:2]


class Follower(object):
    """Velocity commands that follow one person, for a robot that sees in the direction of its x axis.

    Attribute `person`: the track of the person at the last update, None if there is none or the person is lost.
    """

    def __init__(self, params, safety):
        self.reconfigure(params, safety)
        self.restart()

    def reconfigure(self, params, safety):
        """Change the parameters, FollowParams and SafeSpeedParams. Another `track_id` is chosen at once."""
        if getattr(self, '_params', params).track_id != params.track_id:
            self.selector = TargetSelector()
        self._params, self._safety = params, safety

    def restart(self):
        self.selector, self.person, self._velocity = TargetSelector(), None, (0.0, 0.0)

    def update(self, tracks, stamp_ns, robot_from_tracks):
        """Take the tracks of an image. `robot_from_tracks` (4, 4) is the pose of their frame at this time."""
        robot_m = _position_of(robot_from_tracks)
        self.person = self.selector.select(tracks, stamp_ns, robot_m, self._params)

    def command(self, tracks, age_s, robot_from_tracks, step_s, pose_age_s=0.0):
        """Linear and angular velocity, a time `step_s` after the last ones, for tracks of the age `age_s` and a pose of
        the age `pose_age_s`.

        Both are 0 once the robot stands and there is no person to follow.
        """
        wanted = (0.0, 0.0) if self.person is None else self._wanted(age_s, robot_from_tracks)
        if self.person is not None and all(track.id != self.person.id for track in tracks):
            tracks = list(tracks) + [self.person]
        limit = highest_safe_speed(tracks, age_s, robot_from_tracks, (max(wanted[0], SLOWEST_MPS), 0.0, wanted[1]),
                                   self._safety, pose_age_s, leaves=False)  # it does not look for a way past people
        params, (linear, angular) = self._params, self._velocity
        change = params.angular_acceleration * step_s
        self._velocity = (
            max(min(wanted[0], limit, linear + params.acceleration * step_s),
                linear - self._safety.deceleration * step_s),
            min(max(wanted[1], angular - change), angular + change))
        return self._velocity

    def stop(self):
        self._velocity = (0.0, 0.0)

    def goal(self, age_s, robot_from_tracks):
        """Pose (x, y, yaw) in the frame of the tracks where the robot keeps its distance from the person, and looks at
        the person; None without a person."""
        if self.person is None:
            return None
        robot_m, person_m = _position_of(robot_from_tracks), position_after(self.person, age_s)[:2]
        x, y = person_m - robot_m
        yaw, ahead_m = math.atan2(y, x), max(math.hypot(x, y) - self._params.distance, 0.0)
        return robot_m[0] + ahead_m * math.cos(yaw), robot_m[1] + ahead_m * math.sin(yaw), yaw

    def _wanted(self, age_s, robot_from_tracks):
        """Velocities that keep the distance from the person, and turn towards the person."""
        params, (person,) = self._params, predicted_to([self.person], age_s)
        x, y, _z = transform_points(robot_from_tracks, person.position_m)
        velocity_mps = robot_from_tracks[:2, :2].dot(person.velocity_mps[:2])
        distance_m, bearing = max(math.hypot(x, y), 1e-3), math.atan2(y, x)
        leaving_mps = (velocity_mps[0] * x + velocity_mps[1] * y) / distance_m
        speed_mps = (leaving_mps + GAIN * (distance_m - params.distance)) * max(math.cos(bearing), 0.0)
        passing = (velocity_mps[1] * x - velocity_mps[0] * y) / distance_m ** 2  # rate of the bearing, rad/s
        rate = TURN_GAIN * bearing + passing
        return (min(max(speed_mps, 0.0), params.max_speed), min(max(rate, -params.max_rate), params.max_rate))


def is_new_goal(before, goal):
    """Whether a goal (x, y, yaw) differs enough from the one before, which may be None, to be sent."""
    return before is None or (math.hypot(goal[0] - before[0], goal[1] - before[1]) > NEW_GOAL_M
                              or math.cos(goal[2] - before[2]) < math.cos(NEW_GOAL_RAD))


def is_reached(goal, robot_from_tracks):
    """Whether the robot is at the position of a goal (x, y, yaw); `robot_from_tracks` (4, 4) is its pose."""
    return np.linalg.norm(_position_of(robot_from_tracks) - goal[:2]) <= NEW_GOAL_M


def _position_of(robot_from_tracks):
    return np.linalg.inv(robot_from_tracks)[:2, 3]
