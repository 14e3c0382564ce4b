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


@pytest.mark.parametrize('options, complaint', [
    (['--every', '0'], 'every is 0'), (['--data', '/nowhere'], 'nowhere'), (['--weights', '/no.onnx'], 'no.onnx'),
    (['--confidence', '2'], 'confidence is 2')])
def test_invalid_options_are_named(options, complaint, monkeypatch, capsys, folder):
    monkeypatch.setattr(sys, 'argv', ['detector', '--data', folder] + options)
    with pytest.raises(SystemExit) as raised:
        benchmark.main()
    assert complaint in str(raised.value) + capsys.readouterr().err
