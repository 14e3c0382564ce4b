"""Locked updates of the description of a session, and atomic writes."""
import os
import stat

import pytest

from ros_3d_bb.core.atomic_file import atomic_write
from ros_3d_bb.sessions.session_writer import locked_update


def test_an_error_does_not_change_the_file(tmp_path):
    with locked_update(str(tmp_path)) as content:
        content['frames'].append({'id': 'a'})
    before = (tmp_path / 'frames.json').read_bytes()
    with pytest.raises(RuntimeError), locked_update(str(tmp_path)) as content:
        content['frames'] = []
        raise RuntimeError
    with pytest.raises(ValueError), locked_update(str(tmp_path)) as content:
        content['depth'] = float('nan')
    assert (tmp_path / 'frames.json').read_bytes() == before


def test_the_file_mode_follows_the_umask(tmp_path):
    mask = os.umask(0o027)
    try:
        atomic_write(str(tmp_path / 'file'), b'data')
    finally:
        os.umask(mask)
    assert stat.S_IMODE(os.stat(str(tmp_path / 'file')).st_mode) == 0o640
