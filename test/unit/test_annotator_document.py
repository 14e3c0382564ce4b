import csv
import os
import re

import pytest
from hypothesis import given, settings, strategies as st

from ros_3d_bb.sessions.session_reader import SessionError, read_session
from ros_3d_bb_annotator.document import Document
from ros_3d_bb_annotator.export import export
from ros_3d_bb_annotator.lengths import parse_length
from ros_3d_bb_annotator.marks import Mark, parse_marks
from ros_3d_bb_lab.evaluation.noise.tables import read_table
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


MARKS = (Mark('A1', -0.6, 1.5), Mark('B1', 0.0, 1.5))


@pytest.mark.parametrize('text', [
    'A1, -600, 1500\nB1, 0, 1500', 'name,x,z\n"A1",-600,1500\n\n"B1",0,1500\n', 'A1\t-600\t1500\r\nB1\t0\t1500',
    'A1;-0,6 m;1,5 m\nB1;0;1500', 'Mark X Z\nA1 -60cm 150cm\nB1 0 1.5m'])
def test_tables_are_parsed(text):
    assert parse_marks(text) == MARKS


@pytest.mark.parametrize('text,named', [
    ('A1, -600', 'line 1 is'), ('A1, -600, 1500\nB1, far, 1500', "line 2: 'far' is not a length"),
    ('A1, 0, 0', 'line 1: Z is 0 mm; at least 50 mm'),
    (', 0, 1500', 'line 1: the name is empty'), ('A1, 0, 1500\na1, 0, 2000', 'a1 is not unique'),
    ('Name, X [m], Z [m]\nA1, -0.6, 1.5', 'line 2: Z is 1.5 mm; at least 50 mm')])
def test_invalid_tables_are_rejected(text, named):
    with pytest.raises(ValueError, match=named):
        parse_marks(text)


@pytest.mark.parametrize('text,expected_m', [
    ('1230', 1.23), ('1.23m', 1.23), ('1,23 m', 1.23), ('1,2305', 0.001231), ('\u2212650', -0.65), (' 12 cm ', 0.12),
    ('.5m', 0.5), ('1,230 m', 1.23), ('1.230', 0.00123), ('-0', 0.0), ('100000', 100.0)])
def test_lengths_are_parsed(text, expected_m):
    assert parse_length(text) == pytest.approx(expected_m, abs=5e-7)
    assert str(parse_length(text)) != '-0.0'


@pytest.mark.parametrize('text,named', [
    ('1,230', '1230 mm .*1.230 mm'), ('100.1m', '100 m')]
    + [(text, re.escape(repr(text))) for text in ('', 'm', '1 2', '1.2.3', '1e3', 'nan', '1 km', '\u0661', '1_0')])
def test_invalid_and_ambiguous_lengths_are_rejected(text, named):
    with pytest.raises(ValueError, match=named):
        parse_length(text)


def test_a_row_contains_box_estimates_and_truth_in_all_axes(document, tmp_path):
    document.set_truths([0], -0.5, 2.1004, 0.01)
    path = str(tmp_path / 'table.csv')
    assert export(document, path, 'foreground') == 1
    with open(path, newline='') as stream:
        row, = csv.DictReader(stream)
    x_m, y_m, z_m = document.estimates.of(0)[0]
    assert (row['id'], row['label'], row['stamp']) == ('m0', 'by the door', '1616161616.000000005')
    assert [int(row[edge]) for edge in ('x1', 'y1', 'x2', 'y2')] == list(NEAR_BOX) and row['implausible'] == ''
    assert [float(row[axis + ' measured']) for axis in 'XYZ'] == pytest.approx(
        [1000 * x_m, 1000 * y_m, 1000 * z_m], abs=0.06)
    assert [float(row[axis + ' recorded']) for axis in 'XYZ'] == [-466.5, 33, 2000]
    assert [float(row[axis + ' true']) for axis in 'XYZ'] == [-500, 10, 2100.4]
    assert float(row['Z error']) == pytest.approx(1000 * z_m - 2100.4, abs=0.06)
    assert read_table(path, 'Z').truth_m.tolist() == [[-0.5, 2.1004]]
