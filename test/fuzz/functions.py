"""Invalid values for parsers and conversions, which may only raise ValueError, OSError or yaml.YAMLError."""
import glob
import json
import os
import pathlib
import tempfile
import time
import zipfile

import numpy as np
import yaml

from fuzz import hostile
from ros_3d_bb.bags.process_bag import read_params
from ros_3d_bb.camera.camera_model import transform_from
from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, DEPTH_TOPIC, INFO_TOPICS
from ros_3d_bb.conversions.image_msgs import array_from, imgmsg_to_depth, imgmsg_to_rgb
from ros_3d_bb.conversions.perception_msgs import (boxes2d_from_msg, boxes2d_to_msg, boxes3d_from_msg,
                                                   boxes3d_to_msg, camera_from_msg, tracks_from_msg,
                                                   tracks_to_msg, usable_boxes3d)
from ros_3d_bb.conversions.planner_msgs import points_to_msg
from ros_3d_bb.core.params import params_from
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.detection.boxes import non_maximum_suppression
from ros_3d_bb.detection.depth.person_clusters import DepthPeopleParams
from ros_3d_bb.detection.network_detector import DetectionParams, NetworkDetector, ranked
from ros_3d_bb.detection.onnx.decoders import decode_rows
from ros_3d_bb.detection.onnx.heads import HEADS, P3, P6
from ros_3d_bb.detection.onnx.onnx_model import OnnxModel
from ros_3d_bb.detection.yolov5.checkpoint import read_checkpoint
from ros_3d_bb.detection.yolov5.onnx_writer import Graph, metadata_entry
from ros_3d_bb.detection.yolov5.predictions import decode_heads
from ros_3d_bb.estimation.box3d_estimator import check_rect, estimate_boxes, estimator_named
from ros_3d_bb.estimation.error_model import read_error_model
from ros_3d_bb.pipeline.detection_stage import DepthDetectorParams, Yolov5NodeParams
from ros_3d_bb.pipeline.estimation_stage import Bbox3dParams
from ros_3d_bb.pipeline.tracking_stage import TRACKING_PARAMS, TrackerNodeParams
from ros_3d_bb.planning.planner_view import footprint_points, in_frame, predicted_to, usable_tracks
from ros_3d_bb.sessions.session_reader import read_session
from ros_3d_bb.visualization.markers import MarkerParams
from ros_3d_bb.tracking.types import detections_from_boxes
from ros_3d_bb_annotator import legacy
from ros_3d_bb_annotator.lengths import parse_length
from ros_3d_bb_lab.simulation.scenario import read_scenario, scenario_from
from support.masterless import on_the_wire
from support.onnx_files import (FLOAT, UINT8, outputs_of, write_constant_network, write_layers, write_mean_network)

CONFIG = os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', '..', 'config')
NOW_NS = 1000 * NS
PARAMS = (Bbox3dParams, TrackerNodeParams, MarkerParams, DepthDetectorParams, DepthPeopleParams,
          Yolov5NodeParams) + TRACKING_PARAMS
VALUES = (0, 1, -1, 2 ** 70, 0.5, float('nan'), float('inf'), True, None, '', 'map', '1, 2', [], [1, 'a'], {}, {'a': 1},
          'x' * 300, b'x', [[]] * 3)
FROM_CAMERA = transform_from((1, 2, 0.5), (-0.5, 0.5, -0.5, 0.5))
GOOD = hostile.good_messages(NOW_NS)


def _made(read, topic):
    """Function that reads an invalid message of a topic."""
    return lambda source, _folder: read(hostile.makers(source, NOW_NS, GOOD, 0.5)[topic]())


def _array(source, _folder):
    array_from(hostile.image(source, NOW_NS, GOOD[COLOR_TOPIC]))


def _boxes2d(source, _folder):
    boxes = boxes2d_from_msg(hostile.boxes2d(source, NOW_NS))
    back = boxes2d_from_msg(boxes2d_to_msg(boxes.boxes, source.header(NOW_NS), boxes.labels, boxes.scores))
    assert back.boxes.tolist() == boxes.boxes.tolist() and back.labels == boxes.labels


def _boxes3d(source, _folder):
    message = hostile.boxes3d(source, NOW_NS)
    on_the_wire(boxes3d_to_msg(boxes3d_from_msg(message), message.header, hostile.CAMERA))


def _detections(source, _folder):
    usable, _faults = usable_boxes3d(hostile.boxes3d(source, NOW_NS))
    for detection in detections_from_boxes(usable, FROM_CAMERA):
        assert np.isfinite(detection.position_m).all() and min(detection.size_m) > 0


def _tracks(source, _folder):
    tracks, faults = usable_tracks(tracks_from_msg(hostile.tracks(source, NOW_NS)))
    header = source.header(NOW_NS)
    on_the_wire(tracks_to_msg(in_frame(predicted_to(tracks, abs(source.gauss(0, 1))), FROM_CAMERA), header))
    on_the_wire(points_to_msg(footprint_points(tracks, 0.5, 0.05), header))
    if faults:
        raise ValueError(faults[0])


def _estimates(source, _folder):
    corners_px = [np.sort(np.reshape([source.randrange(-5, 70) for _edge in range(4)], (2, 2)), axis=0)
                  for _rect in range(2)]
    corners_px.append(np.array([[source.choice((-2 ** 31, 0))] * 2, [source.choice((40, 2 ** 31 - 2))] * 2]))
    rects_px = [tuple((rect + [[0], [1]]).ravel().tolist()) for rect in corners_px]
    for rect_px in rects_px:
        check_rect(rect_px)
    depth = imgmsg_to_depth(hostile.image(source, NOW_NS, GOOD[DEPTH_TOPIC]))
    camera = hostile.CAMERA._replace(width=depth.values.shape[1], height=depth.values.shape[0])
    estimate_boxes(depth, rects_px, camera, estimator_named(source.choice(('foreground', 'median')), 20))


def _predictions(source, _folder):
    rows = np.reshape(source.numbers(7 * source.choice((0, 1, 5))), (-1, 7))
    candidates = ranked(decode_rows([rows.astype(np.float32)[None]], (64, 64), 2, 0.25), [0, 1])
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
    """Bytes of which some are changed, removed, doubled, replaced by tokens of a parser, or cut off at the end."""
    for _fault in range(source.choice((1, 1, 2, 5))):
        where = source.randrange(len(data) + 1)
        removed, inserted = source.choice((
            (1, bytes([source.randrange(256)])), (source.choice((1, 10, 1000)), b''), (0, data[where:where + 50]),
            (source.choice((0, 3)), source.choice(TOKENS)), (len(data), b'')))
        data = data[:where] + inserted + data[where + removed:]
    return data


TOKENS = (b'[' * 3000, b'{"a":' * 3000, b'-1', b'1e999', b'NaN', b'null', b'true', b'"', b"'", b': ', b'\n- ', b'\n  ',
          b'&a [*a]', b'!!python/object/apply:os.system [x]', b'\x00', b'\xff\xfe', b'9' * 5000, b'0x' + b'f' * 300,
          b'[]', b'{}', b'? ', b'<<: *b', b'2001-01-01', b'1:2:3', '\u0661'.encode())


def _file(read, name, *texts):
    """Function that reads a mutated text from a file."""
    def read_mutated(source, folder):
        path = pathlib.Path(folder, name)
        path.write_bytes(_mutated(source, source.choice(texts)))
        read(str(path))
    return read_mutated


MODELS, SCENARIOS, (TRACKER,) = (
    [pathlib.Path(path).read_bytes() for path in sorted(glob.glob(os.path.join(CONFIG, pattern)))]
    for pattern in ('error_models/*.yaml', 'scenarios/*.yaml', 'tracker.yaml'))
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
    """The content with another value somewhere."""
    if isinstance(content, dict) and content and source.random() < 0.8:
        key = source.choice(sorted(content, key=str))
        return dict(content, **{key: _changed(source, content[key])})
    if isinstance(content, list) and content and source.random() < 0.8:
        at = source.randrange(len(content))
        return content[:at] + [_changed(source, content[at])] + content[at + 1:]
    return source.choice(VALUES)


def _checkpoint(source, folder):
    """Random opcodes of a pickle, in the archive of a checkpoint."""
    path = os.path.join(folder, 'weights.pt')
    opcodes = (b'.0125FNKJMIUXTC}]()aesbtdlhjgpqrRQc'
               b'\x80\x81\x82\x85\x86\x87\x88\x89\x8a\x8c\x8e\x8f\x90\x92\x93\x94\x95')
    with zipfile.ZipFile(path, 'w') as archive:
        pickled = b'\x80\x02' + bytes(source.choice(opcodes) for _opcode in range(source.randrange(40)))
        pickled += b'ctorch\nFloatStorage\ncmodels.yolo\nModel\n.'
        archive.writestr('archive/data.pkl', _mutated(source, pickled))
        archive.writestr('archive/data/0', source.bytes_of(64))
    read_checkpoint(path)


def _onnx_seeds():
    """Contents of small ONNX files of all families."""
    boxes, scores, strides = [(1.5, 2, 20, 30)], [(0.9, 0.1, 0.2)], {'nanodet-plus': P6, 'picodet': P6}
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder, 'seed.onnx')
        write_layers(path)
        yield path.read_bytes()
        for element in (FLOAT, UINT8):
            write_mean_network(path, element=element)
            yield path.read_bytes()
        for head in HEADS:
            outputs = outputs_of(head, boxes, scores, (64, 64), strides.get(head, P3))
            write_constant_network(path, outputs, (1, 3, 64, 64), metadata=METADATA)
            yield path.read_bytes()


METADATA = {'names': "{0: 'person', 1: 'dog', 2: 'chair'}", 'stride': '32', 'task': 'detect', 'end2end': 'False',
            'args': "{'nms': False}"}
SETTINGS = [text.encode() for text in (
    'head: yolox\nstrides: [8, 16, 32]\nnames: [person, dog, chair]\n', 'mean: [1, 2, 3]\nstd: [4, 5, 6]\ncolor: bgr\n',
    'resize: stretch\npadding: 0\n', '')]


def _flipped(source, content):
    """Bytes of which some have another value; the lengths in the file remain valid."""
    content = bytearray(content)
    for _byte in range(source.choice((1, 1, 2, 5))):
        content[source.randrange(len(content))] = source.choice((0, 1, 127, 255, source.randrange(256)))
    return bytes(content)


def _absurd_onnx(source):
    """An ONNX file of operators whose results may have any size."""
    def sizes(count):
        return [source.choice((0, 1, 1, 2, -1, 3, 64, 1000, 10 ** 5, 2 ** 31, 2 ** 40, 2 ** 62)) for _n in range(count)]

    graph, value = Graph(), 'images'
    for _operator in range(source.choice((1, 2, 3))):
        shape = graph.constant(np.array(sizes(4), np.int64))
        value = source.choice((
            lambda: graph.node('ConstantOfShape', [shape]), lambda: graph.node('Expand', [value, shape]),
            lambda: graph.node('Tile', [value, shape]), lambda: graph.node('Reshape', [value, shape]),
            lambda: graph.node('Pad', [value, graph.constant(np.array(sizes(8), np.int64))]),
            lambda: graph.node('Resize', [value, '', graph.constant(np.float32(sizes(4)))], mode='nearest'),
            lambda: graph.node('MaxPool', [value], kernel_shape=[2, 2], pads=[abs(n) for n in sizes(4)]),
            lambda: graph.node('Concat', [value] * 100, axis=sizes(1)[0])))()
    shape = tuple(source.choice(((1, 3, 64, 64), (1, 3, 'h', 'w'), (1, 64, 64, 3), (1, 3) + tuple(sizes(2)))))
    return graph.model([('images', FLOAT, shape)], [(value, FLOAT, ('a', 'b', 'c'))], {})


def _onnx(source, folder):
    """A damaged ONNX file, or a valid one with damaged metadata, or with a damaged YAML file; and an image for it."""
    onnx, settings = pathlib.Path(folder, 'network.onnx'), pathlib.Path(folder, 'network.yaml')
    content, settings_text, kind = source.choice(ONNX), b'', source.randrange(5)
    if kind == 0:
        content = _mutated(source, content)
    elif kind == 1:
        content = _flipped(source, content)
    elif kind == 4:
        content = _absurd_onnx(source)
    elif kind == 2:
        key = source.choice(sorted(METADATA))
        content += metadata_entry(key, _mutated(source, METADATA[key].encode()).decode('utf-8', 'replace'))
    else:
        settings_text = _mutated(source, source.choice(SETTINGS))
    onnx.write_bytes(content)
    settings.write_bytes(settings_text)
    network = OnnxModel(str(onnx), 1)
    detector = NetworkDetector(network, DetectionParams(classes=[0], image_size=64))
    assert np.isfinite(detector.detect(IMAGE).boxes).all()


ONNX, IMAGE = list(_onnx_seeds()), np.full((48, 64, 3), 90, np.uint8)


def _length(source, _folder):
    parse_length(_mutated(source, b'1,230.5 mm').decode('utf-8', 'replace'), source.choice(('mm', 'm')))


def _tracker_params(path):
    read_params(path, (TrackerNodeParams(), MarkerParams()) + tuple(kind() for kind in TRACKING_PARAMS))


FUNCTIONS = {  # name: (function of a Source and a folder, relative frequency)
    'array_from': (_array, 10), 'imgmsg_to_rgb': (_made(imgmsg_to_rgb, COLOR_TOPIC), 8),
    'imgmsg_to_depth': (_made(imgmsg_to_depth, DEPTH_TOPIC), 8),
    'camera_from_msg': (_made(camera_from_msg, INFO_TOPICS[0]), 8),
    'boxes2d_from_msg, boxes2d_to_msg': (_boxes2d, 6), 'boxes3d_from_msg, boxes3d_to_msg': (_boxes3d, 3),
    'usable_boxes3d, detections_from_boxes': (_detections, 4), 'tracks, planners': (_tracks, 3),
    'estimate_boxes': (_estimates, 2), 'decode_rows, ranked, non_maximum_suppression': (_predictions, 3),
    'decode_heads': (_heads, 2), 'params_from': (_params, 15), 'parse_length': (_length, 10),
    'scenario_from': (_scenario, 2), 'read_scenario': (_file(read_scenario, 'scenario.yaml', *SCENARIOS), 0.1),
    'read_error_model': (_file(read_error_model, 'model.yaml', *MODELS), 0.1),
    'read_params': (_file(_tracker_params, 'tracker.yaml', TRACKER), 0.05),
    'read_session': (_file(lambda path: read_session(os.path.dirname(path)), 'frames.json', SESSION), 0.5),
    'legacy.read': (_file(lambda path: legacy.read(os.path.dirname(path)), legacy.TEXT_NAME, OLD), 0.5),
    'read_checkpoint': (_checkpoint, 0.3), 'OnnxModel': (_onnx, 0.3)}


def fuzz_functions(seed, count, deadline_s=float('inf')):
    """Call the functions until a number of calls, or a time on time.monotonic().

    Returns {name: [calls, rejections]}. Raises any other exception of a function.
    """
    source, counts = hostile.Source(seed), {name: [0, 0] for name in FUNCTIONS}
    names, shares = list(FUNCTIONS), [share for _call, share in FUNCTIONS.values()]
    with tempfile.TemporaryDirectory() as folder, np.errstate(all='ignore'):
        for number in range(count):
            if number % 100 == 0:
                batch = source.choices(names, shares, k=100)
                if time.monotonic() >= deadline_s:
                    break
            name = batch[number % 100]
            counts[name][0] += 1
            try:
                FUNCTIONS[name][0](source, folder)
            except (ValueError, OSError, yaml.YAMLError):  # OSError: a scenario names a missing file
                counts[name][1] += 1
            except Exception:
                print('%s, seed %d: at call %d' % (name, seed, number))
                raise
    return counts
