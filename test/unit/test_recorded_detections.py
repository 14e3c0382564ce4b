"""Recorded 3D detections as runs of the tracking benchmark."""
import json

import numpy as np
import pytest

from ros_3d_bb.estimation.error_model import write_error_model
from ros_3d_bb.tracking.types import OUT_OF_VIEW, VISIBLE, TrackedObject
from ros_3d_bb_lab.evaluation import __main__ as command
from ros_3d_bb_lab.evaluation.tracking import benchmark
from ros_3d_bb_lab.evaluation.tracking.detection_generator import FALSE
from ros_3d_bb_lab.evaluation.tracking.recorded_detections import START_NS, read_recordings, with_sources
from ros_3d_bb_lab.evaluation.tracking.run_generator import HORIZONS_S
from support.error_models import MODEL
from support.recordings import CAMERA_MPS, IMAGES, SPEED_MPS, write_recording


def track(place_m):
    return TrackedObject(1, np.append(place_m, 1.0), np.ones(3), None, None, VISIBLE, True, 0, 0, None, 0.25)


def test_detections_and_truth_are_in_the_fixed_frame(tmp_path):
    run, = read_recordings(str(write_recording(tmp_path / 'one')))
    assert (run.name, len(run.images)) == ('one', IMAGES)
    for number, image in enumerate(run.images):
        place_m = 8 + SPEED_MPS * number / 10.0, 0.0
        assert image.stamp_ns == START_NS + number * 10 ** 8
        assert np.allclose(image.detections[0].position_m, place_m + (1.0,))
        assert image.detections[0].score == 0.9 and image.detections[0].covariance_m2 is None
        assert np.allclose(image.truth.position_m[0], place_m)
        assert image.truth.status.tolist() == [VISIBLE, OUT_OF_VIEW]
        assert np.allclose(image.truth.velocity_mps[0], (SPEED_MPS, 0), atol=1e-6)
        known = number / 10.0 + HORIZONS_S <= (IMAGES - 1) / 10.0 + 1e-9
        future_m = image.truth.future_m[0]
        assert np.isfinite(future_m).all(axis=1).tolist() == known.tolist()
        assert np.allclose(future_m[known, 0], place_m[0] + SPEED_MPS * HORIZONS_S[known])


def test_without_odometry_everything_moves_towards_the_camera(tmp_path):
    run, = read_recordings(str(write_recording(tmp_path / 'one')), with_odometry=False)
    last = run.images[-11]
    time_s = (IMAGES - 11) / 10.0
    assert np.allclose(last.view.fixed_from_camera, run.images[0].view.fixed_from_camera)
    place_m = 8 + (SPEED_MPS - CAMERA_MPS) * time_s
    assert np.allclose(last.detections[0].position_m, (place_m, 0, 1))
    assert np.allclose(last.truth.position_m[0], (place_m, 0))
    assert np.allclose(last.truth.velocity_mps[0], (SPEED_MPS - CAMERA_MPS, 0), atol=1e-6)
    assert np.allclose(last.truth.future_m[0, 1], (place_m + SPEED_MPS - CAMERA_MPS, 0))


@pytest.mark.parametrize('score,probability', [('3.32', 0.5), ('0.7', 0.7)])
def test_scores_are_probabilities_or_those_of_pointrcnn(tmp_path, score, probability):
    run, = read_recordings(str(write_recording(tmp_path / 'one', score)))
    assert run.images[0].detections[0].score == pytest.approx(probability)


@pytest.mark.parametrize('place_m,ignored,is_scored', [
    ((12.0, 0.0), '', True), ((41.0, 0.0), '', False), ((-3.0, 0.0), '', False), ((5.0, 4.0), '', False),
    ((10.5, 2.0), '', False),  # a person who does not count
    ((12.0, 0.0), 'Cyclist,12.5,0,1,0,0,0,0', False), ((12.0, 0.0), 'Cyclist,13.5,0,1,0,0,0,0', True),
    ((12.0, 0.0), 'DontCare,nan,nan,nan,300,200,340,280', False),
    ((12.0, 0.0), 'DontCare,nan,nan,nan,340,200,400,280', True)])
def test_false_tracks_count_where_the_recording_is_annotated(tmp_path, place_m, ignored, is_scored):
    run, = read_recordings(str(write_recording(tmp_path / 'one', ignored=ignored)))
    assert run.in_scored_area(run.images[0], [track(place_m)]).tolist() == [is_scored]
    assert run.in_scored_area(run.images[0], []).tolist() == []


@pytest.mark.parametrize('name,content,message', [
    ('camera.json', '{"width": 640}', 'camera.json: not a camera'),
    ('truth.csv', 't_s,id\n', 'truth.csv has the columns t_s,id; t_s,id,x_m'),
    ('detections.csv', 't_s,x_m,y_m,z_m,width_m,height_m,score\n0,1,2,x,1,1,1\n', 'detections.csv, line 2: 0,1,2,x')])
def test_invalid_files_are_named(tmp_path, name, content, message):
    folder = write_recording(tmp_path / 'one')
    (folder / name).write_text(content)
    with pytest.raises(ValueError, match=message):
        list(read_recordings(str(folder)))


@pytest.mark.needs('norfair', 'trackeval')
def test_the_command_scores_recorded_detections(tmp_path, capsys):
    write_recording(tmp_path / 'one')
    path = tmp_path / 'scores.json'
    command.main(['tracking', '--detections', str(tmp_path / 'one'), '--json', str(path)])
    scores = json.loads(path.read_text())['trackers']
    assert scores['ours']['recall'] > 80 and scores['ours']['precision'] == 100
    assert 'coverage_95_2s' in capsys.readouterr().out


def test_boxes_show_the_nearest_people_one_to_one(tmp_path):
    run, = read_recordings(str(write_recording(tmp_path / 'one')))
    image = run.images[0]
    person, place_m = image.truth.ids[0], np.append(image.truth.position_m[0], 1.0)
    box = image.detections[0]
    boxes = [box._replace(position_m=place_m + (0, offset_m, 0)) for offset_m in (0.3, 0.1, 0.7)]
    run = run._replace(images=(image._replace(detections=boxes), image._replace(detections=[])))
    assert [image.sources for image in with_sources(run).images] == [[FALSE, person, FALSE], []]


@pytest.mark.needs('trackeval')
def test_the_command_compares_rates_with_perfect_association(monkeypatch, tmp_path, capsys):
    """Of one person, perfect association is not better than ours."""
    write_recording(tmp_path / 'one')
    monkeypatch.delenv('ROS_3D_BB_DATA', raising=False)
    monkeypatch.setattr(benchmark, 'PEDESTRIANS_EVERY', (10,))
    monkeypatch.setattr(benchmark, 'RECORDINGS_EVERY', (1, 2))
    path = tmp_path / 'scores.json'
    command.main(['tracking', '--rates', '--seconds', '2', '--repetitions', '1', '--detections', str(tmp_path / 'one'),
                  '--json', str(path)])
    result = json.loads(path.read_text())
    assert list(result['pedestrians']) == ['3.0'] and list(result['recorded_detections']) == ['10.0', '5.0']
    for scores in result['recorded_detections'].values():
        assert set(scores) == {'ours', 'perfect_association'} and set(scores['ours']) == {'hota', 'idf1', 'id_switches'}
        assert scores['ours']['hota'] > 50 and scores['ours']['id_switches'] == 0
        assert scores['perfect_association'] == pytest.approx(scores['ours'], abs=1e-6)
    assert 'recorded_detections  10.0 Hz  perfect_association' in capsys.readouterr().out


@pytest.mark.needs('norfair', 'trackeval')
def test_the_command_uses_an_error_model(tmp_path):
    """The boxes are right; a model with a bias of 1 m moves them away from the person."""
    write_recording(tmp_path / 'one')
    write_error_model(tmp_path / 'model.yaml', MODEL._replace(
        z_bias=(1.0,), measured_range=MODEL.measured_range._replace(z_min_m=1.5, x_z_min_m=1.5)))
    path = tmp_path / 'scores.json'
    command.main(['tracking', '--detections', str(tmp_path / 'one'), '--json', str(path), '--error-model',
                  str(tmp_path / 'model.yaml')])
    scores = json.loads(path.read_text())
    assert scores['error_model'] == str(tmp_path / 'model.yaml') and scores['trackers']['ours']['recall'] == 0
