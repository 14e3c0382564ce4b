"""Reader of measurement sessions: their content, and errors for sessions that cannot be read."""
import json
import os
import shutil

import cv2
import numpy as np
import pytest

from ros_3d_bb.sessions.session_reader import SessionError, read_color, read_depth, read_session
from support.synthetic_session import FRAMES_PER_PLACE, PLACES_M, write_synthetic_session


@pytest.fixture(scope='module')
def original(tmp_path_factory):
    return write_synthetic_session(str(tmp_path_factory.mktemp('original')))


@pytest.fixture
def folder(original, tmp_path):
    """Copy of the session with one frame, for tests that damage it."""
    for name in ('color', 'depth'):
        os.makedirs(str(tmp_path / name))
        shutil.copy(os.path.join(original, name, '000.png'), str(tmp_path / name))
    with open(os.path.join(original, 'frames.json')) as stream:
        content = json.load(stream)
    content['frames'] = content['frames'][:1]
    (tmp_path / 'frames.json').write_text(json.dumps(content))
    return str(tmp_path)


def change(folder, edit):
    path = os.path.join(folder, 'frames.json')
    with open(path) as stream:
        content = json.load(stream)
    edit(content)
    with open(path, 'w') as stream:
        json.dump(content, stream)


def test_reads_a_session(session_folder):
    session = read_session(session_folder)
    frame = session.frames[0]
    assert session.camera.fx == pytest.approx(614.686) and session.depth_scale_m == 0.001
    assert session.frame_id == 'camera_color_optical_frame'
    assert len(session.frames) in (110, len(PLACES_M) * FRAMES_PER_PLACE)
    color, depth = read_color(frame, session.camera), read_depth(frame, session)
    assert color.shape == (480, 640, 3) and color.dtype == np.uint8
    assert depth.values.shape == (480, 640) and depth.values.dtype == np.uint16 and depth.scale_m == 0.001
    assert abs(frame.estimate_m[2] - frame.truth_m[1]) < 0.1 and len(frame.boxes_px) == 1


@pytest.mark.slow
def test_lens_distortion_is_that_of_plumb_bob(folder):
    assert read_session(folder).camera.distortion_model == ''
    change(folder, lambda content: content['camera'].update(distortion=[0.1, 0, 0, 0, 0.2]))
    camera = read_session(folder).camera
    assert (camera.distortion_model, camera.distortion) == ('plumb_bob', (0.1, 0, 0, 0, 0.2))


def test_colour_is_read_as_rgb(original):
    session = read_session(original)
    x1, y1, x2, y2 = session.frames[0].boxes_px[0]
    assert read_color(session.frames[0], session.camera)[(y1 + y2) // 2, (x1 + x2) // 2].tolist() == [200, 30, 30]


def test_annotations_are_optional(folder):
    def bare(content):
        for field in ('box', 'estimate_mm', 'truth_mm'):
            del content['frames'][0][field]
    change(folder, bare)
    frame = read_session(folder).frames[0]
    assert frame.boxes_px == () and frame.estimate_m is None and frame.truth_m is None


def test_a_frame_may_have_several_boxes(folder):
    boxes = [{'box': [1, 2, 3, 4], 'estimate_mm': [1, 2, 3]}, {'box': [5, 6, 7, 8]}]
    change(folder, lambda content: content['frames'][0].update(detections=boxes))
    frame = read_session(folder).frames[0]
    assert frame.boxes_px == ((1, 2, 3, 4), (5, 6, 7, 8)) and frame.estimate_m.tolist() == [0.001, 0.002, 0.003]


def test_the_annotated_person_is_first_and_a_box_by_hand_replaces_its_detection(folder):
    boxes = [{'box': [10, 20, 60, 200]}, {'box': [100, 20, 150, 200]}, {'box': [12, 20, 64, 300], 'by': 'hand'}]

    def boxes_with(person):
        change(folder, lambda content: content['frames'][0].update(detections=boxes, person=person))
        return [box[0] for box in read_session(folder).frames[0].boxes_px]
    assert [boxes_with(person) for person in range(3)] == [[10, 100, 12], [100, 10, 12], [12, 100]]
    del boxes[1]['box']
    assert [boxes_with(person) for person in range(3)] == [[10, 12], [], [12]]


def test_optional_fields_of_a_measurement_are_read(folder):
    change(folder, lambda content: content['frames'][0].update(
        stamp='1616161616.000000007', label='far', truth_mm={'x': 1, 'y': -2, 'z': 3}, detections=[
            {'box': [1, 2, 3, 4], 'size_mm': [400, 1700], 'support': 0.5, 'truncated': True}]))
    frame = read_session(folder).frames[0]
    assert (frame.stamp_ns, frame.label, frame.truth_y_m) == (1616161616000000007, 'far', -0.002)
    detection, = frame.detections
    assert detection.size_m.tolist() == [0.4, 1.7] and (detection.support, detection.truncated) == (0.5, True)
    assert detection.estimate_m is None and not detection.by_hand


def test_rejected_measurements_are_skipped_even_if_invalid(folder):
    change(folder, lambda content: content['frames'].append({'id': 'b', 'rejected': 'no image'}))
    assert len(read_session(folder).frames) == 1


def test_the_lens_model_may_be_specified(folder):
    change(folder, lambda content: content['camera'].update(distortion_model='equidistant', distortion=[0.1, 0, 0, 0]))
    assert read_session(folder).camera.distortion_model == 'equidistant'


@pytest.mark.parametrize('edit,named', [
    (lambda content: content.pop('camera'), "'camera'"),
    (lambda content: content['camera'].pop('fx'), "'fx'"),
    (lambda content: content['camera'].update(fx=0), 'intrinsics'),
    (lambda content: content['camera'].update(distortion=[0.1, 0.2]), 'plumb_bob'),
    (lambda content: content['camera'].update(width='wide'), 'wide'),
    (lambda content: content.update(frames=3), 'not iterable'),
    (lambda content: content['frames'][0].pop('depth'), "'depth'"),
    (lambda content: content['frames'][0].update(box=['a']), "'a'"),
    (lambda content: content['frames'][0].update(box=[1, 2, 3]), '[1, 2, 3]'),
    (lambda content: content['frames'][0].update(box=[1, 2, 3, float('inf')]), '[1, 2, 3, inf]'),
    (lambda content: content['camera'].update(depth_scale=-0.001), 'depth_scale is -0.001'),
    (lambda content: content['camera'].update(width=float('inf')), 'infinity'),
    (lambda content: content['frames'].append(7), 'number 2')])
def test_invalid_descriptions_are_rejected(folder, edit, named):
    change(folder, edit)
    with pytest.raises(SessionError) as error:
        read_session(folder)
    assert 'frames.json' in str(error.value) and named in str(error.value)


def test_a_folder_without_session_is_named(tmp_path):
    with pytest.raises(SessionError, match=str(tmp_path)):
        read_session(str(tmp_path))


def test_broken_json_is_named(folder):
    with open(os.path.join(folder, 'frames.json'), 'a') as stream:
        stream.write('}')
    with pytest.raises(SessionError, match='frames.json'):
        read_session(folder)


@pytest.mark.parametrize('pixels,named', [
    (None, 'missing'), (np.zeros((480, 640), np.uint8), '16-bit'), (np.zeros((480, 640, 3), np.uint16), 'one channel'),
    (np.zeros((48, 64), np.uint16), '64 x 48')])
def test_unusable_depth_images_are_named(folder, pixels, named):
    path = os.path.join(folder, 'depth', '000.png')
    os.remove(path)
    if pixels is not None:
        cv2.imwrite(path, pixels)
    session = read_session(folder)
    with pytest.raises(SessionError) as error:
        read_depth(session.frames[0], session)
    assert path in str(error.value) and named in str(error.value)


def test_grey_colour_images_are_named(folder):
    cv2.imwrite(os.path.join(folder, 'color', '000.png'), np.zeros((480, 640), np.uint8))
    session = read_session(folder)
    with pytest.raises(SessionError, match=session.frames[0].color_path):
        read_color(session.frames[0], session.camera)
