import pathlib
import re
import xml.etree.ElementTree as ElementTree
from types import SimpleNamespace

import numpy as np
import pytest

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.core.yaml_loader import load_yaml
from ros_3d_bb.tracking.types import CameraView
from ros_3d_bb_lab.evaluation.gazebo.people_truth import PeopleTruth
from ros_3d_bb_lab.simulation.gazebo_world import HEIGHT_M, PERSON_NAME, world_of
from ros_3d_bb_lab.simulation.motion import person_motion
from ros_3d_bb_lab.simulation.scenario import (Drive, Follow, Furniture, Mount, Move, Person, Robot, Room, Scenario,
                                               read_scenario, scenario_from)


# Key path of each record, as in error messages.
PLACES = {'scenario': (Scenario, lambda record: record),
          'scenario.room': (Room, lambda record: {'room': record}),
          'scenario.room.furniture[2]': (Furniture, lambda record: {'room': {'furniture': [
              {'at': [0, 0], 'size': [1, 1, 1]}, dict({'at': [1, 1], 'size': [1, 1, 1]}, **record)]}}),
          'scenario.robot': (Robot, lambda record: {'robot': record}),
          'scenario.robot.cameras[1]': (Mount, lambda record: {'robot': {'cameras': [
              dict({'name': 'front'}, **record)]}}),
          'scenario.robot.drive': (Drive, lambda record: {'robot': {'drive': record}}),
          'scenario.robot.follow': (Follow, lambda record: {'people': [{'start': [1, 1]}], 'robot': {
              'follow': dict({'person': 1}, **record)}}),
          'scenario.people[1]': (Person, lambda record: {'people': [dict({'start': [1, 1]}, **record)]}),
          'scenario.people[1].moves[1]': (Move, lambda record: {'people': [{'start': [1, 1], 'moves': [
              dict({'wait': 1.0}, **record)]}]})}
KEYS = [(where, name) for where, (kind, _wrap) in PLACES.items() for name in kind._fields]


def error_of(content):
    with pytest.raises(ValueError) as caught:
        scenario_from(content)
    return str(caught.value)


def content_with(where, name, value):
    return PLACES[where][1]({name: value})


@pytest.mark.parametrize('where,name', KEYS)
def test_errors_name_the_path_of_a_key(where, name):
    text = error_of(content_with(where, name + 'x', 1))
    assert text == 'unknown key %s.%sx; did you mean %s.%s?' % (where, name, where, name)
    for value in (None, 'much', '1.0', object(), float('nan'), float('inf'), [[1]], [1, 'a', 2], {'a': 1}, {1: 2}):
        is_optional = PLACES[where][0]._field_defaults.get(name, 0) is None
        if name == 'name' and value == 'much' or value is None and is_optional:
            continue
        text = error_of(content_with(where, name, value))
        assert re.match(r'(unknown key )?' + re.escape('%s.%s' % (where, name)), text)
        assert 'expected' in text or 'did you mean' in text


SCENARIO = scenario_from({
    'duration': 6.0,
    'room': {'bounds': [-1, 8, -3, 3], 'furniture': [{'at': [4, 1], 'size': [0.5, 0.4, 1.7], 'yaw': 0.3}]},
    'people': [{'start': [3, -1], 'facing': 1.0, 'moves': [{'wait': 1.0}, {'to': [3, 1], 'speed': 1.1}]},
               {'start': [5, 0]}]})


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


PAGE = pathlib.Path(__file__).resolve().parents[2] / 'config' / 'scenarios' / 'README.md'


def test_the_examples_of_a_scenario_are_valid(tmp_path):
    """The whole file, and with its alternatives, which are comments."""
    text = PAGE.read_text(encoding='utf-8')
    example, = re.findall(r'```yaml\n(.*?)```', text, re.DOTALL)
    path = tmp_path / 'example.yaml'
    path.write_text(example.replace('rooms/', str(PAGE.parent / 'rooms') + '/'))
    assert len(read_scenario(str(path)).objects) == 4
    content = load_yaml(re.sub(r'^( *)# (?!Description)', r'\1', example, flags=re.MULTILINE))
    moves = {name: load_yaml(move.replace('[x, y]', '[1.0, 0.5]'))
             for move in re.findall(r'^\| `(\{.*?\})`', text, re.MULTILINE) for name in re.findall(r'^\{(\w+)', move)}
    robot = {key: value for key, value in content['robot'].items() if key not in ('repeat', 'mount', 'pitch')}
    for other in ({'moves': [moves['to'], moves['turn'], {'wait': 1.0}]}, {'follow': robot.pop('follow')}):
        scenario_from(dict(content, robot=dict(robot, **other), people=[
            dict(content['people'][0], moves=[moves['to'], moves['wait']])]))


AHEAD = CameraView(np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0.27], [0, 0, 0, 1.0]]))  # looks along x


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
