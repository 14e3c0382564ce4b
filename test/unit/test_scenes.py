"""The pipeline on simulated scenes, against exact truth, with each detector.

Without the weights of ROS_3D_BB_DATA, the true boxes replace those of YOLOv5.
"""
import functools
import os

import pytest

from conftest import DATA
from ros_3d_bb.estimation.error_model import read_error_model
from ros_3d_bb_lab.evaluation.clear_mot import score
from ros_3d_bb_lab.evaluation.defaults import SIMULATED_ERROR_MODEL, scenario_paths, scene_name
from ros_3d_bb_lab.evaluation.matching import plane_distances
from ros_3d_bb_lab.evaluation.scene_benchmark import (RANGE_M, detector_in, detections_without_scores,
                                                      exact_detector, result_of, run_scene, score_detections,
                                                      yolov5_detector)
from ros_3d_bb_lab.simulation.scenario import read_scenario
from ros_3d_bb_lab.simulation.simulator import Simulator

REAL_WEIGHTS = pytest.mark.needs(*['torch'] * bool(DATA))
THESIS_SCENES = scenario_paths('thesis_*')
SCENES = [path for path in scenario_paths('*') if scene_name(path) != 'follow']  # which takes ten minutes
# Every n-th of 15 images per second, as on a small computer. In the other scenes, only detections are scored.
EVERY, OTHERS_EVERY = 5, 40
APPROACH_EVERY = 5  # of 30


@pytest.fixture(scope='module')
def yolov5():
    if not DATA:
        return lambda frame: detections_without_scores([person.box_px for person in frame.people
                                                        if person.visible > 0.3])
    return yolov5_detector(os.path.join(DATA, 'weights', 'yolov5n.pt'))


def simulator_of(path):
    simulator = Simulator(read_scenario(path))
    simulator.frame = functools.lru_cache(maxsize=None)(simulator.frame)
    return simulator


@pytest.fixture(scope='module')
def runs(yolov5):
    """The steps of each scene with each detector: {(detector, scene): steps}."""
    found = {}
    for name in SCENES:
        simulator, every = simulator_of(name), EVERY if name in THESIS_SCENES else OTHERS_EVERY
        found['depth', name] = run_scene(simulator, detector_in(simulator, 'depth'), every)
        found['yolov5', name] = run_scene(simulator, yolov5, every)
        simulator.frame.cache_clear()
    return found


@pytest.mark.slow
@pytest.mark.parametrize('detector', ['yolov5', 'depth'])
@pytest.mark.parametrize('name', THESIS_SCENES, ids=scene_name)
@REAL_WEIGHTS
def test_everybody_in_the_thesis_scenes_keeps_one_id(runs, name, detector):
    """Each person is visible for a second; tracks are published from the fourth detection on."""
    result = score([step.moment for step in runs[detector, name]])
    assert len(result.people) == 4
    for person in result.people:
        assert person.visible_s >= 1 and len(person.ids) == 1, person
        assert person.detected > 0.8 and person.rmse_m < 0.25, person
    assert len(set(person.ids[0] for person in result.people)) == 4


@pytest.mark.slow
@pytest.mark.parametrize('detector,recall,false_rate', [('yolov5', 0.95, 0.05), ('depth', 0.90, 0.05)])
@REAL_WEIGHTS
def test_recall_and_false_positives_of_detectors(runs, detector, recall, false_rate):
    """At least 80 % of each person is visible, at 2 to 8 m (YOLOv5) or 2 to 6 m (weight-free)."""
    scores = [score_detections(runs[detector, name], *RANGE_M[detector]) for name in SCENES]
    people, found, false = (sum(column) for column in zip(*scores))
    images = sum(len(runs[detector, name]) for name in SCENES)
    assert people > 400
    assert found >= recall * people
    assert false <= false_rate * images


@pytest.fixture(scope='module', params=scenario_paths('approach_*'), ids=scene_name)
def approach(request):
    """A person comes to half a metre for two seconds. All images: ./run bench scenes."""
    simulator = simulator_of(request.param)
    yield simulator
    simulator.frame.cache_clear()


@pytest.mark.slow
def test_a_person_approaching_to_half_a_metre_is_one_visible_track(approach):
    error_model = read_error_model(SIMULATED_ERROR_MODEL)
    steps = run_scene(approach, exact_detector(approach), APPROACH_EVERY, error_model=error_model)
    result = result_of(steps, 'exact', approach.camera)
    assert (result['images'], result['people'], result['recall'], result['false_boxes']) == (57, 1, 1, 0)
    assert (result['track_ids'], result['not_visible'], result['id_switches']) == (1, 0, 0)
    assert result['rmse_m'] < result['worst_m'] < 0.25
    assert result['velocity_rmse_mps'] < 0.3 and result['prediction_1s_m'] < 0.5


@pytest.mark.slow
def test_a_person_too_near_for_the_weight_free_detector_stays_tracked(approach):
    ids = set()
    for step in run_scene(approach, detector_in(approach, 'depth'), APPROACH_EVERY):
        (person,), camera_m = step.frame.people, step.frame.poses.map_from_camera[:3, 3]
        if plane_distances([person.position_m], [camera_m]) < 0.6:
            track, = step.moment.tracks
            ids.add(track.id)
            assert plane_distances([person.position_m], [track.position_m]) < 0.5
    assert len(ids) == 1
