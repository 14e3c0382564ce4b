import numpy as np
import pytest

from ros_3d_bb.detection.network_detector import ranked
from ros_3d_bb.detection.onnx.heads import HEADS, layout_of
from support.onnx_files import outputs_of

HW = 96, 128
BOXES = np.array([(1.5, 2, 20, 30), (10, 3, 40, 20.25), (15, 2.5, 24, 33)])
SCORES = np.array([(0.9, 0.1, 0.2), (0.3, 0.8, 0.1), (0.2, 0.1, 0.7)])
STRIDES = {'nanodet-plus': (8, 16, 32, 64), 'picodet': (8, 16, 32, 64)}
NAMES = ['person', 'dog', 'chair']


def detections_in(outputs, layout, input_hw=HW, confidence=0.25):
    given = [np.float32(outputs[index]) for index in layout.order]
    found = HEADS[layout.head].decode(given, input_hw, layout.classes, confidence, layout.strides)
    return ranked(found, range(layout.classes))


@pytest.mark.parametrize('names', [NAMES, ()])
@pytest.mark.parametrize('head', HEADS)
def test_heads_are_recognised_and_decoded(head, names):
    outputs = outputs_of(head, BOXES, SCORES, HW, STRIDES.get(head, (8, 16, 32)))
    layout = layout_of(outputs, HW, {}, names=names)
    assert layout.head == head
    assert layout.classes == (80 if HEADS[head].suppressed and not names else 3)
    found = detections_in(outputs, layout)
    np.testing.assert_allclose(found.boxes, BOXES, atol=1e-3)
    np.testing.assert_allclose(found.scores, SCORES.max(axis=1), atol=1e-6)
    assert found.classes.tolist() == [0, 1, 2]
    assert len(detections_in(outputs, layout, confidence=0.85).boxes) == 1


def test_distributions_by_stride_in_other_orders_and_as_maps():
    """Scores and distances of a stride in turn, and (1, channels, height, width); scores before the sigmoid."""
    outputs = outputs_of('picodet', BOXES, SCORES, HW, STRIDES['picodet'])
    with np.errstate(divide='ignore'):
        logits = [np.log(np.clip(output, 1e-6, 1) / (1 - output)) for output in outputs[:4]]
    sizes = [(12, 16), (6, 8), (3, 4), (2, 2)]
    maps = []
    for (height, width), scores, distances in zip(sizes, logits, outputs[4:]):
        maps += [values[0].T.reshape(1, -1, height, width) for values in (distances, scores)]
    layout = layout_of(maps, HW, {})
    assert layout.order == (1, 3, 5, 7, 0, 2, 4, 6)
    found = detections_in(maps, layout)
    np.testing.assert_allclose(found.boxes, BOXES, atol=1e-3)
    np.testing.assert_allclose(found.scores, SCORES.max(axis=1), atol=1e-6)


def test_networks_that_suppress_are_known_by_their_metadata():
    rows = np.zeros((1, 252, 38))  # as many rows as the grid has cells
    assert layout_of([rows], HW, {'end2end': 'True'}).head == 'end-to-end'
    assert layout_of([rows], HW, {'args': "{'nms': True}"}).head == 'end-to-end'


def test_boxes_relative_to_the_input_are_those_of_rtdetr_or_rejected():
    """With metadata, the widths and heights of RT-DETR need not show in the values."""
    rows = np.zeros((1, 300, 6))  # most are padding
    rows[0, 0] = 0.2, 0.2, 0.6, 0.8, 0.9, 0
    assert layout_of([rows], HW, {'head': 'RTDETRDecoder', 'end2end': 'True'}).head == 'rtdetr'
    for metadata in ({}, {'end2end': 'True'}):
        with pytest.raises(ValueError, match='from 0 to 1'):
            layout_of([rows], HW, metadata)


def by_stride(channels):
    return [np.zeros((1, count) + size) for count in channels for size in ((12, 16), (6, 8), (3, 4))]


@pytest.mark.parametrize('given, reason', [
    (dict(outputs=by_stride((80, 4))), 'first output'),  # distances that are no distributions, as of RTMDet
    (dict(outputs=by_stride((80, 4)), head='nanodet'), 'first output'),
    (dict(outputs=[np.zeros((1, 252, 4)), np.zeros((1, 252, 80))]), '252 x 80, .* no known head'),  # boxes and scores
    (dict(outputs=[np.zeros((1, 252, 80)), np.zeros((1, 252, 4))]), 'separate outputs'),  # of DAMO-YOLO
    (dict(outputs=[np.zeros((1, 80, 252)), np.zeros((1, 4, 252))]), 'separate outputs'),
    (dict(outputs=[]), 'first output'), (dict(outputs=[np.zeros((1, 77, 79))]), 'no known head'),
    (dict(outputs=[np.full((1, 300, 6), 0.3)]), 'no known head'),  # boxes and scores of two classes
    (dict(names=['a', 'b']), '2 names for its 3 classes'), (dict(head='yolox'), 'cells of strides'),
    (dict(head='nanodet', outputs=[np.ones((1, 252, 35)) * 7], names=NAMES * 2), '35 columns')])
def test_outputs_that_do_not_fit_are_rejected(given, reason):
    outputs = outputs_of('yolov8', BOXES, SCORES, HW)
    with pytest.raises(ValueError, match=reason):
        layout_of(**dict(dict(outputs=outputs, input_hw=HW, metadata={}), **given))
