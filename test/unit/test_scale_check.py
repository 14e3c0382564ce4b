import numpy as np
import pytest

from ros_3d_bb.estimation.box3d import LEVEL, Box3D
from ros_3d_bb.estimation.box3d_estimator import estimate_boxes, estimator_named
from ros_3d_bb.pipeline.estimation_stage import LATEST_PEOPLE, ScaleCheck
from ros_3d_bb.sessions.session_reader import read_depth, read_session

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


def boxes_of(depth, rects_px, camera):
    boxes = estimate_boxes(depth, rects_px, camera, estimator_named('foreground'), LEVEL)
    return [box for box in boxes if isinstance(box, Box3D)]


def test_the_scale_of_a_session_is_correct(session_folder):
    session, check = read_session(session_folder), ScaleCheck()
    for frame in session.frames:
        assert check.factor(boxes_of(read_depth(frame, session), frame.boxes_px, session.camera)) is None
