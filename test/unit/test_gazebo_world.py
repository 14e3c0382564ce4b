"""People of scenarios as actors of Gazebo, and true tracks from its model states, without Gazebo."""
import xml.etree.ElementTree as ElementTree
from types import SimpleNamespace

import numpy as np
import pytest

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.types import CameraView
from ros_3d_bb_lab.evaluation.gazebo.people_truth import PeopleTruth
from ros_3d_bb_lab.simulation.gazebo_world import HEIGHT_M, PERSON_NAME, world_of
from ros_3d_bb_lab.simulation.motion import person_motion
from ros_3d_bb_lab.simulation.scenario import scenario_from

SCENARIO = scenario_from({
    'duration': 6.0,
    'room': {'bounds': [-1, 8, -3, 3], 'furniture': [{'at': [4, 1], 'size': [0.5, 0.4, 1.7], 'yaw': 0.3}]},
    'people': [{'start': [3, -1], 'facing': 1.0, 'moves': [{'wait': 1.0}, {'to': [3, 1], 'speed': 1.1}]},
               {'start': [5, 0]}]})
AHEAD = CameraView(np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0.27], [0, 0, 0, 1.0]]))  # looks along x


@pytest.fixture
def world():
    return ElementTree.fromstring(world_of(SCENARIO, start_s=2.5)).find('world')


def numbers(element, path):
    return [float(number) for number in element.findtext(path).split()]


def test_people_follow_the_motion_of_the_scenario(world):
    actors = world.findall('actor')
    assert [actor.get('name') for actor in actors] == [PERSON_NAME + '1', PERSON_NAME + '2']
    for actor, person in zip(actors, SCENARIO.people):
        assert actor.findtext('script/delay_start') == '2.5' and actor.findtext('script/loop') == 'false'
        motion, times_s = person_motion(person, HEIGHT_M, SCENARIO.duration), []
        for waypoint in actor.iter('waypoint'):
            times_s.append(float(waypoint.findtext('time')))
            state, pose = motion.at(times_s[-1]), numbers(waypoint, 'pose')
            np.testing.assert_allclose(pose, [*state.position_m, 0, 0, 0, state.heading_rad], atol=1e-3)
        assert times_s[0] == 0 and times_s[-1] >= SCENARIO.duration and (np.diff(times_s) > 0).all()


def states(paths, times_s):
    """Model states of people on `paths` (functions of time), with other models."""
    def pose(x, y):
        return SimpleNamespace(position=SimpleNamespace(x=x, y=y))
    for time_s in times_s:
        names = ['room'] + [PERSON_NAME + str(number + 1) for number in range(len(paths))] + ['jackal']
        people = [pose(*path(time_s)) for path in paths]
        yield time_s, SimpleNamespace(name=names, pose=[pose(0, 0)] + people + [pose(9, 9)])


def test_true_tracks_have_position_velocity_and_future_positions():
    truth = PeopleTruth(states([lambda t: (4 + 0.5 * t, 1 - t)], np.arange(0, 5, 0.01)))
    track, = truth.tracks_at(2 * NS, AHEAD)
    np.testing.assert_allclose(track.position_m[:2], [5, -1], atol=1e-6)
    np.testing.assert_allclose(track.velocity_mps, [0.5, -1, 0], atol=1e-6)
    np.testing.assert_allclose(track.prediction_m[-1, :2], [6, -3], atol=1e-6)
    assert (track.id, track.moving, track.prediction_step_s * len(track.prediction_m)) == (1, True, 2.0)
