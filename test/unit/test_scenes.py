"""The pipeline on simulated scenes, against exact truth, with each detector, and the scores of the scene benchmark.

Without the weights of ROS_3D_BB_DATA, the true boxes replace those of YOLOv5.
"""
import glob
import os

import numpy as np
import pytest

from conftest import DATA
from ros_3d_bb.camera.camera_model import OPTICAL_ROTATION, transform_from
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.estimation.error_model import read_error_model
from ros_3d_bb.tracking.types import OCCLUDED, VISIBLE, TrackedObject
from ros_3d_bb_lab.evaluation.clear_mot import Moment, score
from ros_3d_bb_lab.evaluation.scene_benchmark import (RANGE_M, depth_detector, detections_without_scores,
                                                      exact_detector, result_of, score_tracks, scored_people,
                                                      yolov5_detector)
from ros_3d_bb_lab.evaluation.scenes import Step, detect_in_scene, run_scene, score_detections
from ros_3d_bb_lab.simulation.scenario import read_scenario
from ros_3d_bb_lab.simulation.simulator import D435I_COLOR, PersonTruth, Poses, SimulatedFrame, Simulator

REAL_WEIGHTS = pytest.mark.needs(*['torch'] * bool(DATA))
CAMERA_M = (0.0, 0.0, 1.0)
SIZE_M, BOX_PX = np.array([0.5, 0.5, 1.7]), (200, 0, 400, 480)
FOLDER = os.path.join(os.path.dirname(os.path.abspath(__file__)), os.pardir, os.pardir, 'config', 'scenarios')
SCENES = sorted(os.path.basename(path) for path in glob.glob(os.path.join(FOLDER, '*.yaml')))
THESIS_SCENES = [name for name in SCENES if name.startswith('thesis_')]
APPROACHES = {'approach_jackal.yaml': (0.265, 1.75), 'approach_child.yaml': (0.265, 1.15),
              'approach_high_mount.yaml': (1.0, 1.75), 'approach_tall.yaml': (1.0, 1.95)}  # heights: camera, person
ERROR_MODEL = os.path.join(FOLDER, os.pardir, 'error_models', 'simulated_d435i.yaml')
# Every n-th of 15 images per second; the result is 7.5 and 5, as on a small computer.
EVERY = {'depth': 2, 'yolov5': 3}
OTHERS_EVERY = {'depth': 10, 'yolov5': 20}  # scenes in which only detections are scored


@pytest.fixture(scope='module')
def yolov5():
    if not DATA:
        return lambda frame: detections_without_scores([person.box_px for person in frame.people
                                                        if person.visible > 0.3])
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


@pytest.mark.slow
@pytest.mark.parametrize('detector', ['yolov5', 'depth'])
@pytest.mark.parametrize('name', THESIS_SCENES)
@REAL_WEIGHTS
def test_everybody_in_the_thesis_scenes_keeps_one_id(runs, name, detector):
    """Each person is visible for a second; tracks are published from the fourth detection on."""
    result = score([step.moment for step in runs[detector, name]])
    assert len(result.people) == 4
    for person in result.people:
        assert person.visible_s >= 1 and len(person.ids) == 1, person
        assert person.followed > 0.8 and person.rmse_m < 0.25, person
    assert len(set(person.ids[0] for person in result.people)) == 4


@pytest.mark.slow
@pytest.mark.parametrize('detector,recall,false_rate', [('yolov5', 0.95, 0.05), ('depth', 0.90, 0.05)])
@REAL_WEIGHTS
def test_recall_and_false_positives_of_detectors(runs, detector, recall, false_rate):
    """At least 80 % of each person is visible, at 2 to 8 m (YOLOv5) or 2 to 6 m (weight-free)."""
    scores = [score_detections(runs[detector, name], *RANGE_M[detector]) for name in SCENES]
    people, found, false = (sum(column) for column in zip(*scores))
    images = sum(len(runs[detector, name]) for name in SCENES)
    assert people > 500
    assert found >= recall * people
    assert false <= false_rate * images


@pytest.fixture
def approach():
    return Simulator(read_scenario(os.path.join(FOLDER, 'approach_jackal.yaml')))


def test_exact_boxes_have_the_covariance_of_the_error_model(approach):
    """In the map, whose x axis is the optical axis of the camera; the person is at 3.7 m, near the lower border."""
    model = read_error_model(ERROR_MODEL)
    _step, (before,), _view = next(detect_in_scene(approach, exact_detector(approach)))
    step, (detection,), _view = next(detect_in_scene(approach, exact_detector(approach), error_model=model))
    assert before.covariance_m2[2][2] == pytest.approx(0.1 ** 2)
    camera_m = step.frame.poses.map_from_camera[:3, 3]
    x_m, y_m, z_m = detection.position_m - camera_m
    expected, = model.covariance(np.array([(-y_m, -z_m, x_m)]))
    assert detection.covariance_m2[0][0] == pytest.approx(expected[2, 2] + 0.03 ** 2, rel=0.01)
    assert detection.covariance_m2[2][2] == pytest.approx(expected[1, 1])


@pytest.mark.slow
@pytest.mark.parametrize('name', sorted(APPROACHES))
def test_a_person_approaching_to_half_a_metre_is_one_visible_track(name):
    """At 10 images per second; all images: ./run bench scenes. The scene comes to half a metre for two seconds."""
    camera_m, person_m = APPROACHES[name]
    simulator = Simulator(read_scenario(os.path.join(FOLDER, name)))
    steps = run_scene(simulator, exact_detector(simulator), 3, error_model=read_error_model(ERROR_MODEL))
    cameras_m = np.array([step.frame.poses.map_from_camera[:3, 3] for step in steps])
    people_m = np.array([step.frame.people[0].position_m[:2] for step in steps])
    distances_m = np.linalg.norm(people_m - cameras_m[:, :2], axis=1)
    assert cameras_m[:, 2] == pytest.approx(camera_m)
    assert simulator.scenario.people[0].height == person_m
    assert distances_m.min() == pytest.approx(0.5, abs=1e-6) and distances_m[[0, -1]].min() > 3.5
    assert 15 <= np.count_nonzero(distances_m < 0.51) <= 25

    result = result_of(steps, 'exact', simulator.camera)
    assert set(result) == {'detector', 'images', 'people', 'recall', 'false_boxes', 'id_switches', 'rmse_m', 'worst_m',
                           'track_ids', 'not_visible', 'velocity_rmse_mps', 'prediction_1s_m'}
    assert (result['images'], result['people'], result['recall'], result['false_boxes']) == (95, 1, 1, 0)
    assert (result['track_ids'], result['not_visible'], result['id_switches']) == (1, 0, 0)
    assert result['rmse_m'] < result['worst_m'] < 0.25
    assert result['velocity_rmse_mps'] < 0.3 and result['prediction_1s_m'] < 0.5


def person(number, x_m, y_m=0.0, speed_mps=0.0, hidden=0.0, box_px=BOX_PX):
    """A person walking along x, most of whose body is outside of the image."""
    return PersonTruth(number, np.array([x_m, y_m, 0.85]), np.array([speed_mps, 0.0, 0.0]), SIZE_M, 0.1, hidden, 0.1,
                       box_px)


def track_of(someone, number=1, status=VISIBLE, off_m=(0.0, 0.0, 0.0), off_mps=(0.0, 0.0, 0.0), horizon_s=2.0):
    """A track of a person with these errors, and with straight predictions each 0.25 s."""
    position_m, velocity_mps = someone.position_m + off_m, someone.velocity_mps + off_mps
    times_s = np.arange(0.25, horizon_s + 0.01, 0.25)
    return TrackedObject(number, position_m, SIZE_M, velocity_mps, velocity_mps, status, False, 0, 0,
                         position_m + times_s[:, None] * velocity_mps, 0.25)


def step(number, people, tracks):
    poses = Poses(np.eye(4), np.eye(4), transform_from(CAMERA_M, OPTICAL_ROTATION))
    truth = [track_of(someone, someone.id) for someone in people]
    return Step(SimulatedFrame(number, number / 30.0, None, None, poses, people), np.zeros((0, 4)),
                Moment(number * NS // 30, truth, tracks))


def scored(images):
    """The score of images, each (people, tracks)."""
    steps = [step(number, *image) for number, image in enumerate(images)]
    return score_tracks([(scored_people(step, D435I_COLOR), step.moment.tracks) for step in steps])


def test_errors_of_velocity_and_prediction_are_those_in_the_plane():
    someone = person(1, 3.0, speed_mps=-0.9)
    result = scored([([someone], [track_of(someone, off_m=(0.0, 0.1, 5.0), off_mps=(0.3, 0.0, 7.0))])] * 4)
    assert result['track_ids'] == 1 and result['not_visible'] == 0
    assert result['velocity_rmse_mps'] == pytest.approx(0.3)
    assert result['prediction_1s_m'] == pytest.approx(np.hypot(0.3, 0.1))
    two_s = score_tracks([([track_of(someone, someone.id)], [track_of(someone, off_mps=(0.3, 0.0, 0.0))])], (2.0,))
    assert two_s['prediction_2s_m'] == pytest.approx(0.6)


def test_images_without_a_visible_track_count_after_the_first_match():
    someone = person(1, 2.0)
    held, occluded = track_of(someone), track_of(someone, status=OCCLUDED)
    away = track_of(someone, number=2, off_m=(0.0, 0.51, 0.0))
    images = [[], [], [held], [], [occluded], [away], [held]]
    result = scored([([someone], tracks) for tracks in images])
    assert result['not_visible'] == 3 and result['track_ids'] == 1


@pytest.mark.parametrize('then,not_visible', [
    (person(1, 0.49), 0), (person(1, 3.0, y_m=2.0), 0), (person(1, 3.0, hidden=0.71), 0), (person(1, -1.0), 0),
    (person(1, 3.0, box_px=None), 0), (person(1, 0.5), 1), (person(1, 0.6), 1), (person(1, 8.0), 1)])
def test_people_too_near_outside_of_the_image_or_hidden_are_not_scored(then, not_visible):
    first = person(1, 3.0)
    assert scored([([first], [track_of(first)]), ([then], [])])['not_visible'] == not_visible
