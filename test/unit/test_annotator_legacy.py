"""Old format of the thesis: it can be annotated, lost data are reported, and nothing in it is executed."""
import os

import pytest

from ros_3d_bb.sessions.session_reader import SessionError, read_session
from ros_3d_bb_annotator.document import Document
from ros_3d_bb_annotator.validation import problems_of
from support.old_session import LINES, write_old_session
from support.small_session import read_json


def test_positions_times_and_images_are_read(tmp_path):
    document = Document.open(write_old_session(str(tmp_path)))
    assert document.is_old_format and document.progress == (0, 5) and document.camera is None
    assert [measurement.id for measurement in document.measurements] == [
        '30-03-2021-11-49-54', '30-03-2021-11-49-56', '30-03-2021-11-53-28', '30-03-2021-11-53-28-2',
        '30-03-2021-11-53-29']
    second = document.measurements[1]
    assert [detection.estimate_m.tolist() for detection in second.detections] == [[2.971, 0.535, 6.102],
                                                                                  [-0.007, 0.002, 0.3]]
    assert document.measurements[4].detections == () and document.measurements[4].person is None
    assert document.color(0)[0, 0].tolist() == [100] * 3 and list(problems_of(document)) == []
    assert document.measurements[2].color_path == document.measurements[3].color_path


def test_lost_data_are_reported_and_nothing_is_estimated(tmp_path):
    document = Document.open(write_old_session(str(tmp_path)))
    text = ' '.join(document.notes)
    assert 'stretched' in text and 'distances cannot be recovered' in text and 'focal lengths' in text
    for use in (document.depth, lambda index: document.estimated(index, (1, 1, 9, 9)),
                lambda index: document.add_box(index, (1, 1, 9, 9))):
        with pytest.raises(SessionError, match='cannot be recovered'):
            use(0)


def test_truth_is_saved_in_another_file_and_the_text_is_unchanged(tmp_path):
    document = Document.open(write_old_session(str(tmp_path)))
    document.choose_person(1, 1)
    document.set_truths([1], 0.0, 0.3)
    document.reject(0, 'blurred')
    assert (tmp_path / 'measurements.txt').read_text() == '\n'.join(LINES) + '\n'
    reopened = Document.open(str(tmp_path))
    assert reopened.is_old_format and reopened.notes and len(reopened.measurements) == 5
    assert reopened.errors(1)[:2] == pytest.approx((-0.007, 0.0)) and reopened.progress == (2, 5)
    assert document.undo() == 0 and Document.open(str(tmp_path)).measurements[0].rejected is None
    assert all('depth' not in entry for entry in read_json(tmp_path)['frames'])  # it must not be used as distances
    with pytest.raises(SessionError, match="'camera'"):
        read_session(str(tmp_path))


@pytest.mark.parametrize('line', [
    '[(1, 2, __import__("os").system("touch run"))];x', '[(1, 2, 3)];x; import os', '[(1, 2, 3.5)];x',
    '[(12345678, 2, 3)];x', '[(1, 2, 3)];../../etc/passwd', '[(1, 2, 3)]'])
def test_an_invalid_line_is_shown_and_not_executed(tmp_path, monkeypatch, line):
    monkeypatch.chdir(str(tmp_path))
    write_old_session(str(tmp_path), LINES[:1])
    with open('measurements.txt', 'a', encoding='utf-8') as stream:
        stream.write(line + '\n')
    document = Document.open(str(tmp_path))
    assert document.measurements[0].problem is None and document.measurements[1].id == 'line-2'
    assert line[:20] in document.measurements[1].problem.replace("\\'", "'")
    assert 'line 2' in document.measurements[1].problem
    document.reject(1, 'no measurement')
    assert Document.open(str(tmp_path)).measurements[1].rejected == 'no measurement'
    assert not os.path.exists('run')
