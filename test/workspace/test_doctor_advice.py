"""Advice is executed literally: after the doctor's `next:`, positions are as good as those of a sound bag, or the
doctor names the fault and gives no `next:`. It finds no faults only if process_bag gives tracks.
"""
import os
import shlex

import numpy as np
import pytest

from ros_3d_bb.bags import process_bag
from ros_3d_bb.conversions.perception_msgs import stamp_of, tracks_from_msg
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.nodes import doctor
from ros_3d_bb.tracking.types import VISIBLE
from support import broken_bags as broken
from support.bags import changed_bag, messages_in, scene_bag
from support.commands import run

pytestmark = pytest.mark.slow
PEOPLE = [{'start': [3.4, 0.9], 'moves': [{'to': [3.4, -0.9]}]}, {'start': [4.4, -1.0], 'moves': [{'to': [4.4, 1.0]}]}]
SCENES = {'level': {'mount': [0.0, 0.0, 0.2]}, 'tilted': {'mount': [0.0, 0.0, 1.2], 'pitch': 0.35},
          'moving': {'mount': [0.0, 0.0, 0.2], 'pose': [-0.5, 0.2, 0.1], 'moves': [{'to': [0.8, 0.2]}]}}
FAR_M = 1.0  # a person without a track counts as this far
BEGIN_NS, END_NS = 6 * NS // 5, 2 * NS // 5  # not compared: tracks start, and later transforms are missing
SLACK_M = 0.03
STEPS = 3  # that are followed


@pytest.fixture(scope='module')
def sound(tmp_path_factory):
    """{scene: path, position error of its tracks} of the sound bags."""
    folder, bags = tmp_path_factory.mktemp('sound'), {}
    for name, robot in SCENES.items():
        path = scene_bag(folder / (name + '.bag'), {'duration': 3.0, 'rate': 10.0, 'robot': robot, 'people': PEOPLE},
                         with_boxes=True)
        bags[name] = path, error_after(path, folder)
    return bags


def execute(command, folder):
    """Run a command line of the doctor in a folder, without its report. Returns what it prints."""
    printed, before = '', os.getcwd()
    os.chdir(str(folder))
    try:
        for part in command.split(' && '):
            words = shlex.split(part)
            if words[0] == 'echo':
                with open(words[3], 'w') as stream:
                    stream.write(words[1])
            elif words[2] != 'scene_report':
                main = {'doctor': doctor.main, 'process_bag': process_bag.main}[words[2]]
                _status, printed = run(main, *words[3:])
    finally:
        os.chdir(before)
    return printed


def steps(bag, folder):
    """Follow the doctor from a bag. Returns its first output, and the commands of each `next:`."""
    commands, printed = [], []
    command = 'rosrun ros_3d_bb doctor ' + bag
    while command and len(commands) <= STEPS and 'scene_report %s' % bag not in command:
        commands.append(command)
        printed.append(execute(command, folder))
        command = ''.join(line[len('next: '):] for line in printed[-1].splitlines() if line.startswith('next: '))
    return printed, commands[1:]


def error_of(path):
    """RMS position error of the people in view in a bag with tracks, in metres; FAR_M for people without a track."""
    found = messages_in(path, broken.TRUTH, '/ros_3d_bb/tracks') if os.path.exists(str(path)) else {}
    if '/ros_3d_bb/tracks' not in found:
        return FAR_M
    squares, tracks = [], found['/ros_3d_bb/tracks']
    stamps_ns = np.array([stamp_of(message) for message in tracks])
    truths = found[broken.TRUTH]
    for truth in truths:
        if not stamp_of(truths[0]) + BEGIN_NS <= stamp_of(truth) <= stamp_of(truths[-1]) - END_NS:
            continue
        gaps_ns = np.abs(stamps_ns - stamp_of(truth))
        nearest = tracks_from_msg(tracks[gaps_ns.argmin()]) if gaps_ns.min() < NS // 20 else []
        tracks_m = [track.position_m[:2] for track in nearest if track.status == VISIBLE]
        for person in tracks_from_msg(truth):
            if person.status == VISIBLE:
                distances_m = [np.linalg.norm(person.position_m[:2] - track_m) for track_m in tracks_m]
                squares.append(min(distances_m + [FAR_M]) ** 2)
    return float(np.sqrt(np.mean(squares)))


def error_after(bag, folder, *options):
    """The position error after process_bag, in the usual way or with options."""
    run(process_bag.main, bag, str(folder / 'plain.bag'), '--detector', 'depth', *options)
    return error_of(folder / 'plain.bag')


B = broken
SPOT = {'map': 'vision', 'base_link': 'body', B.OPTICAL: 'frontleft_fisheye'}
# Each fault: the scene, the change, and the subject of the fault that is named; '' if there is none, or the next
# command corrects it.
CASES = {
    'sound, tilted': ('tilted', B.whole, ''), 'sound, moving': ('moving', B.whole, ''),
    'K six times too large': ('level', B.each(B.INFOS, lambda message: B.with_matrix(message, 6)), 'camera'),
    'vision, body': ('tilted', B.with_frames(SPOT), ''),
    'stamps 0.8 s ahead': ('level', B.delayed(B.IMAGES, 0.8), 'transforms'),
    'tf 3 s ahead': ('moving', B.tf_delayed(3.0), 'transforms'),
    'names of another driver': ('level', B.of_another_driver, ''),
    'no tf, tilted': ('tilted', B.without('/tf'), ''), 'depth 0.25 mm': ('level', B.with_unit(4), 'depth unit'),
    'wrong frame, moving': ('moving', B.in_frame('camera_rgb_optical_frame'), ''),
    'depth 0.2 s ahead': ('level', B.delayed([B.DEPTH], 0.2), 'pairs'),
    'depth 20 ms late': ('level', B.delayed([B.DEPTH], 0.02), ''), 'no colour': ('level', B.without(B.COLOR), ''),
    'aligned depth in its own frame': ('level', B.in_the_frame_of_depth, ''),
    'depth beside colour': ('level', B.each([B.DEPTH], B.shifted), 'alignment')}


@pytest.mark.parametrize('name', sorted(CASES))
def test_positions_are_right_after_the_advice_or_the_fault_is_named(sound, tmp_path, name):
    scene, change, subject = CASES[name]
    bag = changed_bag(sound[scene][0], tmp_path / 'bag.bag', change)
    printed, commands = steps(bag, tmp_path)
    faults = [line.split(':')[0][len('wrong'):].strip() for line in printed[0].splitlines() if line.startswith('wrong')]
    if subject:
        assert subject in faults and not commands
    else:
        assert 'process_bag' in commands[-1]
        assert error_of(tmp_path / 'tracked.bag') < sound[scene][1] + SLACK_M
