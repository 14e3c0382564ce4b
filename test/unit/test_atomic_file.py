"""Locked updates of the description of a session, and atomic writes."""
import json
import multiprocessing
import os
import stat

import pytest

from ros_3d_bb.core.atomic_file import atomic_write, locked_update


def _add_many(folder, name, count):
    for number in range(count):
        with locked_update(folder) as content:
            content['frames'].append({'id': '%s-%d' % (name, number)})


def test_a_description_is_created_and_concurrent_updates_are_not_lost(tmp_path):
    others = [multiprocessing.Process(target=_add_many, args=(str(tmp_path), name, 20)) for name in 'ab']
    for other in others:
        other.start()
    for other in others:
        other.join()
    ids = [frame['id'] for frame in json.loads((tmp_path / 'frames.json').read_text())['frames']]
    assert sorted(ids) == sorted('%s-%d' % (name, number) for name in 'ab' for number in range(20))


def test_an_error_does_not_change_the_file(tmp_path):
    _add_many(str(tmp_path), 'a', 1)
    before = (tmp_path / 'frames.json').read_bytes()
    with pytest.raises(RuntimeError), locked_update(str(tmp_path)) as content:
        content['frames'] = []
        raise RuntimeError
    with pytest.raises(ValueError), locked_update(str(tmp_path)) as content:
        content['depth'] = float('nan')
    assert (tmp_path / 'frames.json').read_bytes() == before


def test_a_failed_write_leaves_no_temporary_file(tmp_path):
    (tmp_path / 'folder').mkdir()
    with pytest.raises(OSError):
        atomic_write(str(tmp_path / 'folder'), b'data')
    assert os.listdir(str(tmp_path)) == ['folder']


def test_the_file_mode_follows_the_umask(tmp_path):
    mask = os.umask(0o027)
    try:
        atomic_write(str(tmp_path / 'file'), b'data')
    finally:
        os.umask(mask)
    assert stat.S_IMODE(os.stat(str(tmp_path / 'file')).st_mode) == 0o640


@pytest.mark.parametrize('text', ['[]', '{"frames": 3}', '{"frames"'])
def test_invalid_descriptions_are_rejected_and_kept(tmp_path, text):
    (tmp_path / 'frames.json').write_text(text)
    with pytest.raises(ValueError), locked_update(str(tmp_path)):
        pass
    assert (tmp_path / 'frames.json').read_text() == text
