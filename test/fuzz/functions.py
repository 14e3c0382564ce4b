"""Wrong values for parsers and conversions. Each may refuse them by a ValueError (or what it documents), no more."""
import glob
import json
import os
import tempfile
import time
import zipfile
from typing import Callable, NamedTuple

import numpy as np
import yaml

from fuzz import hostile
from ros_3d_bb.bags.process_bag import read_params
from ros_3d_bb.camera.camera_model import transform_from
from ros_3d_bb.conversions.image_msgs import array_from, imgmsg_to_depth, imgmsg_to_rgb
from ros_3d_bb.conversions.perception_msgs import (boxes2d_from_msg, boxes2d_to_msg, boxes3d_from_msg,
                                                   boxes3d_to_msg, camera_from_msg, detections_from_msg,
                                                   tracks_from_msg, tracks_to_msg, usable_boxes3d)
from ros_3d_bb.conversions.planner_msgs import points_to_msg
from ros_3d_bb.core.params import params_from
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.detection.boxes import non_maximum_suppression
from ros_3d_bb.detection.depth.person_clusters import DepthPeopleParams
from ros_3d_bb.detection.yolov5.checkpoint import read_checkpoint
from ros_3d_bb.detection.yolov5.detector import filter_predictions
from ros_3d_bb.detection.yolov5.predictions import decode_heads
from ros_3d_bb.estimation.box3d_estimator import check_rect, estimate_boxes, estimator_named
from ros_3d_bb.estimation.error_model import read_error_model
from ros_3d_bb.pipeline.detection_stage import DepthDetectorParams, Yolov5NodeParams
from ros_3d_bb.pipeline.estimation_stage import Bbox3dParams
from ros_3d_bb.pipeline.tracking_stage import TRACKING_PARAMS, TrackerNodeParams
from ros_3d_bb.planning.planner_view import footprint_points, in_frame, predicted_to, usable_tracks
from ros_3d_bb.sessions.session_reader import read_session
from ros_3d_bb.visualization.markers import MarkerParams
from ros_3d_bb_annotator import legacy
from ros_3d_bb_annotator.lengths import parse_length
from ros_3d_bb_lab.simulation.scenario import read_scenario, scenario_from
from support.masterless import on_the_wire

CONFIG = os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', '..', 'config')
NOW_NS = 1000 * NS
PARAMS = (Bbox3dParams, TrackerNodeParams, MarkerParams, DepthDetectorParams, DepthPeopleParams,
          Yolov5NodeParams) + TRACKING_PARAMS
VALUES = (0, 1, -1, 2 ** 70, 0.5, float('nan'), float('inf'), True, None, '', 'map', '1, 2', [], [1, 'a'], {}, {'a': 1},
          'x' * 300, b'x', [[]] * 3)
FROM_CAMERA = transform_from((1, 2, 0.5), (-0.5, 0.5, -0.5, 0.5))


class Function(NamedTuple):
    """One of what is tried: `call(source, folder)`, and how often beside the others."""

    call: Callable
    share: float


GOOD = hostile.good_frame(NOW_NS)
INFO, DEPTH, COLOR = (GOOD[topic] for topic in (
    'camera/color/camera_info', 'camera/aligned_depth_to_color/image_raw', 'camera/color/image_raw'))


def _image(read, good):
    return lambda source, _folder: read(hostile.image(source, NOW_NS, good))


def _boxes2d(source, _folder):
    boxes = boxes2d_from_msg(hostile.boxes2d(source, NOW_NS))
    back = boxes2d_from_msg(boxes2d_to_msg(boxes.boxes, source.header(NOW_NS)))
    assert back.boxes.tolist() == boxes.boxes.tolist()


def _boxes3d(source, _folder):
    message = hostile.boxes3d(source, NOW_NS)
    on_the_wire(boxes3d_to_msg(boxes3d_from_msg(message), message.header, hostile.CAMERA))


def _detections(source, _folder):
    usable, _faults = usable_boxes3d(hostile.boxes3d(source, NOW_NS))
    for detection in detections_from_msg(usable, FROM_CAMERA):
        assert np.isfinite(detection.position_m).all() and (detection.size_m > 0).all()


def _tracks(source, _folder):
    tracks, faults = usable_tracks(tracks_from_msg(hostile.tracks(source, NOW_NS)))
    header = source.header(NOW_NS)
    on_the_wire(tracks_to_msg(in_frame(predicted_to(tracks, abs(source.gauss(0, 1))), FROM_CAMERA), header))
    on_the_wire(points_to_msg(footprint_points(tracks, 0.5, 0.05), header))
    if faults:
        raise ValueError(faults[0])


def _estimates(source, _folder):
    rects_px = [tuple(source.randrange(-5, 70) for _edge in range(4)) for _rect in range(2)]
    rects_px.append((source.choice((-2 ** 31, 0)),) * 2 + (source.choice((40, 2 ** 31 - 1)),) * 2)
    rects_px = [(min(rect_px[::2]), min(rect_px[1::2]), max(rect_px[::2]) + 1, max(rect_px[1::2]) + 1)
                for rect_px in rects_px]
    for rect_px in rects_px:
        check_rect(rect_px)
    depth = imgmsg_to_depth(hostile.image(source, NOW_NS, DEPTH))
    camera = hostile.CAMERA._replace(width=depth.values.shape[1], height=depth.values.shape[0])
    estimate_boxes(depth, rects_px, camera, estimator_named(source.choice(('foreground', 'median')), 20))


def _predictions(source, _folder):
    rows = np.array([[source.number() for _column in range(7)] for _row in range(source.choice((0, 1, 5)))])
    candidates = filter_predictions(rows.reshape(-1, 7).astype(np.float32), 0.25, [0, 1])
    detections = non_maximum_suppression(candidates, 0.45, 100)
    assert np.isfinite(detections.boxes).all()


def _heads(source, _folder):
    head = np.frombuffer(source.bytes_of(4 * 3 * 2 * 2 * 7), '<f4').reshape(1, 3, 2, 2, 7)
    decode_heads([head.transpose(0, 1, 4, 2, 3).reshape(1, 21, 2, 2)], np.ones((1, 3, 2), np.float32), [32], 0.25)


def _params(source, _folder):
    kind = source.choice(PARAMS)
    names = list(kind._fields) + ['unknown', '', 'a.b']
    params_from({source.choice(names): source.choice(VALUES) for _key in range(source.randrange(4))}, kind)


def _mutated(source, data):
    """Bytes with some changed, taken away, doubled, or replaced by what means something to a parser."""
    data = bytearray(data)
    for _fault in range(source.choice((1, 1, 2, 5))):
        where, kind = source.randrange(len(data) + 1), source.randrange(5)
        if kind == 0 and data:
            data[where % len(data)] = source.randrange(256)
        elif kind == 1:
            del data[where:where + source.choice((1, 10, 1000))]
        elif kind == 2:
            data[where:where] = data[where:where + 50]
        elif kind == 3:
            data[where:where + source.choice((0, 3))] = source.choice(TOKENS)
        else:
            data = data[:where]
    return bytes(data)


TOKENS = (b'[' * 3000, b'{"a":' * 3000, b'-1', b'1e999', b'NaN', b'null', b'true', b'"', b"'", b': ', b'\n- ', b'\n  ',
          b'&a [*a]', b'!!python/object/apply:os.system [x]', b'\x00', b'\xff\xfe', b'9' * 5000, b'0x' + b'f' * 300,
          b'[]', b'{}', b'? ', b'<<: *b', b'2001-01-01', b'1:2:3', '\u0661'.encode())


def _in_file(source, folder, name, text, read):
    path = os.path.join(folder, name)
    with open(path, 'wb') as stream:
        stream.write(_mutated(source, text))
    return read(path)


def _texts(pattern):
    found = []
    for path in sorted(glob.glob(os.path.join(CONFIG, pattern))):
        with open(path, 'rb') as stream:
            found.append(stream.read())
    return found


MODELS, SCENARIOS, TRACKER = _texts('error_models/*.yaml'), _texts('scenarios/*.yaml'), _texts('tracker.yaml')[0]
CONTENTS = [yaml.safe_load(text) for text in SCENARIOS]
SESSION = json.dumps({
    'camera': {'width': 64, 'height': 48, 'fx': 60, 'fy': 60, 'cx': 31, 'cy': 23, 'distortion': [0] * 5,
               'depth_scale': 0.001, 'frame': 'camera'},
    'frames': [{'id': 'a', 'color': 'a.png', 'depth': 'b.png', 'box': [1, 2, 3, 4], 'estimate_mm': [1, 2, 3],
                'truth_mm': {'x': 1, 'z': 2}, 'stamp': '1.000000002'}]}).encode()
OLD = b'[(-7, 3, 300), (2971, 535, 6102)];30-03-2021-11-49-54\n[];30-03-2021-11-49-55\n'


def _scenario(source, _folder):
    scenario_from(_changed(source, source.choice(CONTENTS)))


def _changed(source, content):
    """A content of which something, somewhere, is another value."""
    if isinstance(content, dict) and content and source.random() < 0.8:
        key = source.choice(sorted(content, key=str))
        return dict(content, **{key: _changed(source, content[key])})
    if isinstance(content, list) and content and source.random() < 0.8:
        at = source.randrange(len(content))
        return content[:at] + [_changed(source, content[at])] + content[at + 1:]
    return source.choice(VALUES)


def _session(source, folder):
    _in_file(source, folder, 'frames.json', SESSION, lambda _path: read_session(folder))


def _old_session(source, folder):
    _in_file(source, folder, legacy.TEXT_NAME, OLD, lambda _path: legacy.read(folder))


def _checkpoint(source, folder):
    """Opcodes of a pickle at random, in the archive of a checkpoint."""
    path = os.path.join(folder, 'weights.pt')
    opcodes = (b'.0125FNKJMIUXTC}]()aesbtdlhjgpqrRQc'
               b'\x80\x81\x82\x85\x86\x87\x88\x89\x8a\x8c\x8e\x8f\x90\x92\x93\x94\x95')
    with zipfile.ZipFile(path, 'w') as archive:
        pickled = b'\x80\x02' + bytes(source.choice(opcodes) for _opcode in range(source.randrange(40)))
        pickled += b'ctorch\nFloatStorage\ncmodels.yolo\nModel\n.'
        archive.writestr('archive/data.pkl', _mutated(source, pickled))
        archive.writestr('archive/data/0', source.bytes_of(64))
    read_checkpoint(path)


FUNCTIONS = {
    'array_from': Function(_image(array_from, COLOR), 10), 'imgmsg_to_rgb': Function(_image(imgmsg_to_rgb, COLOR), 8),
    'imgmsg_to_depth': Function(_image(imgmsg_to_depth, DEPTH), 8),
    'camera_from_msg': Function(
        lambda source, _folder: camera_from_msg(hostile.camera_info(source, NOW_NS, INFO)), 8),
    'boxes2d_from_msg, boxes2d_to_msg': Function(_boxes2d, 6),
    'boxes3d_from_msg, boxes3d_to_msg': Function(_boxes3d, 3),
    'usable_boxes3d, detections_from_msg': Function(_detections, 4), 'tracks, planners': Function(_tracks, 3),
    'estimate_boxes': Function(_estimates, 2), 'filter_predictions, non_maximum_suppression': Function(_predictions, 3),
    'decode_heads': Function(_heads, 2), 'params_from': Function(_params, 15),
    'parse_length': Function(lambda source, _folder: parse_length(
        _mutated(source, b'1,230.5 mm').decode('utf-8', 'replace'), source.choice(('mm', 'm'))), 10),
    'scenario_from': Function(_scenario, 2),
    'read_scenario': Function(lambda source, folder: _in_file(
        source, folder, 'scenario.yaml', source.choice(SCENARIOS), read_scenario), 0.1),
    'read_error_model': Function(lambda source, folder: _in_file(
        source, folder, 'model.yaml', source.choice(MODELS), read_error_model), 0.1),
    'read_params': Function(lambda source, folder: _in_file(source, folder, 'tracker.yaml', TRACKER, lambda path: (
        read_params(path, (TrackerNodeParams(), MarkerParams()) + tuple(kind() for kind in TRACKING_PARAMS)))), 0.05),
    'read_session': Function(_session, 0.5), 'legacy.read': Function(_old_session, 0.5),
    'read_checkpoint': Function(_checkpoint, 0.3)}


def fuzz_functions(seed, count, deadline_s=float('inf')):
    """Call the functions so many times, or as many as it takes until a time on time.monotonic().

    Returns
    -------
    dict
        By function, [calls, of which were refused].

    Raises
    ------
    Exception
        What is no refusal.
    """
    source, counts = hostile.Source(seed), {name: [0, 0] for name in FUNCTIONS}
    names = list(FUNCTIONS)
    weights = [FUNCTIONS[name].share for name in names]
    with tempfile.TemporaryDirectory() as folder, np.errstate(all='ignore'):
        for number in range(count):
            if number % 100 == 0:
                batch = source.choices(names, weights, k=100)
                if time.monotonic() >= deadline_s:
                    break
            name = batch[number % 100]
            counts[name][0] += 1
            try:
                FUNCTIONS[name].call(source, folder)
            except (ValueError, OSError, yaml.YAMLError):  # OSError: a scenario names a file that is not there
                counts[name][1] += 1
            except Exception:
                print('%s, seed %d: at call %d' % (name, seed, number))
                raise
    return counts
