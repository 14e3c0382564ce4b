import os

import numpy as np
import pytest

from ros_3d_bb.core.object_classes import COCO
from ros_3d_bb.detection.boxes import iou
from ros_3d_bb.detection.network_detector import DetectionParams, NetworkDetector
from ros_3d_bb.detection.onnx.onnx_model import OnnxModel
from ros_3d_bb.detection.weights import WeightsError
from ros_3d_bb.detection.yolov5.onnx_writer import Graph
from ros_3d_bb.sessions.session_reader import read_color, read_session
from support.onnx_files import FLOAT, FLOAT16, UINT8, outputs_of, write_constant_network, write_mean_network

DATA = os.environ.get('ROS_3D_BB_DATA', '')
HW = 96, 128
BOXES = np.array([(1.5, 2, 20, 30), (10, 3, 40, 20.25), (50, 2.5, 64, 33)])
SCORES = np.array([(0.9, 0.1, 0.2), (0.3, 0.8, 0.1), (0.2, 0.1, 0.7)])
ALL = DetectionParams(classes=list(range(3)))
TIE = 2e-5  # scores that differ by less are in another order after other rounding
pytestmark = pytest.mark.needs('onnxruntime')


def references(folder, family, session_folder):
    """Images, and the detections (n, 6) that ultralytics found in them with a network of this family."""
    session = read_session(session_folder)
    with np.load(os.path.join(folder, family + '_reference.npz')) as recorded:
        for number in [int(name[6:]) for name in recorded.files if name[6:].isdigit()]:
            yield read_color(session.frames[number], session.camera), recorded['frame_%d' % number]


class TiesAs(OnnxModel):
    """A YOLOv8 network whose ties are decided as in the `expected` detections (n, 6).

    The random networks of the reference give many scores of 1 within the rounding of float32, of several predictions
    that overlap, and of several classes of one prediction. ONNX Runtime and torch decide these differently.
    """

    expected = None

    def _run(self, image):
        outputs = super(TiesAs, self)._run(image)
        return outputs if self.expected is None else [decide_ties(outputs[0], self.expected)] + outputs[1:]


def decide_ties(output, expected):
    columns = output[0].copy()
    center, half, scores = columns[:2].T, columns[2:4].T / 2, columns[4:84].T
    corners = np.hstack((center - half, center + half))
    clipped = np.clip(corners, 0, [640, 480, 640, 480])
    tied = scores > scores.max(axis=1, keepdims=True) - TIE
    added = np.zeros_like(scores)
    for x1, y1, x2, y2, _score, number in expected:
        number = int(number)
        found = np.abs(clipped - (x1, y1, x2, y2)).max(axis=1) + ~tied[:, number]
        assert found.min() <= 0.5  # a prediction, and one of its best classes
        overlapping = iou(corners[found.argmin()], corners) > 0.45
        added[overlapping & tied[:, number], number] = np.maximum(added[overlapping & tied[:, number], number], TIE)
        added[found.argmin(), number] = 2 * TIE
    columns[4:84] += added.T
    return columns[None]


def assert_same_detections(detections, expected):
    """Whatever their order: the same classes, boxes within 0.5 px and scores within 1e-3."""
    assert len(detections.boxes) == len(expected)
    remaining = list(range(len(expected)))
    for box, score, number in zip(*detections):
        difference = np.abs(expected[remaining, :4] - box).max(axis=1) + 1e3 * (expected[remaining, 5] != number)
        nearest = remaining.pop(int(difference.argmin()))
        assert difference.min() <= 0.5 and abs(expected[nearest, 4] - score) <= 1e-3


if DATA:  # test_network_detector.py tests the decoders without recorded data
    @pytest.mark.needs('onnxruntime.tools.offline_tuning')  # ONNX Runtime 1.14 supports opset 18
    @pytest.mark.parametrize('size', ['480x640', 'dynamic'])
    @pytest.mark.parametrize('family', ['yolov8n', 'yolo11n', 'yolo26n', 'yolov8n-seg'])
    def test_detections_are_those_of_ultralytics(session_folder, family, size):
        folder = os.path.join(DATA, 'weights', 'exports')
        network = TiesAs(os.path.join(folder, '%s-%s.onnx' % (family, size)), 1)
        detector = NetworkDetector(network, DetectionParams(classes=list(range(80))))
        for image, network.expected in references(folder, family, session_folder):
            assert_same_detections(detector.detect(image), network.expected)
        assert network.names == list(COCO) and not network.suppressed


@pytest.mark.slow
def test_yolox_detects_the_person_in_a_measurement_session(session_folder, tmp_path):
    """In at least 109 of 110 frames, with a median IoU of at least 0.95 with the recorded boxes."""
    session = read_session(session_folder)
    weights = os.path.join(DATA, 'weights', 'yolox_nano.onnx')
    if not DATA:  # a network that gives the box of the first frame
        session = session._replace(frames=session.frames[:1])
        box = np.array(session.frames[0].boxes_px[0]) * 416 / 640.0
        weights = write_constant_network(
            tmp_path / 'yolox.onnx', outputs_of('yolox', [box], [[0.9] + [0] * 79], (416, 416)), (1, 3, 416, 416))
    detector = NetworkDetector(OnnxModel(weights, 1))
    overlaps = [max(iou(np.array(frame.boxes_px[0], float), detector.detect(read_color(frame, session.camera)).boxes),
                    default=0) for frame in session.frames]
    assert np.mean(np.array(overlaps) >= 0.5) >= 109 / 110
    assert np.median(overlaps) >= 0.95


@pytest.mark.parametrize('names, reason', [('', 'no names of its 3 classes.*YAML'),
                                           ("['Bus', 'Car', 'Dog']", '~classes.*Bus, Car, Dog')])
def test_a_class_that_the_network_does_not_have_is_named(tmp_path, names, reason):
    network = OnnxModel(write_constant_network(tmp_path / 'a.onnx', outputs_of('yolov8', BOXES, SCORES, HW),
                                               metadata={'names': names}), 1)
    with pytest.raises(ValueError, match="'person'.*" + reason):
        NetworkDetector(network)


COLOR = (3, 200, 5)


@pytest.mark.parametrize('shape, channels_last', [
    ((1, 3, 96, 128), False), ((1, 96, 128, 3), True), (('n', 3, 'h', 'w'), False), ((1, 'h', 'w', 3), True),
    ((1, 'channels', 'h', 'w'), False)])
@pytest.mark.parametrize('element, scale, atol', [(FLOAT, 1 / 255.0, 1e-4), (FLOAT16, 1 / 255.0, 1e-3), (UINT8, 1, 0)])
def test_every_input_format(tmp_path, shape, channels_last, element, scale, atol):
    network = OnnxModel(write_mean_network(tmp_path / 'a.onnx', shape, element, channels_last), 1)
    assert network.input_hw == (None if 'h' in shape else HW) and network.suppressed
    found = network.candidates(np.full(HW + (3,), COLOR, np.uint8), 0.25)
    np.testing.assert_allclose(found.boxes, [np.array(COLOR + COLOR[:1]) * scale], atol=atol)
    assert found.classes.tolist() == [int(COLOR[2] * scale)]


def test_the_yaml_file_gives_the_names_of_classes(tmp_path):
    path = write_constant_network(tmp_path / 'a.onnx', outputs_of('yolox', BOXES, SCORES, HW))
    (tmp_path / 'a.yaml').write_text('names: [person, dog, chair]')
    assert OnnxModel(path, 1).names == ['person', 'dog', 'chair']


@pytest.mark.parametrize('text', ['names: [a, no]', 'names: [a]\ncolor: bgr', '- a', 'a: [', 'names: &x [1]\nb: *x',
                                  '#' * 1000001, 'names: []', 'names: [a, b]'])
def test_yaml_files_that_cannot_be_used_are_rejected(tmp_path, text):
    path = write_constant_network(tmp_path / 'model.onnx', outputs_of('yolov8', BOXES, SCORES, HW))
    (tmp_path / 'model.yaml').write_text(text)
    with pytest.raises(WeightsError, match='(?s)model.*names'):
        OnnxModel(path, 1)


@pytest.mark.parametrize('shape, element, reason', [
    ((1, 1, 96, 128), FLOAT, '1 channels'), ((4, 3, 96, 128), FLOAT, 'not one image.*batch of 1'),
    ((1, 3, 96, 5000), FLOAT, '5000'), ((1, 3, 96, 128), 9, 'input is a tensor.bool.*float16')])
def test_inputs_that_are_not_a_color_image_are_rejected(tmp_path, shape, element, reason):
    path = write_constant_network(tmp_path / 'a.onnx', outputs_of('yolov8', BOXES, SCORES, HW), shape, element)
    with pytest.raises(WeightsError, match=reason):
        OnnxModel(path, 1)


def test_several_inputs_are_those_of_postprocessing(tmp_path):
    graph = Graph()
    output = graph.node('Identity', [graph.constant(np.zeros((1, 6), np.float32))])
    path = tmp_path / 'a.onnx'
    path.write_bytes(graph.model([('image', FLOAT, (1, 3, 96, 128)), ('scale_factor', FLOAT, (1, 2))],
                                 [(output, FLOAT, (1, 6))], {}))
    with pytest.raises(WeightsError, match='2 inputs.*postprocessing'):
        OnnxModel(str(path), 1)


def test_scores_that_are_none_are_rejected(tmp_path, monkeypatch):
    """At the start, if they are those of a grey image, or with the first image in which something is found."""
    with pytest.raises(WeightsError, match='scores.*3.5.*yolov8'):
        OnnxModel(write_constant_network(tmp_path / 'a.onnx', outputs_of('yolov8', BOXES, SCORES + 2.6, HW)), 1)
    network = OnnxModel(write_constant_network(tmp_path / 'b.onnx', [np.zeros((1, 1, 6))]), 1)
    monkeypatch.setattr(network, '_run', lambda _image: [np.array([[(0, 0.9, 100, 50, 200, 300)]])])  # class first
    with pytest.raises(ValueError, match='scores.*200.*end-to-end'):
        network.candidates(np.zeros(HW + (3,), np.uint8), 0.25)


@pytest.mark.needs('onnx')
def test_weights_in_a_second_file_are_named(tmp_path):
    import onnx
    path = write_constant_network(tmp_path / 'a.onnx', outputs_of('yolov8', BOXES, SCORES, HW))
    onnx.save(onnx.load(path), path, save_as_external_data=True, location='a.onnx.data', size_threshold=0)
    with pytest.raises(WeightsError, match='second file.*onnx.save'):
        OnnxModel(path, 1)


@pytest.mark.parametrize('metadata, reason', [
    ({'names': '3'}, 'names'), ({'names': 'person,car'}, "'person,car'"), ({'stride': '0'}, 'stride'),
    ({'stride': '[8, 16]'}, 'stride.*[8, 16].*1 to 1024'), ({'names': '[' * 100000}, 'a.onnx'),
    ({'names': "__import__('os').system('touch run')"}, 'a.onnx'), ({'task': 'classify'}, 'classify')])
def test_metadata_that_cannot_be_used_is_rejected_and_not_executed(tmp_path, monkeypatch, metadata, reason):
    monkeypatch.chdir(str(tmp_path))
    path = write_constant_network(tmp_path / 'a.onnx', outputs_of('yolov8', BOXES, SCORES, HW), metadata=metadata)
    with pytest.raises(WeightsError, match=reason):
        OnnxModel(path, 1)
    assert not os.path.exists('run')


@pytest.mark.parametrize('content', [b'\x3a\xff\x01abc', b'\xff' * 20, b'', b'nonsense'])
def test_damaged_files_are_rejected(tmp_path, content):
    path = tmp_path / 'a.onnx'
    path.write_bytes(content)
    with pytest.raises(WeightsError, match='a.onnx'):
        OnnxModel(str(path), 1)
