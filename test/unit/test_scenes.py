"""The pipeline on simulated scenes, against exact truth, with each detector.

The weight-free detector always runs. YOLOv5 runs where ROS_3D_BB_DATA has its weights; without them the boxes of the
truth stand in for it, so that estimator and tracker are tested all the same.
"""
import glob
import os

import pytest

from conftest import DATA
from ros_3d_bb.evaluation.identities import score
from ros_3d_bb.evaluation.scene_benchmark import RANGE_M, depth_detector, result_of, yolov5_detector
from ros_3d_bb.evaluation.scenes import run_scene, score_detections
from ros_3d_bb.simulation.scenario import read_scenario
from ros_3d_bb.simulation.simulator import Simulator

FOLDER = os.path.join(os.path.dirname(os.path.abspath(__file__)), os.pardir, os.pardir, 'config', 'scenarios')
SCENES = sorted(os.path.basename(path) for path in glob.glob(os.path.join(FOLDER, '*.yaml')))
THESIS_SCENES = [name for name in SCENES if name.startswith('thesis_')]
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
    assert {'crowd_of_12.yaml', 'corridor.yaml', 'behind_a_pillar.yaml', 'turning_robot.yaml',
            'empty_room.yaml'} <= set(SCENES)


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
