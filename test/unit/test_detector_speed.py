"""Speed of the detector: one row for each runtime and size."""
from unittest import mock

import numpy as np
import pytest

from ros_3d_bb_lab.evaluation import detector_speed
from support.checkpoints import write_checkpoint
from support.layouts import layout


@pytest.fixture
def checkpoint(tmp_path):
    path = str(tmp_path / 'random.pt')
    write_checkpoint(path, layout('6.0', 'n', 3))
    return path


@pytest.mark.slow
@pytest.mark.needs('onnxruntime')
def test_a_row_for_each_case(checkpoint):
    image = np.random.RandomState(0).randint(0, 256, (240, 320, 3)).astype(np.uint8)
    rows = detector_speed.detector_speed([image] * 3, checkpoint, sizes=(64, 320))
    assert [(row['runtime'], row['size']) for row in rows] == [
        (runtime, size) for runtime in ('torch', 'onnxruntime') for size in (64, 320)]
    assert all(set(row) == {'runtime', 'size', 'threads', 'cpu_ms', 'wall_ms'} for row in rows)
    assert all(row['cpu_ms'] > 0 and row['wall_ms'] > 0 for row in rows)


def test_cases_take_turns_and_the_median_counts(checkpoint, monkeypatch):
    turns = []

    def timed(detector, image):
        turns.append((detector.size, int(image[0, 0, 0])))
        return detector.size + image[0, 0, 0] ** 2.0, 2.0 * detector.size
    monkeypatch.setattr(detector_speed, '_time_ms', timed)
    monkeypatch.setattr(detector_speed, '_detector', lambda weights, runtime, size: mock.Mock(size=size))
    images = [np.full((2, 2, 3), value, np.uint8) for value in (1, 2, 9)]
    rows = detector_speed.detector_speed(images, checkpoint, ('torch',), (100, 200))
    assert turns == [(size, value) for value in (1, 2, 9) for size in (100, 200)]
    assert [(row['cpu_ms'], row['wall_ms']) for row in rows] == [(104, 200), (204, 400)]


def test_no_images_and_unknown_runtimes_are_rejected(checkpoint):
    with pytest.raises(ValueError, match='no images'):
        detector_speed.detector_speed([], checkpoint)
    with pytest.raises(ValueError, match="'tensorflow'"):
        detector_speed.detector_speed([np.zeros((64, 64, 3), np.uint8)], checkpoint, runtimes=('tensorflow',))
