import json
import os

import numpy as np
import pytest

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.estimation import box3d_estimator, depth_samples
from ros_3d_bb_lab.evaluation import __main__ as command
from ros_3d_bb_lab.evaluation.ablation.benchmark import MECHANISMS, Mechanism, ablate, check
from ros_3d_bb_lab.evaluation.navigation.navigation_scenes import DURATION_S, SCENES, scenario_of
from ros_3d_bb_lab.evaluation.navigation.trial_result import Pace
from ros_3d_bb_lab.evaluation.tracking.recorded_detections import read_recordings
from ros_3d_bb_lab.evaluation.video.recording import Person, read_truth, read_video
from ros_3d_bb_lab.evaluation.video.scores import compare
from ros_3d_bb_lab.evaluation.video.simulated_video import SCENE, write_simulated_video
from ros_3d_bb_lab.simulation.scenario import scenario_from
from support.tracks import track_at

CAMERA = {'width': 640, 'height': 480, 'fx': 600.0, 'fy': 600.0, 'cx': 319.5, 'cy': 239.5}
FORWARD = '-0.5,0.5,-0.5,0.5'  # the camera looks along x of the fixed frame
SPEED_MPS, CAMERA_MPS, IMAGES = 0.5, 1.0, 31


def write_recording(folder, ignored=''):
    """A camera that drives along x, 10 images a second; a person ahead, and one who does not count at the side."""
    folder.mkdir()
    (folder / 'camera.json').write_text(json.dumps(CAMERA))
    tables = {'poses': ['t_s,x_m,y_m,z_m,qx,qy,qz,qw'], 'ignored': ['t_s,kind,x_m,y_m,z_m,x1_px,y1_px,x2_px,y2_px'],
              'detections': ['t_s,x_m,y_m,z_m,width_m,height_m,score'],
              'truth': ['t_s,id,x_m,y_m,z_m,width_m,height_m,counts']}
    for number in range(IMAGES):
        time_s, camera_m, person_m = number / 10.0, CAMERA_MPS * number / 10.0, 8 + SPEED_MPS * number / 10.0
        tables['poses'].append('%.1f,%g,0,1,%s' % (time_s, camera_m, FORWARD))
        tables['detections'].append('%.1f,0,0,%g,0.5,1.7,0.9' % (time_s, person_m - camera_m))
        tables['truth'] += ['%.1f,7,%g,0,1,0.5,1.7,1' % (time_s, person_m), '%.1f,8,10,2,1,0.5,1.7,0' % time_s]
        tables['ignored'] += ['%.1f,%s' % (time_s, ignored)] if ignored else []
    for name, lines in tables.items():
        (folder / (name + '.csv')).write_text('\n'.join(lines) + '\n')
    return folder


@pytest.mark.parametrize('place_m,ignored,is_scored', [
    ((12.0, 0.0), '', True), ((41.0, 0.0), '', False), ((-3.0, 0.0), '', False), ((5.0, 4.0), '', False),
    ((10.5, 2.0), '', False),  # a person who does not count
    ((12.0, 0.0), 'Cyclist,12.5,0,1,0,0,0,0', False), ((12.0, 0.0), 'Cyclist,13.5,0,1,0,0,0,0', True),
    ((12.0, 0.0), 'DontCare,nan,nan,nan,300,200,340,280', False),
    ((12.0, 0.0), 'DontCare,nan,nan,nan,340,200,400,280', True)])
def test_false_tracks_count_where_the_recording_is_annotated(tmp_path, place_m, ignored, is_scored):
    run, = read_recordings(str(write_recording(tmp_path / 'one', ignored=ignored)))
    assert run.in_scored_area(run.images[0], [track_at(place_m + (1.0,), (0, 0, 0))]).tolist() == [is_scored]
    assert run.in_scored_area(run.images[0], []).tolist() == []


@pytest.mark.needs('norfair', 'trackeval')
def test_the_command_scores_recorded_detections(tmp_path, capsys):
    write_recording(tmp_path / 'one')
    path = tmp_path / 'scores.json'
    command.main(['tracking', '--detections', str(tmp_path / 'one'), '--json', str(path)])
    scores = json.loads(path.read_text())['trackers']
    assert scores['ours']['recall'] > 80 and scores['ours']['precision'] == 100
    assert 'coverage_95_2s' in capsys.readouterr().out


TIMES_S = np.arange(0, 6, 0.02)
WALK_M = np.column_stack((1.2 * TIMES_S, np.zeros(len(TIMES_S))))


def test_the_command_writes_scores_by_kind(tmp_path):
    (tmp_path / 'walking').mkdir()
    lines = ['%d,%g,%g,%g' % ((row, time_s) + tuple(point_m)) for row, (time_s, point_m)
             in enumerate(zip(TIMES_S, WALK_M))]
    (tmp_path / 'walking' / '1.csv').write_text('\n'.join([',timestamp,x,y'] + lines))
    command.main(['prediction', '--data', str(tmp_path), '--json', str(tmp_path / 'scores.json')])
    scores = json.loads((tmp_path / 'scores.json').read_text())['walking']
    assert {'coverage_95_2s', 'ours_fde_2s_m', 'cv_fde_2s_m', 'area_95_2s_m2'} <= set(scores)
    assert set(scores['rates']) == {'30', '15', '10', '5', '3'}
    assert scores['rates']['10']['true']['ours_fde_2s_m'] == scores['ours_fde_2s_m'] < 0.1
    assert scores['rates']['10']['noise_5cm']['ours_fde_2s_m'] > scores['ours_fde_2s_m']
    assert scores['standing'] == 0 and scores['standing_coverage_95_2s'] is None


SHOWN, HALF_HIDDEN = Person(1, (10, 10, 50, 110), 0.9), Person(2, (100, 10, 120, 110), 0.3)


@pytest.mark.parametrize('rect,found,false', [
    ((10, 10, 50, 100), 1, 0), ((10, 10, 50, 50), 0, 1),  # IoU 0.9 and 0.4
    ((95, 10, 125, 110), 0, 0), ((60, 10, 125, 110), 0, 1)])  # 67 % and 31 % of the box on a person not scored
def test_boxes_are_found_false_or_not_scored(rect, found, false):
    pairs = compare([SHOWN, HALF_HIDDEN], [rect])
    assert (len(pairs.people), len(pairs.found), pairs.false) == (1, found, false)
    assert compare([], []).false == 0


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


@pytest.mark.parametrize('name', sorted(SCENES))
def test_scenes_are_valid_and_depend_on_the_seed_only(name):
    contents = [scenario_of(name, seed) for seed in range(1, 21)]
    assert contents[0] == scenario_of(name, 1)
    assert len(set(map(str, contents))) == 20
    for content in contents:
        scenario = scenario_from(content)
        assert scenario.duration == DURATION_S and len(scenario.people) >= 1


@pytest.mark.parametrize('mechanism', MECHANISMS, ids=lambda mechanism: mechanism.name)
def test_each_mechanism_exists(mechanism):
    check(mechanism)


def test_a_mechanism_is_off_wherever_it_is_imported_and_on_again_afterwards():
    mechanism = Mechanism('reach of a body', 'estimation.depth_samples', 'BODY_HALF_DEPTH_MM', 7)

    def reaches_mm():
        return {'here': depth_samples.BODY_HALF_DEPTH_MM, 'there': box3d_estimator.BODY_HALF_DEPTH_MM}
    before_mm = reaches_mm()
    assert ablate([reaches_mm, reaches_mm], [mechanism]) == {
        '': {key: 2 * value for key, value in before_mm.items()}, 'reach of a body': {'here': 14, 'there': 14}}
    assert reaches_mm() == before_mm


LEAD_NS = int(Pace.LEAD_S * NS)


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
