"""The pipeline on simulated scenes, against exact truth, with each detector.

The weight-free detector always runs. YOLOv5 runs where ROS_3D_BB_DATA has its weights; without them the boxes of the
truth stand in for it, so that estimator and tracker are tested all the same.
"""
import glob
import json
import os

import numpy as np
import pytest

from conftest import DATA
from ros_3d_bb.estimation.error_model import read_error_model
from ros_3d_bb_lab.evaluation.clear_mot import score
from ros_3d_bb_lab.evaluation.scene_benchmark import (RANGE_M, depth_detector, exact_detector, main, result_of,
                                                      yolov5_detector)
from ros_3d_bb_lab.evaluation.scenes import detect_in_scene, run_scene, score_detections
from ros_3d_bb_lab.simulation.scenario import read_scenario
from ros_3d_bb_lab.simulation.simulator import Simulator

FOLDER = os.path.join(os.path.dirname(os.path.abspath(__file__)), os.pardir, os.pardir, 'config', 'scenarios')
SCENES = sorted(os.path.basename(path) for path in glob.glob(os.path.join(FOLDER, '*.yaml')))
THESIS_SCENES = [name for name in SCENES if name.startswith('thesis_')]
APPROACHES = {'approach_jackal.yaml': (0.265, 1.75), 'approach_child.yaml': (0.265, 1.15),
              'approach_high_mount.yaml': (1.0, 1.75), 'approach_tall.yaml': (1.0, 1.95)}  # heights: camera, person
ERROR_MODEL = os.path.join(FOLDER, os.pardir, 'error_models', 'simulated_d435i.yaml')
# Of the 15 images a second, so that as many remain as a small computer manages: 7.5 and 5 a second.
EVERY = {'depth': 2, 'yolov5': 3}
OTHERS_EVERY = {'depth': 6, 'yolov5': 12}  # in the scenes where only detections count


@pytest.fixture(scope='module')
def yolov5():
    if not DATA:
        return lambda frame: [person.box_px for person in frame.people if person.visible > 0.3]
    return yolov5_detector(os.path.join(DATA, 'weights', 'yolov5n.pt'))


@pytest.fixture(scope='module')
def runs(yolov5):
    """The steps of each scene with each detector: {(detector, scene): steps}."""
    found = {}
    for name in SCENES:
        simulator = Simulator(read_scenario(os.path.join(FOLDER, name)))
        every = EVERY if name in THESIS_SCENES else OTHERS_EVERY
        found['depth', name] = run_scene(simulator, depth_detector(simulator), every['depth'])
        found['yolov5', name] = run_scene(simulator, yolov5, every['yolov5'])
    return found


def test_there_are_the_scenes_that_the_package_promises():
    assert len(THESIS_SCENES) == 6
    assert set(APPROACHES) == set(name for name in SCENES if name.startswith('approach_'))
    assert {'crowd_of_12.yaml', 'corridor.yaml', 'behind_a_pillar.yaml', 'turning_robot.yaml',
            'empty_room.yaml'} <= set(SCENES)


@pytest.mark.slow
@pytest.mark.parametrize('detector', ['yolov5', 'depth'])
@pytest.mark.parametrize('name', THESIS_SCENES)
def test_everybody_in_the_thesis_scenes_gets_one_number_and_keeps_it(runs, name, detector):
    """Everybody who is visible for a second. Nobody is published before the fourth sighting, which at 5 to 7.5 images a
    second, and at the end of the weight-free detector's range, takes a while."""
    result = score([step.moment for step in runs[detector, name]])
    assert len(result.people) == 4
    for person in result.people:
        assert person.longest_s >= 1 and len(person.ids) == 1, person
        assert person.followed > 0.8 and person.rmse_m < 0.25, person
    assert len(set(person.ids[0] for person in result.people)) == 4


@pytest.mark.parametrize('detector,recall,false_rate', [('yolov5', 0.95, 0.05), ('depth', 0.90, 0.05)])
def test_detectors_find_people_and_nothing_else(runs, detector, recall, false_rate):
    """People of whom 80 % are visible, in all scenes, at 2 to 8 m (YOLOv5) or 2 to 6 m (weight-free)."""
    scores = [score_detections(runs[detector, name], *RANGE_M[detector]) for name in SCENES]
    people, found, false, images = (sum(column) for column in zip(*scores))
    assert people > 500
    assert found >= recall * people
    assert false <= false_rate * images


def test_nobody_is_found_in_an_empty_room(runs):
    steps = runs['depth', 'empty_room.yaml']
    assert sum(len(step.boxes) for step in steps) <= 0.05 * len(steps)


def test_the_benchmark_says_what_the_scores_say(runs):
    result = result_of(runs['depth', 'thesis_e_passing.yaml'], 'depth')
    tracked = score([step.moment for step in runs['depth', 'thesis_e_passing.yaml']])
    assert result['people'] == 4 and result['id_switches'] == 0 and result['images'] == 90
    assert result['worst_m'] == max(person.worst_m for person in tracked.people)
    empty = result_of(runs['depth', 'empty_room.yaml'], 'depth')
    assert empty['people'] == 0 and empty['rmse_m'] is None and empty['recall'] == 1.0


@pytest.fixture
def approach():
    return Simulator(read_scenario(os.path.join(FOLDER, 'approach_jackal.yaml')))


@pytest.mark.slow
@pytest.mark.parametrize('name', sorted(APPROACHES))
def test_somebody_comes_within_half_a_metre_stays_for_two_seconds_and_goes(name):
    camera_m, person_m = APPROACHES[name]
    simulator = Simulator(read_scenario(os.path.join(FOLDER, name)))
    times_s = [simulator.time_s(number) for number in range(simulator.frame_count)]
    cameras_m = np.array([simulator.poses_at(time_s).map_from_camera[:3, 3] for time_s in times_s])
    people_m = np.array([simulator.positions_at(time_s)[0] for time_s in times_s])
    distances_m = np.linalg.norm(people_m - cameras_m[:, :2], axis=1)
    assert cameras_m[:, 2] == pytest.approx(camera_m)
    assert simulator.scenario.people[0].height == person_m
    assert distances_m.min() == pytest.approx(0.5, abs=1e-6) and distances_m[[0, -1]].min() > 3.5
    assert 1.5 <= np.count_nonzero(distances_m < 0.51) / simulator.rate <= 2.5


def test_exact_boxes_are_the_true_ones_with_a_jitter_that_is_the_same_each_time(approach):
    jitters_px = []
    for number in range(0, 285, 19):
        frame = approach.frame(number)
        boxes, again = (exact_detector(approach)(frame) for _time in range(2))
        assert boxes.tolist() == again.tolist() and boxes.shape == (1, 4)
        assert (boxes >= 0).all() and (boxes <= [640, 480] * 2).all() and (boxes == np.rint(boxes)).all()
        inside = (np.array(frame.people[0].box_px) > 4) & (np.array(frame.people[0].box_px) < [636, 476] * 2)
        jitters_px += list((boxes[0] - frame.people[0].box_px)[inside])
    assert len(jitters_px) > 25 and 0.7 < np.std(jitters_px) < 1.4 and np.abs(jitters_px).max() <= 4


def test_exact_boxes_have_the_covariance_of_the_error_model(approach):
    """In the map, whose x is the range of a camera that looks along it: as the model says at 3.7 m."""
    model = read_error_model(ERROR_MODEL)
    plain = next(detect_in_scene(approach, exact_detector(approach)))
    image = next(detect_in_scene(approach, exact_detector(approach), error_model=model))
    (before,), (detection,) = plain.detections, image.detections
    assert before.covariance_m2 is None
    camera_m = image.step.frame.poses.map_from_camera[:3, 3]
    x_m, y_m, z_m = detection.position_m - camera_m
    expected, = model.covariance(np.array([(-y_m, -z_m, x_m)]))
    assert detection.covariance_m2[0, 0] == pytest.approx(expected[2, 2])
    assert detection.covariance_m2[2, 2] == pytest.approx(expected[1, 1])


@pytest.mark.slow
@pytest.mark.parametrize('name', ['approach_jackal', 'approach_high_mount', 'approach_child', 'approach_tall'])
def test_a_person_who_comes_to_half_a_metre_is_one_visible_track(name):
    """At 10 images a second; all images: ./run bench scenes."""
    simulator = Simulator(read_scenario(os.path.join(FOLDER, name + '.yaml')))
    steps = run_scene(simulator, exact_detector(simulator), 3, error_model=read_error_model(ERROR_MODEL))
    result = result_of(steps, 'exact', simulator.camera)
    assert (result['track_ids'], result['not_visible'], result['id_switches']) == (1, 0, 0)
    assert result['velocity_rmse_mps'] < 0.3


@pytest.mark.slow
def test_results_tell_how_well_tracks_hold(approach):
    """At 5 images a second, from where the person starts; and what a result had before is still there."""
    steps = run_scene(approach, exact_detector(approach), 6, error_model=read_error_model(ERROR_MODEL))
    result = result_of(steps, 'exact', approach.camera)
    assert set(result) == {'detector', 'images', 'people', 'recall', 'false_boxes', 'id_switches', 'rmse_m', 'worst_m',
                           'track_ids', 'not_visible', 'velocity_rmse_mps', 'prediction_1s_m'}
    assert result['images'] == 48 and result['recall'] == 1 and result['false_boxes'] == 0
    assert (result['track_ids'], result['not_visible']) == (1, 0)
    assert result['velocity_rmse_mps'] < 0.3 and result['prediction_1s_m'] < 0.5


@pytest.mark.slow
@pytest.mark.parametrize('every,images', [([], {'depth': 4, 'exact': 8}),
                                          (['--every', '4'], {'depth': 2, 'exact': 2})])
def test_the_command_writes_a_row_for_each_detector(every, images, tmp_path, monkeypatch):
    """Without --every the exact boxes come with each image, and the detectors search every second one."""
    scene, scores = tmp_path / 'short.yaml', tmp_path / 'scores.json'
    scene.write_text('duration: 0.5\npeople: [{start: [3.0, 0.0]}]\n')
    monkeypatch.setattr('sys.argv', ['scenes', str(scene), '--error-model', ERROR_MODEL, '--json', str(scores)] + every)
    main()
    rows = json.loads(scores.read_text())['scenes']
    assert {row['detector']: row['images'] for row in rows} == images
    assert [row['scene'] for row in rows] == ['short', 'short']
