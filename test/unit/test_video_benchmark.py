import json
import os

import pytest

from ros_3d_bb_lab.evaluation import __main__ as command
from ros_3d_bb_lab.evaluation.video.recording import Person, read_truth, read_video
from ros_3d_bb_lab.evaluation.video.scores import compare
from ros_3d_bb_lab.evaluation.video.simulated_video import SCENE, write_simulated_video

SHOWN, HALF_HIDDEN = Person(1, (10, 10, 50, 110), 0.9), Person(2, (100, 10, 120, 110), 0.3)


@pytest.mark.parametrize('rect,found,false', [
    ((10, 10, 50, 100), 1, 0), ((10, 10, 50, 50), 0, 1),  # IoU 0.9 and 0.4
    ((95, 10, 125, 110), 0, 0), ((60, 10, 125, 110), 0, 1)])  # 67 % and 31 % of the box on a person not scored
def test_boxes_are_found_false_or_not_scored(rect, found, false):
    pairs = compare([SHOWN, HALF_HIDDEN], [rect])
    assert (len(pairs.people), len(pairs.found), pairs.false) == (1, found, false)
    assert compare([], []).false == 0


def test_two_boxes_of_one_person_are_one_false_box():
    pairs = compare([SHOWN], [(12, 10, 50, 110), (10, 10, 50, 110)])
    assert pairs.found == [(SHOWN, 1)] and pairs.false == 1


@pytest.fixture(scope='module')
def video_folder(tmp_path_factory):
    return write_simulated_video(str(tmp_path_factory.mktemp('video')), SCENE._replace(duration=3.2))


@pytest.mark.slow
@pytest.mark.needs('norfair', 'trackeval')
def test_the_command_scores_a_video(video_folder, tmp_path):
    path, pictures = tmp_path / 'scores.json', tmp_path / 'pictures'
    command.main(['video', '--data', video_folder, '--weights', '--json', str(path), '--pictures', str(pictures)])
    row = json.loads(path.read_text())['depth']
    assert row['recall'] > 0.9 and row['precision'] > 0.9 and row['false_tracks_per_image'] == 0
    assert row['id_switches'] == 0 and row['ids'] == len(row['people']) == 2
    assert row['idf1'] > 80 and row['norfair']['idf1'] > 50 and 0 < row['hota'] <= 100
    assert row['published'] > 0.8 and row['jump_ratio'] < 2
    assert len(os.listdir(str(pictures / 'depth'))) == len(os.listdir(os.path.join(video_folder, 'color'))) == 16


@pytest.mark.slow
@pytest.mark.parametrize('content', ['{', '[]', '{"rate": 5, "frames": {}}', '{"rate": 5, "frames": {"999": []}}',
                                     '{"rate": 5, "frames": {"000": [{"id": 1}]}}'])
def test_an_invalid_truth_is_named(video_folder, tmp_path, content):
    (tmp_path / 'truth.json').write_text(content)
    with pytest.raises(ValueError, match='truth.json'):
        read_truth(str(tmp_path / 'truth.json'), read_video(video_folder))
