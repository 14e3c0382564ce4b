import pytest

from ros_3d_bb_lab.evaluation.navigation.navigation_scenes import DURATION_S, SCENES, scenario_of
from ros_3d_bb_lab.evaluation.navigation.trial_result import summary
from ros_3d_bb_lab.simulation.scenario import scenario_from


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


def test_the_summary_of_trials():
    trials = [trial(), trial(collisions=2, collisions_driving=1, time_to_goal_s=None, min_distance_m=-.1, stops=3)]
    assert summary(trials) == {'runs': 2, 'collisions': 2, 'collisions_driving': 1, 'runs_with_collisions': 1,
                               'reached': 1, 'time_to_goal_s': 10.0, 'min_distance_m': -.1, 'stops': 1.5}
    assert summary(trials[1:])['time_to_goal_s'] is None
