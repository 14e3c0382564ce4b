"""Scene and script of doc/error_model.md; other tests run its commands."""
import os
import re
import subprocess
import sys

import yaml

from ros_3d_bb.sessions.session_reader import read_session
from ros_3d_bb_lab.simulation.scenario import scenario_from
from support.pages import DOC
from support.small_session import change_json, write_small_session

SCRIPTS = {'yaml': [], 'python': []}
with open(os.path.join(DOC, 'error_model.md'), encoding='utf-8') as stream:
    for language, text in re.findall(r'^```(yaml|python)\n(.*?)^```$', stream.read(), re.MULTILINE | re.DOTALL):
        SCRIPTS[language].append(text)


def test_the_scene_is_valid():
    person, = scenario_from(yaml.safe_load(SCRIPTS['yaml'][0])).people
    assert person.start == (1.67, 0.6) and len(person.moves) == 5


def test_the_script_sets_the_truth_of_the_marks_and_rejects_measurements_without_boxes(tmp_path):
    folder = write_small_session(str(tmp_path / 'campaign'))

    def label(content):
        for frame, name in zip(content['frames'], ('A1', 'B3', 'C6', 'B2')):
            frame['label'] = name
        content['frames'][3]['detections'] = []
    change_json(folder, label)
    script, = SCRIPTS['python']
    subprocess.check_call([sys.executable, '-c', script], env=dict(os.environ, HOME=str(tmp_path)))
    assert [frame.truth_m.tolist() for frame in read_session(folder).frames] == [
        [-0.6, 1.5], [0.0, 2.5], [0.6, 5.0]]
