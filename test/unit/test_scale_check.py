import numpy as np
import pytest

from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.estimation.box3d import LEVEL, Box3D
from ros_3d_bb.estimation.box3d_estimator import estimate_boxes, estimator_named, level_rotation
from ros_3d_bb.pipeline.estimation_stage import LATEST_PEOPLE, ScaleCheck
from ros_3d_bb.sessions.session_reader import read_depth, read_session
from ros_3d_bb_lab.simulation.scenario import scenario_from
from ros_3d_bb_lab.simulation.simulator import Simulator

STANDING_PX, SEATED_PX = (300, 100, 360, 300), (300, 100, 400, 300)


def box_of(height_m, rect_px=STANDING_PX, support=0.8, cut_bottom=False):
    return Box3D(np.array([0, 0, 3.0]), np.array([0.5, height_m, 0.5]), rect_px, support,
                 (False, False, False, cut_bottom))


@pytest.mark.parametrize('height_m,factor', [
    (8.5, 0.2), (9.6, 0.2), (6.8, 0.25), (5.5, 0.25),
    (17.0, 0.1), (1700.0, 0.001), (0.34, 5), (0.28, 5), (0.17, 10), (4.2, 0.4), (0.7, 2.4),
    (0.9, None), (1.15, None), (1.7, None), (2.3, None)])
def test_an_impossible_height_gives_the_factor(height_m, factor):
    check = ScaleCheck()
    factors = [check.factor([box_of(height_m)]) for _ in range(2 * LATEST_PEOPLE)]
    assert factors == 2 * ((LATEST_PEOPLE - 1) * [None] + [factor])


@pytest.mark.parametrize('box', [box_of(0.6, SEATED_PX), box_of(0.6, support=0.2), box_of(5.0, cut_bottom=True)])
def test_seated_doubtful_and_truncated_people_are_not_counted(box):
    check = ScaleCheck()
    assert not any(check.factor([box]) for _ in range(2 * LATEST_PEOPLE))


def test_giants_count_with_any_support():
    """Depth that is too large spreads a person over more than a layer."""
    check = ScaleCheck()
    assert [check.factor([box_of(8.5, support=0.15)]) for _ in range(LATEST_PEOPLE)][-1] == 0.2


def boxes_of(depth, rects_px, camera, level_from_camera=LEVEL):
    boxes = estimate_boxes(depth, rects_px, camera, estimator_named('foreground'), level_from_camera)
    return [box for box in boxes if isinstance(box, Box3D)]


def test_the_scale_of_a_session_is_correct(session_folder):
    session, check = read_session(session_folder), ScaleCheck()
    for frame in session.frames:
        assert check.factor(boxes_of(read_depth(frame, session), frame.boxes_px, session.camera)) is None


@pytest.mark.slow
@pytest.mark.parametrize('height_m,tilt_deg,people_m,crouch', [
    (0.6, 0, (1.15, 1.15), 0), (1.0, 0, (1.7, 1.8), 1), (0.3, 0, (1.9, 1.6), 0), (2.0, 30, (1.15, 1.8), 0),
    (2.5, 45, (1.15, 1.15), 0), (2.8, 60, (1.7, 1.15), 0.8)])
def test_simulated_people(height_m, tilt_deg, people_m, crouch):
    """Each image counts `LATEST_PEOPLE` times. Standing adults before a level camera show a wrong scale."""
    ahead_m = 3.5 if tilt_deg == 0 else height_m / np.tan(np.radians(tilt_deg)) + 0.3
    people = [{'start': [ahead_m + 0.3 * side, 0.5 * side], 'facing': 3.0 + side, 'height': tall_m, 'crouch': crouch}
              for side, tall_m in zip((-1, 1), people_m)]
    simulator = Simulator(scenario_from({
        'duration': 0.2, 'rate': 5.0, 'people': people, 'room': {'height': 4.0},
        'robot': {'mount': [0.0, 0.0, height_m - 0.065], 'pitch': np.radians(tilt_deg)}}))
    frame = simulator.frame(0)
    rects_px = [person.box_px for person in frame.people if person.box_px is not None]
    level = level_rotation(np.linalg.inv(frame.poses.map_from_camera)[:3, 2])

    def factor(scale, level_from_camera):
        check = ScaleCheck()
        boxes = boxes_of(DepthImage(frame.depth_mm, 0.001 * scale), rects_px, simulator.camera, level_from_camera)
        return next(filter(None, (check.factor(boxes) for _ in range(2 * LATEST_PEOPLE))), None)
    assert factor(1, LEVEL) is None and factor(1, level) is None
    if tilt_deg == 0 and crouch == 0 and min(people_m) > 1.5:
        assert factor(5, level) == 0.2 and factor(0.2, level) == 5
