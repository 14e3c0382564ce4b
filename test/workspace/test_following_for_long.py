"""Ten minutes of following a person past people who cross, in the simulator."""
import os

import pytest

from ros_3d_bb_lab.simulation.scenario import read_scenario
from support.following import FollowedScene
from support.pages import ROOT

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
