"""Estimates by the annotator of boxes drawn by hand, and of boxes without a stored estimate."""
import os

import cv2
import numpy as np
import pytest

from ros_3d_bb.sessions.session_reader import read_session
from support.small_session import FAR_BOX, NEAR_BOX, NEAR_MM, change_json


def test_a_box_drawn_by_hand_is_estimated_and_chosen(document, folder):
    change_json(folder, lambda content: content['frames'][0]['detections'].pop(0))
    document.refresh()
    box = document.add_box(0, NEAR_BOX)
    drawn = document.measurements[0].detections[-1]
    assert document.measurements[0].person == 1 and drawn.by_hand and drawn.box_px == NEAR_BOX
    assert box.center_m[2] == pytest.approx(NEAR_MM / 1000.0 + 0.09)  # the axis is behind the surface
    assert np.abs(drawn.estimate_m - box.center_m).max() < 1e-5
    assert drawn.support == pytest.approx(box.support, abs=1e-3) and drawn.truncated == box.truncated
    assert read_session(folder).frames[0].boxes_px == (NEAR_BOX, FAR_BOX)


def test_a_box_drawn_by_hand_replaces_that_of_the_same_person(document, folder):
    change_json(folder, lambda content: content['frames'][0]['detections'][0].update(box=[10, 4, 26, 30]))
    document.refresh()
    assert document.add_box(0, (-5, 4, 26, 44)) is not None
    assert document.measurements[0].detections[-1].box_px == (0, 4, 26, 44)
    assert document.add_box(0, NEAR_BOX).center_m[2] == pytest.approx(2.09)
    assert read_session(folder).frames[0].boxes_px == (NEAR_BOX, FAR_BOX)


@pytest.mark.parametrize('break_it', [
    lambda document: os.remove(document.measurements[0].depth_path),
    lambda document: cv2.imwrite(document.measurements[0].depth_path, np.zeros((48, 64), np.uint16))])
def test_truth_can_be_entered_for_a_box_that_cannot_be_estimated(document, folder, break_it):
    change_json(folder, lambda content: content['frames'][0]['detections'][0].pop('estimate_mm'))
    document.refresh()
    break_it(document)
    document.set_truths([0], 0.1, 2.0)
    assert document.measurements[0].truth_m == (0.1, None, 2.0) and document.known_errors(0) is None
