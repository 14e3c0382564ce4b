import multiprocessing
import os
import pathlib
import re

import cv2
import numpy as np
import pytest

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.estimation.box3d import Box3D
from ros_3d_bb.sessions import session_writer
from ros_3d_bb.sessions.session_reader import SessionError, read_color, read_depth, read_session
from ros_3d_bb.sessions.session_writer import append
from ros_3d_bb.sessions.snapshots import ColorImage, Snapshot
from support.small_session import change_json

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


def content_of(target):
    """{path: bytes} of all files in a folder except for the lock."""
    return {str(path.relative_to(target)): path.read_bytes()
            for path in pathlib.Path(target).glob('**/*') if path.is_file() and path.name != '.lock'}


def append_error(target, record):
    """The ValueError of a measurement that is rejected and does not change the session."""
    before = content_of(target)
    with pytest.raises(ValueError) as error:
        append(target, record)
    assert content_of(target) == before
    return str(error.value)


@pytest.fixture
def target(tmp_path):
    return str(tmp_path / 'a campaign' / 'session')


def test_measurements_are_read_back(target):
    sent, labels = [measurement(0), measurement(1)], ['', 'A1, arms up']
    stored = [append(target, one, label) for one, label in zip(sent, labels)]
    session = read_session(target)
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


def _append_many(target, first):
    for number in range(first, first + 10):
        append(target, measurement(number))


def test_concurrent_measurements_are_not_lost(target):
    others = [multiprocessing.Process(target=_append_many, args=(target, first)) for first in (0, 100)]
    for other in others:
        other.start()
    for other in others:
        other.join()
    session = read_session(target)
    assert len(set(frame.id for frame in session.frames)) == 20
    for frame in session.frames:
        read_color(frame, session.camera)


@pytest.mark.parametrize('changes, named', [
    ({'camera': CAMERA._replace(fx=60.5)}, 'intrinsics .*60.5'),
    ({'color': measurement().color._replace(frame_id='another')}, 'frame .*optical.*another'),
    ({'depth': DepthImage(np.zeros((48, 64), np.uint16), 0.0001)}, 'depth scale .*0.001.*0.0001'),
    ({'color': ColorImage(np.zeros((50, 64, 3), np.uint8), 'optical')}, 'colour .*64 x 50'),
    ({'boxes3d': (BOX._replace(center_m=np.full(3, np.nan)),)}, 'nan')])
def test_invalid_measurements_and_those_of_another_camera_are_rejected(target, changes, named):
    append(target, measurement(0))
    assert re.search(named, append_error(target, measurement(1, **changes)))


@pytest.mark.parametrize('content', [b'', b'{"camera": {', b'{"label": "\xe4"}'])
def test_a_damaged_description_is_named_and_kept(target, content):
    append(target, measurement(0))
    path = os.path.join(target, 'frames.json')
    with open(path, 'wb') as stream:
        stream.write(content)
    assert append_error(target, measurement(1)).startswith(path + ': not the description of a measurement session (')


@pytest.mark.parametrize('full_at', ['color', 'depth', 'frames.json'])
def test_a_full_disk_does_not_change_the_session(target, monkeypatch, full_at):
    append(target, measurement(0))
    before, write_whole = content_of(target), session_writer.atomic_write

    def failing(path, data):
        if full_at in os.path.relpath(path, target):
            raise OSError(28, 'No space left on device')
        write_whole(path, data)

    monkeypatch.setattr(session_writer, 'atomic_write', failing)
    with pytest.raises(OSError):
        append(target, measurement(1))
    assert content_of(target) == before


def read_frame(folder, **changes):
    """The first frame of a session, after a change of fields in its description; None removes a field."""
    def change(content):
        entry = content['frames'][0]
        entry.update(changes)
        for name in [name for name, value in entry.items() if value is None]:
            del entry[name]
    change_json(folder, change)
    return read_session(folder).frames[0]


def test_the_example_of_a_session_is_valid(tmp_path):
    page = pathlib.Path(__file__).resolve().parents[2] / 'doc' / 'session.md'
    example, = re.findall(r'^```\n(\{.*?)```', page.read_text(encoding='utf-8'), re.DOTALL | re.MULTILINE)
    (tmp_path / 'frames.json').write_text(example)
    frame, = read_session(str(tmp_path)).frames
    assert frame.label == 'facing the camera' and frame.boxes_px == ((224, 1, 412, 474),)


@pytest.mark.parametrize('lens, expected', [
    ({}, ('', ())), ({'distortion': [0.1, 0, 0, 0, 0.2]}, ('plumb_bob', (0.1, 0, 0, 0, 0.2))),
    ({'distortion_model': 'equidistant', 'distortion': [0.1, 0, 0, 0]}, ('equidistant', (0.1, 0, 0, 0)))])
def test_lens_distortion_is_that_of_plumb_bob_unless_specified(folder, lens, expected):
    change_json(folder, lambda content: content['camera'].update(lens))
    camera = read_session(folder).camera
    assert (camera.distortion_model, camera.distortion) == expected


def test_sessions_may_store_one_detection_in_the_frame(folder):
    frame = read_frame(folder, detections=None, box=[1, 2, 3, 4], estimate_mm=[1, 2, 3])
    assert frame.boxes_px == ((1, 2, 3, 4),) and frame.estimate_m.tolist() == [0.001, 0.002, 0.003]
    assert frame.detections[0].truncated is None
    frame = read_frame(folder, box=None, estimate_mm=None)
    assert frame.boxes_px == () and frame.estimate_m is None and frame.truth_m is None


def test_the_annotated_person_is_first(folder):
    boxes = [{'box': [10, 20, 60, 200]}, {'box': [100, 20, 150, 200]}, {'box': [12, 20, 64, 300], 'by': 'hand'}]

    def boxes_with(person):
        return [box[0] for box in read_frame(folder, detections=boxes, person=person).boxes_px]
    assert [boxes_with(person) for person in range(3)] == [[10, 100, 12], [100, 10, 12], [12, 100]]
    del boxes[1]['box']
    assert [boxes_with(person) for person in range(3)] == [[10, 12], [], [12]]


def test_rejected_measurements_are_skipped_even_if_invalid(folder):
    change_json(folder, lambda content: content['frames'].append({'id': 'b', 'rejected': 'no image'}))
    assert len(read_session(folder).frames) == 4


@pytest.mark.parametrize('edit,named', [
    (lambda content: content.pop('camera'), "'camera'"),
    (lambda content: content['camera'].update(fx=0), 'intrinsics'),
    (lambda content: content['camera'].update(depth_scale=-0.001), 'depth_scale is -0.001'),
    (lambda content: content['camera'].update(width=float('inf')), 'infinity'),
    (lambda content: content.update(frames=3), 'an object with frames expected'),
    (lambda content: content['frames'][0].pop('depth'), "'depth'"),
    (lambda content: content['frames'][0]['detections'][0].update(box=[1, 2, 3]), '[1, 2, 3]'),
    (lambda content: content['frames'].append(7), 'number 5')])
def test_invalid_descriptions_are_rejected(folder, edit, named):
    change_json(folder, edit)
    with pytest.raises(SessionError) as error:
        read_session(folder)
    assert 'frames.json' in str(error.value) and named in str(error.value)


@pytest.mark.parametrize('pixels,named', [
    (None, 'missing'), (np.zeros((48, 64), np.uint8), '16-bit'), (np.zeros((48, 64, 3), np.uint16), 'one channel'),
    (np.zeros((4, 6), np.uint16), '6 x 4')])
def test_unusable_depth_images_are_named(folder, pixels, named):
    session = read_session(folder)
    path = session.frames[0].depth_path
    os.remove(path)
    if pixels is not None:
        cv2.imwrite(path, pixels)
    with pytest.raises(SessionError) as error:
        read_depth(session.frames[0], session)
    assert path in str(error.value) and named in str(error.value)
