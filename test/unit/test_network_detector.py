import numpy as np
import pytest
from hypothesis import given, strategies as st

from ros_3d_bb.detection.boxes import Detections, iou, non_maximum_suppression
from ros_3d_bb.detection.network_detector import DetectionParams, GREY, NetworkDetector, fit_image, ranked
from ros_3d_bb.detection.onnx.heads import HEADS, layout_of
from ros_3d_bb.detection.yolov5.backends import open_runtime
from ros_3d_bb.detection.yolov5.predictions import Backend
from ros_3d_bb.sessions.session_reader import read_color, read_session
from support.onnx_files import outputs_of


class FixedRuntime(Backend):
    """Returns the same predictions for every image."""

    names, stride, description = ['person', 'cat'], 32, 'fixed'

    def __init__(self, rows=()):
        self.rows = np.array(rows, np.float32).reshape(-1, 7)
        self.inputs = []

    def __call__(self, image, _min_objectness):
        assert image.dtype == np.uint8
        self.inputs.append(image)
        return self.rows


@pytest.mark.slow
def test_detects_the_person_in_a_measurement_session(session_folder, weights):
    """In at least 107 of 110 frames at confidence 0.25, with a median IoU of at least 0.93 with the recorded boxes."""
    session = read_session(session_folder)
    detector = NetworkDetector(open_runtime(weights), DetectionParams(confidence=0.25))
    overlaps = []
    for frame in session.frames:
        detections = detector.detect(read_color(frame, session.camera))
        overlaps.append(max(iou(np.array(frame.boxes_px[0], float), detections.boxes), default=0))
    assert np.mean(np.array(overlaps) > 0.5) >= 107 / 110
    assert np.median(overlaps) >= 0.93


@pytest.mark.parametrize('padding, columns', [('center', (20, 60)), ('corner', (0, 40))])
def test_images_are_placed_as_the_network_was_trained(padding, columns):
    image = np.full((20, 20, 3), 200, np.uint8)
    scaled, _placement = fit_image(image, (40, 80), padding=padding)
    assert scaled.shape == (40, 80, 3) and (scaled[:, columns[0]:columns[1]] == 200).all()
    assert (np.delete(scaled, np.arange(*columns), axis=1) == GREY).all()


def test_boxes_are_in_image_pixels_and_clipped_to_the_image():
    runtime = FixedRuntime([(320, 320, 320, 160, 0.9, 1, 0), (0, 320, 100, 100, 0.8, 1, 0)])
    image = np.zeros((360, 1280, 3), np.uint8)[..., ::-1]  # a view, as of a bgr8 image
    detections = NetworkDetector(runtime).detect(image)  # input 640x192, scale 0.5, 6 rows padded
    assert runtime.inputs[0].shape == (192, 640, 3)
    np.testing.assert_allclose(detections.boxes[0], [320, 360, 960, 360])
    np.testing.assert_allclose(detections.boxes[1, 0], 0)


def selected(rows, confidence, classes):
    return ranked(FixedRuntime(rows).candidates(np.zeros((64, 64, 3), np.uint8), confidence), classes)


def test_predictions_are_filtered_by_class_and_confidence():
    rows = np.array([(50, 50, 20, 20, 0.9, 0.9, 0.1), (50, 50, 20, 20, 0.9, 0.1, 0.95), (50, 50, 20, 20, 0.4, 0.5, 0.1),
                     (50, 50, 20, 20, np.nan, 0.5, 0.1), (np.nan, 50, 20, 20, 0.9, 0.9, 0.1)], np.float32)
    assert selected(rows, 0.25, [0]).scores.tolist() == pytest.approx([0.81])
    assert selected(rows, 0.25, [0, 1]).classes.tolist() == [1, 0]
    assert len(selected(rows[:0], 0.25, [0]).boxes) == 0


@pytest.mark.parametrize('names, found', [(['person', 'people'], [0]), (['Pedestrian', 'people'], [0, 1]),
                                          (['cat', 'human'], [1])])
def test_networks_of_data_sets_with_other_names_of_people_detect_them_by_default(names, found):
    runtime = FixedRuntime([(50, 50, 20, 20, 0.9, 0.9, 0), (200, 50, 20, 20, 0.9, 0, 0.9)])
    runtime.names = names
    assert NetworkDetector(runtime).detect(np.zeros((480, 640, 3), np.uint8)).classes.tolist() == found


def test_without_a_node_the_input_is_the_largest_on_each_machine():
    """Bags and benchmarks are reproducible: only detector_node adapts the size."""
    runtime = FixedRuntime()
    NetworkDetector(runtime).detect(np.zeros((480, 640, 3), np.uint8))
    assert DetectionParams().image_size == 0 and runtime.inputs[0].shape == (480, 640, 3)


def naive_suppression(detections, limit, max_det):
    boxes, classes, kept = detections.boxes, detections.classes, []
    for i in range(len(boxes)):
        if all(classes[i] != classes[j] or iou(boxes[j], boxes[i:i + 1])[0] <= limit for j in kept):
            kept.append(i)
    return kept[:max_det]


@given(st.integers(0, 40), st.floats(0, 1), st.integers(1, 10), st.integers(0, 1000))
def test_suppression_agrees_with_a_naive_implementation(count, limit, max_det, seed):
    random = np.random.RandomState(seed)
    corner = random.uniform(0, 50, (count, 2))
    detections = Detections(np.hstack((corner, corner + random.uniform(0, 30, (count, 2)))),
                            np.sort(random.random_sample(count))[::-1], random.randint(0, 2, count))
    kept = non_maximum_suppression(detections, limit, max_det)
    np.testing.assert_array_equal(kept.boxes, detections.boxes[naive_suppression(detections, limit, max_det)])


HW = 96, 128
BOXES = np.array([(1.5, 2, 20, 30), (10, 3, 40, 20.25), (15, 2.5, 24, 33)])
SCORES = np.array([(0.9, 0.1, 0.2), (0.3, 0.8, 0.1), (0.2, 0.1, 0.7)])
NAMES = ['person', 'dog', 'chair']


def detections_in(outputs, layout, input_hw=HW, confidence=0.25):
    decode = HEADS[layout.head].decode
    found = decode(list(map(np.float32, outputs)), input_hw, layout.classes, confidence, layout.strides)
    return ranked(found, range(layout.classes))


@pytest.mark.parametrize('names', [NAMES, ()])
@pytest.mark.parametrize('head', HEADS)
def test_heads_are_recognised_and_decoded(head, names):
    outputs = outputs_of(head, BOXES, SCORES, HW)
    layout = layout_of(outputs, HW, {}, names=names)
    assert layout.head == head
    assert layout.classes == (80 if HEADS[head].suppressed and not names else 3)
    found = detections_in(outputs, layout)
    np.testing.assert_allclose(found.boxes, BOXES, atol=1e-3)
    np.testing.assert_allclose(found.scores, SCORES.max(axis=1), atol=1e-6)
    assert found.classes.tolist() == [0, 1, 2]
    assert len(detections_in(outputs, layout, confidence=0.85).boxes) == 1


def test_networks_that_suppress_are_known_by_their_metadata():
    rows = np.zeros((1, 252, 38))  # as many rows as the grid has cells
    assert layout_of([rows], HW, {'end2end': 'True'}).head == 'end-to-end'
    assert layout_of([rows], HW, {'args': "{'nms': True}"}).head == 'end-to-end'


@pytest.mark.parametrize('metadata', [{}, {'end2end': 'True'}])
def test_boxes_relative_to_the_input_are_rejected(metadata):
    """As those of RT-DETR."""
    rows = np.zeros((1, 300, 6))  # most are padding
    rows[0, 0] = 0.2, 0.2, 0.6, 0.8, 0.9, 0
    with pytest.raises(ValueError, match='from 0 to 1'):
        layout_of([rows], HW, metadata)


def test_rows_without_objectness_are_those_of_yolov6():
    rows = np.hstack((np.random.RandomState(0).uniform(0, 100, (252, 4)), np.ones((252, 1)), np.zeros((252, 3))))
    assert layout_of([rows[None]], HW, {}).head == 'yolov5'


@pytest.mark.parametrize('given, reason', [
    (dict(outputs=[np.zeros((1, 80, 12, 16))]), 'first output'),  # by stride, as of RTMDet
    (dict(outputs=[np.zeros((1, 252, 4)), np.zeros((1, 252, 80))]), '252 x 80, .* no known head'),  # boxes and scores
    (dict(outputs=[np.full((1, 252, 112), -1.0)]), 'no known head'),  # distributions of distances, as of NanoDet
    (dict(outputs=[np.zeros((1, 252, 80)), np.zeros((1, 252, 4))]), 'separate outputs'),  # of DAMO-YOLO
    (dict(outputs=[np.zeros((1, 80, 252)), np.zeros((1, 4, 252))]), 'separate outputs'),
    (dict(outputs=[]), 'first output'), (dict(outputs=[np.zeros((1, 77, 79))]), 'no known head'),
    (dict(outputs=[np.full((1, 300, 6), 0.3)]), 'no known head'),  # boxes and scores of two classes
    (dict(names=['a', 'b']), '2 names for its 3 classes')])
def test_outputs_that_do_not_fit_are_rejected(given, reason):
    outputs = outputs_of('yolov8', BOXES, SCORES, HW)
    with pytest.raises(ValueError, match=reason):
        layout_of(**dict(dict(outputs=outputs, input_hw=HW, metadata={}), **given))
