"""The description of a session is written whole, by one program at a time."""
import json
import multiprocessing
import os
import stat

import pytest

from ros_3d_bb.session_file import changing, write_whole


def _add_many(folder, name, count):
    for number in range(count):
        with changing(folder) as content:
            content['frames'].append({'id': '%s-%d' % (name, number)})


def test_a_new_session_is_begun(tmp_path):
    with changing(str(tmp_path)) as content:
        content['frames'].append({'id': 'a'})
    assert json.loads((tmp_path / 'frames.json').read_text()) == {'frames': [{'id': 'a'}]}


def test_two_programs_lose_nothing_of_each_other(tmp_path):
    others = [multiprocessing.Process(target=_add_many, args=(str(tmp_path), name, 20)) for name in 'ab']
    for other in others:
        other.start()
    for other in others:
        other.join()
    ids = [frame['id'] for frame in json.loads((tmp_path / 'frames.json').read_text())['frames']]
    assert sorted(ids) == sorted('%s-%d' % (name, number) for name in 'ab' for number in range(20))


def test_an_error_leaves_the_file_as_it_was(tmp_path):
    _add_many(str(tmp_path), 'a', 1)
    before = (tmp_path / 'frames.json').read_bytes()
    with pytest.raises(RuntimeError), changing(str(tmp_path)) as content:
        content['frames'] = []
        raise RuntimeError
    with pytest.raises(ValueError), changing(str(tmp_path)) as content:
        content['depth'] = float('nan')
    assert (tmp_path / 'frames.json').read_bytes() == before


def test_nothing_is_left_beside_a_file_that_could_not_be_written(tmp_path):
    (tmp_path / 'folder').mkdir()
    with pytest.raises(OSError):
        write_whole(str(tmp_path / 'folder'), b'data')
    assert os.listdir(str(tmp_path)) == ['folder']


def test_the_file_has_the_rights_of_the_users_mask(tmp_path):
    mask = os.umask(0o027)
    try:
        write_whole(str(tmp_path / 'file'), b'data')
    finally:
        os.umask(mask)
    assert stat.S_IMODE(os.stat(str(tmp_path / 'file')).st_mode) == 0o640


@pytest.mark.parametrize('text', ['[]', '{"frames": 3}', '{"frames"'])
def test_what_is_no_session_is_refused_and_kept(tmp_path, text):
    (tmp_path / 'frames.json').write_text(text)
    with pytest.raises(ValueError), changing(str(tmp_path)):
        pass
    assert (tmp_path / 'frames.json').read_text() == text
