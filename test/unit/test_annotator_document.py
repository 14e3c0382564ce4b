import os

import cv2
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from ros_3d_bb.sessions.session_reader import SessionError, read_session
from ros_3d_bb_annotator.document import Document
from support.small_session import (FAR_BOX, NEAR_BOX, NEAR_MM, change_json, read_json, write_measurement,
                                   write_small_session)


def states(document):
    return [measurement.state for measurement in document.measurements]


@settings(max_examples=25)
@given(st.lists(st.tuples(st.sampled_from(['truth', 'reject', 'restore', 'person', 'undo', 'redo']),
                          st.integers(0, 3), st.integers(0, 1)), max_size=12))
def test_after_any_edits_the_file_is_what_is_shown_and_undo_leads_back(tmp_path_factory, edits):
    folder = write_small_session(str(tmp_path_factory.mktemp('session')))
    start, document = read_json(folder), Document(folder)
    for kind, index, number in edits:
        if kind in ('undo', 'redo'):
            getattr(document, kind)()
        else:
            {'truth': lambda: document.set_truths([index], number, 1 + number), 'reject': lambda: document.reject(
                [index], 'no'), 'restore': lambda: document.restore(index),
             'person': lambda: document.choose_person(index, number)}[kind]()
    shown, saved = ([(one.truth_m, one.person, one.rejected) for one in source.measurements]
                    for source in (document, Document(folder)))
    assert shown == saved
    while document.undo_steps:
        document.undo()
    assert read_json(folder) == start


def test_measurements_added_by_a_viewer_are_kept_and_shown(document, folder):
    change_json(folder, lambda content: content['frames'].append(write_measurement(folder, 'new')))
    document.set_truths([0], 0.1, 2.0)
    assert [entry['id'] for entry in read_json(folder)['frames']] == ['m0', 'm1', 'm2', 'm3', 'new']
    assert document.measurements[4].id == 'new' and document.progress == (1, 5)
    assert not document.refresh()  # only its own edit
    change_json(folder, lambda content: content['frames'].append(write_measurement(folder, 'newer')))
    assert document.refresh() and document.measurements[5].id == 'newer' and not document.refresh()
    document.undo()
    assert len(read_json(folder)['frames']) == 6 and 'truth_mm' not in read_json(folder)['frames'][0]


def test_two_annotators_keep_the_fields_of_each_other(document, folder):
    other = Document(folder)
    document.set_truths([0], 0.1, 2.0)
    other.draw_box(0, (1, 1, 30, 40))
    other.set_truths([1], 0.3, 2.2)
    assert read_json(folder)['frames'][0]['truth_mm'] == {'x': 100, 'z': 2000}
    assert document.refresh() and len(document.measurements[0].detections) == 3
    assert states(document)[1] == 'annotated'
    document.undo()
    assert len(read_json(folder)['frames'][0]['detections']) == 3


def test_an_edit_that_cannot_be_saved_raises_an_error_and_changes_nothing(document, folder):
    with open(os.path.join(folder, 'frames.json'), 'w') as stream:
        stream.write('{"frames"')
    for edit in (lambda: document.set_truths([0], 0.1, 2.0), document.refresh):
        with pytest.raises(SessionError, match='frames.json|cannot be saved'):
            edit()
    assert states(document) == ['new'] * 4 and not document.undo_steps
    os.rename(folder, folder + '-gone')
    with pytest.raises(SessionError, match='cannot be saved'):
        document.set_truths([0], 0.1, 2.0)


def test_the_truth_belongs_to_the_nearest_box_unless_one_was_selected(document):
    document.set_truths([0], 0.72, 2.9)
    assert document.measurements[0].person == 1 and document.known_errors(0)[2] < 0.25
    document.choose_person(1, 0)
    document.set_truths([1], 0.72, 2.9)
    assert document.measurements[1].person == 0
    document.choose_person(1, 1)
    document.set_truths([1], 0.72, 2.9)  # no other person can be there
    assert document.measurements[1].truths == {1: (0.72, None, 2.9)}


def test_a_box_drawn_by_hand_is_estimated_and_chosen(document, folder):
    change_json(folder, lambda content: content['frames'][0]['detections'].pop(0))
    document.refresh()
    document.draw_box(0, NEAR_BOX)
    drawn = document.measurements[0].detections[-1]
    assert document.measurements[0].person == 1 and drawn.by_hand and drawn.box_px == NEAR_BOX
    assert drawn.estimate_m[2] == pytest.approx(NEAR_MM / 1000.0 + 0.09)  # the axis is behind the surface
    assert document.estimates.of(0)[1] == pytest.approx(drawn.estimate_m, abs=1e-5)
    assert drawn.support == pytest.approx(1, abs=1e-3) and drawn.truncated is True
    assert read_session(folder).frames[0].boxes_px == (NEAR_BOX, FAR_BOX)


def test_a_box_drawn_by_hand_replaces_that_of_the_same_person(document, folder):
    change_json(folder, lambda content: content['frames'][0]['detections'][0].update(box=[10, 4, 26, 30]))
    document.refresh()
    document.draw_box(0, (-5, 4, 26, 44))
    assert document.measurements[0].detections[-1].box_px == (0, 4, 26, 44)
    document.draw_box(0, NEAR_BOX)
    assert document.estimates.of(0)[3][2] == pytest.approx(2.09)
    assert read_session(folder).frames[0].boxes_px == (NEAR_BOX, FAR_BOX)


def test_the_truth_stays_with_its_person_when_boxes_are_drawn_and_deleted(document):
    near_m, far_m = (-0.47, None, 2.0), (0.7, None, 3.0)
    document.set_truths([0], -0.47, 2.0)
    document.draw_box(0, (12, 6, 28, 44))  # of the same person
    assert document.measurements[0].truths == {2: near_m}
    document.draw_box(0, (30, 5, 38, 20))  # of another one
    assert document.measurements[0].person == 3 and document.measurements[0].truths == {2: near_m}
    document.set_truths([0], 0.7, 3.0)
    assert document.measurements[0].truths == {2: near_m, 3: far_m}
    document.delete_box(0)
    assert document.measurements[0].truths == {2: near_m} and document.measurements[0].person == 0
    document.set_truths([0], 0.7, 3.0)  # nobody is selected any more
    assert document.measurements[0].truths == {1: far_m, 2: near_m}


@pytest.mark.parametrize('break_it', [
    lambda document: os.remove(document.measurements[0].depth_path),
    lambda document: cv2.imwrite(document.measurements[0].depth_path, np.zeros((48, 64), np.uint16))])
def test_truth_can_be_entered_for_a_box_that_cannot_be_estimated(document, folder, break_it):
    change_json(folder, lambda content: content['frames'][0]['detections'][0].pop('estimate_mm'))
    document.refresh()
    break_it(document)
    document.set_truths([0], 0.1, 2.0)
    assert document.measurements[0].truth_m == (0.1, None, 2.0) and document.known_errors(0) is None


def test_a_missing_image_is_named_and_other_measurements_can_be_annotated(folder):
    os.remove(os.path.join(folder, 'depth', 'm1.png'))
    os.remove(os.path.join(folder, 'color', 'm1.png'))
    document = Document(folder)
    assert [measurement.problem for measurement in document.measurements] == [
        None, 'there is no file color/m1.png and no file depth/m1.png', None, None]
    for read in (document.color, document.depth):
        with pytest.raises(SessionError, match='m1.png: missing'):
            read(1)
    document.reject([1], 'no images')


@pytest.mark.parametrize('share', [0, 0.5, 0.99])
def test_a_truncated_image_is_named(folder, share):
    path = os.path.join(folder, 'depth', 'm1.png')
    os.truncate(path, int(share * os.path.getsize(path)))
    assert [measurement.problem for measurement in Document(folder).measurements] == [
        None, 'the end of depth/m1.png is missing', None, None]


@pytest.mark.parametrize('break_it,problem', [
    (lambda entry: entry.pop('id'), "'id' is missing"), (lambda entry: entry.update(person=2), 'person is 2'),
    (lambda entry: entry['detections'][0].update(box=[1, 2, 3]), '[1, 2, 3]'),
    (lambda entry: entry.update(truth_mm={'x': 1, 'z': 'far'}), 'far'),
    (lambda entry: entry.update(stamp='yesterday'), 'stamp is'), (lambda entry: entry.update(detections=5), 'int')])
def test_an_invalid_entry_is_shown_with_its_fault(folder, break_it, problem):
    change_json(folder, lambda content: break_it(content['frames'][1]))
    document = Document(folder)
    assert problem in document.measurements[1].problem and document.measurements[1].state == 'new'
    for edit in (lambda: document.color(1), lambda: document.set_truths([1], 0.1, 2.0)):
        with pytest.raises(SessionError):
            edit()
    document.set_truths([2], 0.1, 2.0)
    assert read_json(folder)['frames'][2]['truth_mm'] == {'x': 100, 'z': 2000}


def test_a_session_with_an_invalid_grid_is_rejected(folder):
    change_json(folder, lambda content: content.update(grid=[{'name': 'A', 'x': float('nan'), 'z': 1}]))
    with pytest.raises(SessionError, match='frames.json'):
        Document(folder)
