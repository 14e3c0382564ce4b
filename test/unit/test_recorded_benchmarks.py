import json

import numpy as np
import pytest

from ros_3d_bb_lab.evaluation import __main__ as command
from ros_3d_bb_lab.evaluation.tracking.recorded_detections import read_recordings
from support.tracks import track_at

CAMERA = {'width': 640, 'height': 480, 'fx': 600.0, 'fy': 600.0, 'cx': 319.5, 'cy': 239.5}
FORWARD = '-0.5,0.5,-0.5,0.5'  # the camera looks along x of the fixed frame
SPEED_MPS, CAMERA_MPS, IMAGES = 0.5, 1.0, 31


def write_recording(folder, scores='0.9', ignored=''):
    """A camera that drives along x, 10 images a second; a person ahead, and one who does not count at the side."""
    folder.mkdir()
    (folder / 'camera.json').write_text(json.dumps(CAMERA))
    tables = {'poses': ['t_s,x_m,y_m,z_m,qx,qy,qz,qw'], 'ignored': ['t_s,kind,x_m,y_m,z_m,x1_px,y1_px,x2_px,y2_px'],
              'detections': ['t_s,x_m,y_m,z_m,width_m,height_m,score'],
              'truth': ['t_s,id,x_m,y_m,z_m,width_m,height_m,counts']}
    for number in range(IMAGES):
        time_s, camera_m, person_m = number / 10.0, CAMERA_MPS * number / 10.0, 8 + SPEED_MPS * number / 10.0
        tables['poses'].append('%.1f,%g,0,1,%s' % (time_s, camera_m, FORWARD))
        tables['detections'].append('%.1f,0,0,%g,0.5,1.7,%s' % (time_s, person_m - camera_m, scores))
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
