import os
import pathlib
import re

import cv2
import numpy as np
import pytest

from ros_3d_bb.sessions.session_reader import SessionError, read_depth, read_session
from support.small_session import change_json


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
