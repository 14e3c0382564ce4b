"""Ten minutes of following a person past people who cross, in the simulator: the same result on any machine."""
import os
from collections import namedtuple

import numpy as np
import pytest

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.estimation.error_model import read_error_model
from ros_3d_bb.planning.following import FollowParams, Follower
from ros_3d_bb.planning.safe_speed import SafeSpeedParams
from ros_3d_bb.tracking.tracker import Tracker
from ros_3d_bb_lab.evaluation.defaults import SIMULATED_ERROR_MODEL
from ros_3d_bb_lab.evaluation.scene_benchmark import depth_detector, track_frame
from ros_3d_bb_lab.simulation.driven_world import DrivenWorld
from ros_3d_bb_lab.simulation.scenario import read_scenario
from ros_3d_bb_lab.simulation.simulator import Simulator
from support.pages import ROOT

LATENCY_S, PERIOD_S = 0.12, 0.05


# What is followed in one image: the person (number from 1, 0 without one), and the distance from person 1.
Moment = namedtuple('Moment', 'time_s person distance_m')


class FollowedScene(object):
    """The scene of a Scenario with a robot that follows, as follow_node with people detected in depth.

    Attributes: `moments`, and `collisions` of the DrivenWorld.
    """

    def __init__(self, scenario):
        self._simulator = Simulator(scenario)
        self._world = DrivenWorld(self._simulator)
        self._detect, self._tracker = depth_detector(self._simulator), Tracker()
        self._error_model = read_error_model(SIMULATED_ERROR_MODEL)
        self._follower, self._waiting, self._newest = Follower(FollowParams(), SafeSpeedParams()), [], None
        self.moments = []

    @property
    def collisions(self):
        return self._world.collisions

    def run(self, seconds):
        """Play the scene from its start."""
        for time_s, number in self._simulator.steps():
            if time_s > seconds:
                break
            state = self._world.state_at(time_s)
            poses = self._simulator.poses(state)
            robot_from_map = np.linalg.inv(poses.map_from_odom.dot(poses.odom_from_base))
            if number is not None:
                frame = self._simulator.frame(number, state)
                self._waiting.append((time_s, track_frame(self._tracker, frame, self._detect(frame), int(time_s * NS),
                                                          self._simulator.camera, self._error_model)))
            while self._waiting and self._waiting[0][0] + LATENCY_S <= time_s:
                self._newest = self._waiting.pop(0)
                self._follow(state, robot_from_map)
            if self._newest is not None and abs(time_s / PERIOD_S - round(time_s / PERIOD_S)) < 1e-6:
                stamp_s, tracks = self._newest
                self._world.command(*self._follower.command(tracks, time_s - stamp_s, robot_from_map, PERIOD_S))
        return self

    def _follow(self, state, robot_from_map):
        stamp_s, tracks = self._newest
        self._follower.update(tracks, int(stamp_s * NS), robot_from_map)
        followed, people_m = self._follower.person, np.array([person.position_m for person in state.people])
        nearest = 0 if followed is None else 1 + int(
            np.linalg.norm(people_m - followed.position_m[:2], axis=1).argmin())
        robot_m = np.linalg.inv(robot_from_map)[:2, 3]
        self.moments.append(Moment(stamp_s, nearest, float(np.linalg.norm(people_m[0] - robot_m))))


LEADER, SWITCHING_S = 1, 1.0  # longest time on another person whose track has taken over the ID


def longest_s(moments, condition):
    longest, since_s = 0.0, None
    for moment in moments:
        since_s = (moment.time_s if since_s is None else since_s) if condition(moment) else None
        longest = max(longest, 0.0 if since_s is None else moment.time_s - since_s)
    return longest


@pytest.mark.long
def test_the_robot_follows_the_same_person():
    seconds = 600.0
    scene = FollowedScene(read_scenario(os.path.join(ROOT, 'config', 'scenarios', 'follow.yaml'))).run(seconds)
    persons = [moment.person for moment in scene.moments]
    print('%g s: on the person in %d of %d images, on others in %d, lost in %d; on another one for at most %.1f s, '
          'lost for at most %.1f s; distance at most %.1f m; collisions: %s' % (
              seconds, persons.count(LEADER), len(persons), len([each for each in persons if each > LEADER]),
              persons.count(0), longest_s(scene.moments, lambda moment: moment.person > LEADER),
              longest_s(scene.moments, lambda moment: moment.person == 0),
              max(moment.distance_m for moment in scene.moments), scene.collisions))
    assert longest_s(scene.moments, lambda moment: moment.person > LEADER) < SWITCHING_S
    assert persons.count(LEADER) > 0.9 * len(persons) and persons[-1] == LEADER
    assert not scene.collisions
