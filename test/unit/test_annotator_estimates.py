"""Estimates by the annotator of boxes drawn by hand, and of boxes without a stored estimate."""
import os

import cv2
import numpy as np
import pytest

from ros_3d_bb.sessions.session_reader import read_session
from ros_3d_bb_annotator.document import Document
from ros_3d_bb_lab.evaluation.noise.tables import read_session_measurements
from support.small_session import FAR_BOX, NEAR_BOX, NEAR_MM, change_json, read_json


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


def test_a_box_without_depth_is_added_without_estimate(document):
    cv2.imwrite(document.measurements[0].depth_path, np.zeros((48, 64), np.uint16))
    assert document.add_box(0, (1, 1, 9, 9)) is None
    assert document.estimates.of(0)[2] is None and document.measurements[0].person == 2


@pytest.mark.parametrize('box_px', [(5, 5, 5, 9), (9, 5, 5, 9), (70, 5, 90, 9), (-9, 5, 0, 9)])
def test_a_box_without_pixels_is_rejected(document, box_px):
    with pytest.raises(ValueError, match=r'\('):
        document.add_box(0, box_px)
    assert not document.can_undo


@pytest.fixture
def single(folder):
    """A session that stores one detection in each frame."""
    def change(content):
        for entry in content['frames']:
            entry.update(entry.pop('detections')[0])
    change_json(folder, change)
    return folder


def test_a_box_is_added_to_a_session_of_one_box_per_frame(single):
    before, document = read_json(single), Document.open(single)
    recorded_m = document.measurements[0].recorded_m
    document.add_box(0, FAR_BOX)
    assert len(document.measurements[0].detections) == 2
    assert document.measurements[0].detections[0].estimate_m.tolist() == recorded_m.tolist()
    entry = read_json(single)['frames'][0]
    assert len(entry['detections']) == 2 and not {'box', 'estimate_mm'} & set(entry)
    assert document.undo() == 0 and read_json(single) == before


def test_estimates_do_not_need_recorded_ones_and_are_those_of_the_analysis(document, folder):
    change_json(folder, lambda content: [content['frames'][0]['detections'][0].pop(name) for name in (
        'estimate_mm', 'size_mm', 'support', 'truncated')])
    document.refresh()
    for index in range(2):
        document.set_truth(index, -0.5, 2.1)
    table = read_session_measurements(folder, 'foreground')
    assert table.measured_m.tolist() == [document.estimates.of(index)[0].tolist() for index in range(2)]
    assert document.estimates.of(0)[0] == pytest.approx(document.estimated(0, NEAR_BOX).center_m)
    assert 'estimate_mm' not in read_json(folder)['frames'][0]['detections'][0]


def test_estimates_are_computed_once_and_again_for_other_boxes(document, monkeypatch):
    reads = []
    read = document.depth
    monkeypatch.setattr(document, 'depth', lambda index: reads.append(index) or read(index))
    document.set_truth(0, -0.5, 2.1)
    assert document.errors(0) == document.errors(0) and reads == [0]
    assert list(document.estimates.missing()) == []
    document.replace_box(0, (12, 6, 24, 40))
    assert list(document.estimates.missing()) == [0] and document.known_errors(0) is None
    document.errors(0)
    document.estimates.clear()
    assert document.known_errors(0) is None


@pytest.mark.parametrize('break_it', [
    lambda document: os.remove(document.measurements[0].depth_path),
    lambda document: cv2.imwrite(document.measurements[0].depth_path, np.zeros((48, 64), np.uint16))])
def test_truth_can_be_entered_for_a_box_that_cannot_be_estimated(document, folder, break_it):
    change_json(folder, lambda content: content['frames'][0]['detections'][0].pop('estimate_mm'))
    document.refresh()
    break_it(document)
    document.set_truth(0, 0.1, 2.0)
    assert document.measurements[0].truth_m == (0.1, None, 2.0) and document.errors(0) is None
