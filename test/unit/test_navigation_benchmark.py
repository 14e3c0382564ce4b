"""Benchmark of navigation: its scenes, the pace of the simulated time, the map, and the summary of trials."""
import numpy as np
import pytest

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.camera.depth_image import DepthImage
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb_lab.evaluation.navigation.navigation_scenes import DURATION_S, SCENES, scenario_of
from ros_3d_bb_lab.evaluation.navigation.trial_result import (CELL_M, Pace, occupancy, points_of, stops, summaries,
                                                              summary, was_driving)
from ros_3d_bb_lab.simulation.driven_world import DrivenWorld
from ros_3d_bb_lab.simulation.scenario import Furniture, Room, scenario_from
from ros_3d_bb_lab.simulation.simulator import STEP_S, Simulator

CAMERA = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)
LEAD_NS = int(Pace.LEAD_S * NS)


def trial(**others):
    return dict({'scene': 'crowd', 'mode': 'ours', 'collisions': 0, 'collisions_driving': 0, 'time_to_goal_s': 10.0,
                 'min_distance_m': 0.5, 'stops': 0}, **others)


@pytest.mark.parametrize('name', sorted(SCENES))
def test_scenes_are_valid_and_depend_on_the_seed_only(name):
    contents = [scenario_of(name, seed) for seed in range(1, 21)]
    assert contents[0] == scenario_of(name, 1)
    assert len(set(map(str, contents))) == 20
    for content in contents:
        scenario = scenario_from(content)
        assert scenario.duration == DURATION_S and len(scenario.people) >= 1


@pytest.mark.slow
@pytest.mark.parametrize('name', sorted(set(SCENES) - {'doorway', 'crowd', 'overtaking'}))
def test_a_robot_that_ignores_people_collides_in_most_trials(name):
    """It drives straight to the goal like move_base without people. In the other scenes people give way or walk on."""
    collided = []
    for seed in range(1, 4):
        world = DrivenWorld(Simulator(scenario_from(scenario_of(name, seed)), CAMERA))
        assert world.clearance_m > 1.0
        for step in range(int(10 / STEP_S)):
            if step % 10 == 0:
                world.command(0.8, 0.0)
            world.state_at(step * STEP_S)
        collided.append(bool(world.collisions))
    assert sum(collided) >= 2


def test_time_waits_for_the_slowest_source():
    pace = Pace()
    pace.heard('cloud', 1 * NS)
    pace.start(5 * NS, ['commands', 'tracks'])
    assert pace.sources == {'cloud', 'commands', 'tracks'}
    assert pace.new_limit(100.0) == 5 * NS + LEAD_NS
    pace.heard('commands', 7 * NS)
    assert pace.new_limit(100.1) is None
    pace.heard('tracks', 6 * NS)
    assert pace.new_limit(100.2) == 6 * NS + LEAD_NS
    assert pace.late == 0


def test_a_silent_source_slows_the_time_down_and_does_not_stop_it():
    pace = Pace()
    pace.start(5 * NS, ['commands'])
    limits = [pace.new_limit(now_s) for now_s in (0.0, 0.3, Pace.PATIENCE_S, 0.7, 2 * Pace.PATIENCE_S)]
    assert limits == [5 * NS + LEAD_NS, None, 5 * NS + 2 * LEAD_NS, None, 5 * NS + 3 * LEAD_NS]
    assert pace.late == 2
    pace.heard('commands', 6 * NS)
    assert pace.new_limit(1.3) == 6 * NS + LEAD_NS


def test_the_map_has_walls_and_furniture():
    room = Room(bounds=(-1.0, 3.0, -2.0, 2.0), furniture=(Furniture((2.0, 1.0), (1.0, .5, 2.0)),))
    cells = occupancy(room)
    assert cells.shape == (4.0 / CELL_M, 4.0 / CELL_M) and set(np.unique(cells)) == {0, 100}

    def at(x, y):
        return cells[int((y + 2) / CELL_M), int((x + 1) / CELL_M)]

    assert [at(*place) for place in ((2, 1), (1.6, .85), (1.4, 1), (2, .6), (0, 0), (-.99, 0), (0, 1.99))] == [
        100, 100, 0, 0, 0, 100, 100]


def test_points_lie_at_the_depth_of_their_pixels():
    depth_mm = np.full((48, 64), 2000, np.uint16)
    depth_mm[:24] = 0
    depth_mm[24:, 32:] = 9000
    points = points_of(DepthImage(depth_mm, .001), CAMERA)
    assert len(points) == 3 * 4
    np.testing.assert_allclose(points[:, 2], 2.0)
    np.testing.assert_allclose(points[0, :2], 2 * (np.array([0, 24]) - (31.5, 23.5)) / 60)


@pytest.mark.parametrize('speeds_mps, count', [
    ([], 0), ([0, 0, .8, .8], 0), ([0, .8, .02, .8, 0], 2), ([.8, .1, .8], 0), ([-.3, 0, .1, 0], 1)])
def test_stops_are_counted_after_driving(speeds_mps, count):
    assert stops(speeds_mps) == count


@pytest.mark.parametrize('speeds_mps, expected', [([], False), ([.8, .8, 0, 0, 0], True), ([.8] + 9 * [0], False)])
def test_contacts_while_driving(speeds_mps, expected):
    assert was_driving(speeds_mps) == expected


def test_the_summary_of_trials():
    trials = [trial(), trial(collisions=2, collisions_driving=1, time_to_goal_s=None, min_distance_m=-.1, stops=3)]
    assert summary(trials) == {'runs': 2, 'collisions': 2, 'collisions_driving': 1, 'runs_with_collisions': 1,
                               'reached': 1, 'time_to_goal_s': 10.0, 'min_distance_m': -.1, 'stops': 1.5}
    assert summary(trials[1:])['time_to_goal_s'] is None


def test_summaries_by_scene_and_mode():
    result = summaries([trial(), trial(mode='none', collisions=1), trial(scene='doorway', time_to_goal_s=20.0)])
    assert result['scenes']['crowd']['none']['collisions'] == 1
    assert set(result['scenes']['doorway']) == {'ours'}
    assert result['all']['ours']['runs'] == 2 and result['all']['ours']['time_to_goal_s'] == 15.0
