import numpy as np
import pytest

from ros_3d_bb.detection.network_detector import ranked
from ros_3d_bb.detection.onnx.heads import HEADS, layout_of
from support.onnx_files import outputs_of

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
