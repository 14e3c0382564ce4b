import contextlib
import multiprocessing
import os
import pathlib
import re
import stat

import numpy as np
import pytest

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.core.atomic_file import atomic_write, check_writable
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.estimation.box3d import Box3D
from ros_3d_bb.sessions import session_writer
from ros_3d_bb.sessions.session_reader import read_color, read_depth, read_session
from ros_3d_bb.sessions.session_writer import append
from ros_3d_bb.sessions.snapshots import ColorImage, Snapshot

CAMERA = Camera(64, 48, 60.0, 61.0, 31.5, 23.25, 'plumb_bob', (0.1, -0.2, 0.001, 0.002, 0.03))
STAMP_NS = 1616161616 * NS + 123456789
BOX = Box3D(np.array([0.1234, -0.25, 2.5]), np.array([0.5, 1.75, 0.5]), (10, 0, 30, 48), 0.75,
            (False, True, False, True))


def measurement(number=0, **changes):
    random = np.random.RandomState(number)
    values = dict(color=ColorImage(random.randint(0, 256, (48, 64, 3)).astype(np.uint8), 'optical'),
                  depth=DepthImage(random.randint(0, 65536, (48, 64)).astype(np.uint16), 0.001), camera=CAMERA,
                  stamp_ns=STAMP_NS + number * NS, boxes2d=((10, 0, 30, 48),), boxes3d=(BOX,))
    values.update(changes)
    return Snapshot(**values)


def content_of(folder):
    """{path: bytes} of all files in a folder except for the lock."""
    return {str(path.relative_to(folder)): path.read_bytes()
            for path in pathlib.Path(folder).glob('**/*') if path.is_file() and path.name != '.lock'}


def append_error(folder, record):
    """The ValueError of a measurement that is rejected and does not change the session."""
    before = content_of(folder)
    with pytest.raises(ValueError) as error:
        append(folder, record)
    assert content_of(folder) == before
    return str(error.value)


@pytest.fixture
def folder(tmp_path):
    """Folder of a session that does not exist yet."""
    return str(tmp_path / 'a campaign' / 'session')


def test_measurements_are_read_back(folder):
    sent, labels = [measurement(0), measurement(1)], ['', 'A1, arms up']
    stored = [append(folder, one, label) for one, label in zip(sent, labels)]
    session = read_session(folder)
    assert (session.camera, session.depth_scale_m, session.frame_id) == (CAMERA, 0.001, 'optical')
    assert [(frame.id, count) for count, frame in enumerate(session.frames, 1)] == stored
    for frame, one, label in zip(session.frames, sent, labels):
        np.testing.assert_array_equal(read_color(frame, session.camera), one.color.pixels)
        depth = read_depth(frame, session)
        np.testing.assert_array_equal(depth.values, one.depth.values)
        assert depth.scale_m == one.depth.scale_m
        assert (frame.stamp_ns, frame.label, frame.boxes_px) == (one.stamp_ns, label, ((10, 0, 30, 48),))
        detection, = frame.detections
        np.testing.assert_allclose(detection.estimate_m, BOX.center_m, atol=1e-6)
        np.testing.assert_allclose(detection.size_m, BOX.size_m[:2], atol=1e-6)
        assert (detection.support, detection.truncated, detection.by_hand) == (BOX.support, BOX.truncated, False)


def _append_many(folder, first):
    for number in range(first, first + 10):
        append(folder, measurement(number))


def test_concurrent_measurements_are_not_lost(folder):
    others = [multiprocessing.Process(target=_append_many, args=(folder, first)) for first in (0, 100)]
    for other in others:
        other.start()
    for other in others:
        other.join()
    session = read_session(folder)
    assert len(set(frame.id for frame in session.frames)) == 20
    for frame in session.frames:
        read_color(frame, session.camera)


@pytest.mark.parametrize('changes, named', [
    ({'camera': CAMERA._replace(fx=60.5)}, 'intrinsics .*60.5'),
    ({'color': measurement().color._replace(frame_id='another')}, 'frame .*optical.*another'),
    ({'depth': DepthImage(np.zeros((48, 64), np.uint16), 0.0001)}, 'depth scale .*0.001.*0.0001'),
    ({'color': ColorImage(np.zeros((50, 64, 3), np.uint8), 'optical')}, 'colour .*64 x 50'),
    ({'boxes3d': (BOX._replace(center_m=np.full(3, np.nan)),)}, 'nan')])
def test_invalid_measurements_and_those_of_another_camera_are_rejected(folder, changes, named):
    append(folder, measurement(0))
    assert re.search(named, append_error(folder, measurement(1, **changes)))


@pytest.mark.parametrize('content', [b'', b'{"camera": {', b'{"label": "\xe4"}'])
def test_a_damaged_description_is_named_and_kept(folder, content):
    append(folder, measurement(0))
    path = os.path.join(folder, 'frames.json')
    with open(path, 'wb') as stream:
        stream.write(content)
    assert append_error(folder, measurement(1)).startswith(path + ': not the description of a measurement session (')


@pytest.mark.parametrize('full_at', ['color', 'depth', 'frames.json'])
def test_a_full_disk_does_not_change_the_session(folder, monkeypatch, full_at):
    append(folder, measurement(0))
    before, write_whole = content_of(folder), session_writer.atomic_write

    def failing(path, data):
        if full_at in os.path.relpath(path, folder):
            raise OSError(28, 'No space left on device')
        write_whole(path, data)

    monkeypatch.setattr(session_writer, 'atomic_write', failing)
    with pytest.raises(OSError):
        append(folder, measurement(1))
    assert content_of(folder) == before


def test_an_error_does_not_change_the_file(tmp_path):
    with session_writer.locked_update(str(tmp_path)) as content:
        content['frames'].append({'id': 'a'})
    before = (tmp_path / 'frames.json').read_bytes()
    with pytest.raises(RuntimeError), session_writer.locked_update(str(tmp_path)) as content:
        content['frames'] = []
        raise RuntimeError
    with pytest.raises(ValueError), session_writer.locked_update(str(tmp_path)) as content:
        content['depth'] = float('nan')
    assert (tmp_path / 'frames.json').read_bytes() == before


def test_the_file_mode_follows_the_umask(tmp_path):
    mask = os.umask(0o027)
    try:
        atomic_write(str(tmp_path / 'file'), b'data')
    finally:
        os.umask(mask)
    assert stat.S_IMODE(os.stat(str(tmp_path / 'file')).st_mode) == 0o640


@pytest.mark.parametrize('path, is_writable', [('new', True), ('old', True), ('folder', False), ('missing/new', False)])
def test_it_is_checked_before_the_work_whether_a_file_can_be_written(tmp_path, path, is_writable):
    (tmp_path / 'folder').mkdir()
    (tmp_path / 'old').write_text('old')
    with contextlib.ExitStack() if is_writable else pytest.raises(OSError, match=path):
        check_writable(str(tmp_path / path))
    assert sorted(os.listdir(str(tmp_path))) == ['folder', 'old'] and (tmp_path / 'old').read_text() == 'old'


def test_invalid_measurements_do_not_prevent_others(folder):
    first, _count = append(folder, measurement(0))
    with session_writer.locked_update(folder) as content:
        content['frames'] += [{}, 7]
    assert append(folder, measurement(1))[0] != first
