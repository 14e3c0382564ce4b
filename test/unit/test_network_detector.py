"""Detector that runs a network: resizing, selection, non-maximum suppression, and people in a measurement session."""
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from ros_3d_bb.detection.batches import BGR, batch_of
from ros_3d_bb.detection.boxes import Detections, iou, non_maximum_suppression
from ros_3d_bb.detection.network_detector import (RESIZE_MODES, DetectionParams, NetworkDetector, Resize, class_number,
                                                  fit_image, ranked)
from ros_3d_bb.detection.yolov5.backends import open_runtime
from ros_3d_bb.detection.yolov5.predictions import Backend
from ros_3d_bb.sessions.session_reader import read_color, read_session


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


@given(st.integers(1, 900), st.integers(1, 900), st.sampled_from([None, 32, 64]), st.sampled_from(RESIZE_MODES))
@settings(max_examples=60)
def test_undo_inverts_the_placement(height, width, stride, mode):
    scaled, placement = fit_image(np.zeros((height, width, 3), np.uint8), (640, 640), stride, Resize(mode))
    assert max(scaled.shape[:2]) == 640
    assert scaled.shape[:2] == (640, 640) if stride is None else all(n % stride == 0 for n in scaled.shape[:2])
    corners = np.hstack((placement.shift, np.add(placement.shift, np.multiply((width, height), placement.scale))))
    np.testing.assert_allclose(placement.undo(corners[None], (height, width)), [[0, 0, width, height]], atol=1e-6)


@pytest.mark.parametrize('mode, columns, padding', [
    ('center', (20, 60), 7), ('corner', (0, 40), 7), ('stretch', (0, 80), None)])
def test_images_are_placed_as_the_network_was_trained(mode, columns, padding):
    image = np.full((20, 20, 3), 200, np.uint8)
    scaled, _placement = fit_image(image, (40, 80), resize=Resize(mode, 7))
    assert scaled.shape == (40, 80, 3) and (scaled[:, columns[0]:columns[1]] == 200).all()
    outside = np.delete(scaled, np.arange(*columns), axis=1)
    assert set(np.unique(outside)) == (set() if padding is None else {padding})


def test_an_image_of_the_right_size_is_neither_padded_nor_copied():
    image = np.zeros((480, 640, 3), np.uint8)
    scaled, placement = fit_image(image, (640, 640), 32)
    assert scaled is image and placement == ((1.0, 1.0), (0, 0))


def test_a_batch_has_the_channels_first_and_values_up_to_1():
    batch = batch_of(np.full((4, 6, 3), (255, 0, 51), np.uint8))
    assert batch.shape == (1, 3, 4, 6) and batch.dtype == np.float32
    np.testing.assert_allclose(batch[0, :, 0, 0], (1, 0, 0.2))


def test_channels_are_reordered_before_mean_and_scale_are_applied():
    image = np.full((2, 2, 3), (10, 20, 30), np.uint8)
    batch = batch_of(image[:, ::-1], BGR, (3, 2, 1), (9, 6, 3), np.float16)
    assert batch.dtype == np.float16
    np.testing.assert_allclose(batch[0, :, 0, 0], (3, 3, 3))


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


def test_iou_of_shifted_disjoint_and_empty_boxes():
    boxes = [(0, 0, 10, 10), (5, 0, 15, 10), (10, 0, 20, 10), (30, 30, 30, 30)]
    np.testing.assert_allclose(iou(boxes[0], boxes), (1, 1 / 3, 0, 0))
    assert iou(boxes[3], boxes[3:]) == 0


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


def test_the_number_of_boxes_is_limited_before_suppression():
    rows = np.tile(np.array([(50, 50, 20, 20, 0.9, 0.9, 0)], np.float32), (40000, 1))
    assert len(selected(rows, 0.25, [0]).boxes) == 30000


@pytest.mark.parametrize('entry,number', [('cat', 1), (1, 1), ('1', 1), ('person', 0)])
def test_classes_by_name_and_number(entry, number):
    assert class_number(entry, ['person', 'cat']) == number


@pytest.mark.parametrize('classes, reason', [(['ghost'], "'ghost'"), ([], 'classes'), ([7], '7')])
def test_unknown_or_no_classes_are_rejected(classes, reason):
    with pytest.raises(ValueError, match=reason):
        NetworkDetector(FixedRuntime(), DetectionParams(classes=classes))


def test_images_for_exports_of_a_fixed_size_are_padded_with_grey():
    runtime = FixedRuntime([(64, 32, 85, 64, 0.9, 1, 0)])
    runtime.input_hw = (64, 128)
    detections = NetworkDetector(runtime).detect(np.zeros((300, 400, 3), np.uint8))
    image, = runtime.inputs
    assert image.shape == (64, 128, 3)
    inside = np.nonzero(image[32, :, 0] != 114)[0]
    assert (inside[0], inside[-1]) == (21, 105)  # 85 of 128 columns, 43 of them padded
    np.testing.assert_allclose(detections.boxes, [[0, 0, 400, 300]], atol=3)


def test_the_input_is_rounded_up_to_the_stride():
    runtime = FixedRuntime()
    NetworkDetector(runtime, DetectionParams(image_size=500)).detect(np.zeros((480, 640, 3), np.uint8))
    assert runtime.inputs[0].shape == (384, 512, 3)
