"""The detector benchmark: counts, overlaps and times of several detectors on the same images."""
import json
import sys

import numpy as np
import pytest

from ros_3d_bb.sessions.session_reader import read_session
from ros_3d_bb_lab.evaluation import detector_benchmark as benchmark
from support.onnx_files import outputs_of, write_constant_network


def shifted(boxes, share):
    """Boxes that are moved to the right by a share of their width."""
    boxes = np.reshape(boxes, (-1, 4)).astype(float)
    return boxes + (boxes[:, 2:3] - boxes[:, :1]) * share * (1, 0, 1, 0)


@pytest.fixture
def session(folder):
    """A small session, each image with two boxes."""
    return read_session(folder)


def test_boxes_found_missed_and_false_are_counted(session):
    first, second = session.frames[0].boxes_px
    order = []

    def detector(name, boxes):
        def detect(color, depth):
            assert color.shape[:2] == depth.shape
            order.append(name)
            return np.reshape(boxes, (-1, 4))
        return detect
    far = shifted([second], 0.6)  # an IoU of 0.25
    result = benchmark.compare(session, {'both': detector('both', [first, second]), 'none': detector('none', []),
                                         'one': detector('one', np.vstack((shifted([first], 0.2), far)))})
    count = len(session.frames)
    assert (result['frames'], result['boxes']) == (count, 2 * count)
    assert order == ['both', 'none', 'one'] * (count + min(count, benchmark.WARM_UPS))
    rows = result['detectors']
    assert [(row['found'], row['false_boxes']) for row in rows.values()] == [(2 * count, 0), (0, 0), (count, count)]
    assert [row['median_iou'] for row in rows.values()] == pytest.approx([1, 0, (0.8 / 1.2 + 0.4 / 1.6) / 2])
    assert all(row['cpu_ms'] >= 0 for row in rows.values())


def test_a_session_without_boxes_is_rejected(session):
    with pytest.raises(ValueError, match='no images with 2D boxes'):
        benchmark.compare(session._replace(frames=[frame._replace(detections=()) for frame in session.frames]), {})


def test_models_with_the_same_file_name_are_named_by_their_path():
    assert benchmark.named(['a/x.onnx', 'b/y.pt']) == {'x.onnx': 'a/x.onnx', 'y.pt': 'b/y.pt'}
    assert set(benchmark.named(['a/x.onnx', 'b/x.onnx'])) == {'a/x.onnx', 'b/x.onnx'}


@pytest.mark.needs('onnxruntime')
def test_any_number_of_models_is_compared_on_simulated_people(tmp_path, monkeypatch, capsys):
    paths, results = [str(tmp_path / name) for name in ('nothing.onnx', 'corner.onnx')], str(tmp_path / 'results.json')
    for path, score in zip(paths, (0.1, 0.9)):
        write_constant_network(path, outputs_of('yolox', [(0, 0, 30, 30)], [[score] + [0] * 79], (96, 128)))
    monkeypatch.delenv('ROS_3D_BB_DATA', raising=False)
    monkeypatch.setattr(benchmark, 'SIMULATED', ((3.0,), (0.0,), 1))
    monkeypatch.setattr(sys, 'argv', ['detector', '--weights'] + paths + ['--json', results])
    benchmark.main()
    with open(results) as stream:
        result = json.load(stream)
    assert result['frames'] == 1 and list(result['detectors']) == ['nothing.onnx', 'corner.onnx', 'depth']
    assert [row['false_boxes'] for row in result['detectors'].values()][:2] == [0, 1]
    assert result['detectors']['depth']['found'] == 1
    assert 'corner.onnx' in capsys.readouterr().out


@pytest.mark.needs('onnxruntime')
def test_the_best_confidence_separates_people_from_false_boxes(session, tmp_path):
    """The network finds the first person of each image with 0.605, and one false box with 0.395."""
    frame = session.frames[0]
    session = session._replace(frames=[frame._replace(detections=frame.detections[:1])])
    width, height = session.camera.width, session.camera.height
    boxes = np.vstack((frame.boxes_px[:1], [(0, 0, 8, 8)])).astype(float)
    scores = np.pad([[0.605], [0.395]], ((0, 0), (0, 79)), mode='constant')
    path = write_constant_network(tmp_path / 'a.onnx', outputs_of('end-to-end', boxes, scores, (height, width)),
                                  (1, 3, height, width))
    network, = benchmark.open_networks([path], 0.25).values()
    assert benchmark.best_confidence(session, network) == (0.5, 1)


@pytest.mark.parametrize('options, complaint', [
    (['--every', '0'], 'every is 0'), (['--data', '/nowhere'], 'nowhere'), (['--weights', '/no.onnx'], 'no.onnx'),
    (['--confidence', '2'], 'confidence is 2')])
def test_invalid_options_are_named(options, complaint, monkeypatch, capsys, folder):
    monkeypatch.setattr(sys, 'argv', ['detector', '--data', folder] + options)
    with pytest.raises(SystemExit) as raised:
        benchmark.main()
    assert complaint in str(raised.value) + capsys.readouterr().err
