"""Invalid sessions: faults of single measurements are shown with them, other faults raise an error."""
import os

import pytest

from ros_3d_bb.sessions.session_reader import SessionError
from ros_3d_bb_annotator.document import Document
from ros_3d_bb_annotator.validation import problems_of
from support.small_session import change_json, read_json


def test_a_missing_image_is_named_and_other_measurements_can_be_annotated(folder):
    os.remove(os.path.join(folder, 'depth', 'm1.png'))
    os.remove(os.path.join(folder, 'color', 'm1.png'))
    document = Document.open(folder)
    assert [measurement.problem for measurement in document.measurements] == [
        None, 'there is no file color/m1.png and no file depth/m1.png', None, None]
    for read in (document.color, document.depth):
        with pytest.raises(SessionError, match='m1.png: missing'):
            read(1)
    document.reject([1], 'no images')
    document.set_truths([2], -0.5, 2.1)
    assert list(problems_of(document)) == []


@pytest.mark.parametrize('break_it,problem', [
    (lambda entry: entry.pop('id'), "'id' is missing"), (lambda entry: entry.update(person=2), 'person is 2'),
    (lambda entry: entry['detections'][0].update(box=[1, 2, 3]), '[1, 2, 3]'),
    (lambda entry: entry.update(truth_mm={'x': 1, 'z': 'far'}), 'far'),
    (lambda entry: entry.update(stamp='yesterday'), 'stamp is'), (lambda entry: entry.update(detections=5), 'int')])
def test_an_invalid_entry_is_shown_with_its_fault(folder, break_it, problem):
    change_json(folder, lambda content: break_it(content['frames'][1]))
    document = Document.open(folder)
    assert problem in document.measurements[1].problem and document.measurements[1].state == 'new'
    assert problem in list(problems_of(document))[0]
    for edit in (lambda: document.color(1), lambda: document.set_truths([1], 0.1, 2.0)):
        with pytest.raises(SessionError):
            edit()
    document.set_truths([2], 0.1, 2.0)
    assert read_json(folder)['frames'][2]['truth_mm'] == {'x': 100, 'z': 2000}


@pytest.mark.parametrize('edit', [
    lambda content: content.pop('frames'), lambda content: content.update(frames=3),
    lambda content: content.update(grid=[{'name': 'A', 'x': float('nan'), 'z': 1}])])
def test_faults_of_the_whole_session_are_rejected(folder, edit):
    change_json(folder, edit)
    with pytest.raises(SessionError, match='frames.json'):
        Document.open(folder)
