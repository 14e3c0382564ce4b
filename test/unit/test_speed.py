"""The speed benchmark: its times, its output, and its implementation of the thesis' algorithms."""
import json
import sys
from unittest import mock

import numpy as np
import pytest
from hypothesis import given, strategies as st

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.estimation.box3d import Box3D
from ros_3d_bb.sessions.session_reader import read_session
from ros_3d_bb.tracking.thesis_tracker import ThesisTracker
from ros_3d_bb.tracking.types import Detection
from ros_3d_bb_lab.evaluation import speed as benchmark
from ros_3d_bb_lab.evaluation.baselines.original_tracker import OriginalTracker
from ros_3d_bb_lab.evaluation.defaults import describe_machine
from ros_3d_bb_lab.evaluation.speed import JITTER_PX, crowd_of, people_of

SIZE = np.array([0.5, 0.5, 1.7])


@pytest.fixture(scope='module')
def session(session_folder):
    whole = read_session(session_folder)
    return whole._replace(frames=whole.frames[::8])


def walks(steps, random):
    """Positions (3, 3) of three people in each image, with large distances."""
    places_m = np.array([[2.0, -2, 1], [4, 0, 1], [3, 3, 1]])
    for _image in range(steps):
        places_m = places_m + random.uniform(-0.05, 0.05, (3, 3)) * (1, 1, 0)
        yield places_m


@given(st.integers(0, 1000), st.integers(2, 12))
def test_the_thesis_tracks_are_those_of_its_mended_tracker_while_everybody_is_seen(seed, images):
    ours, theirs = ThesisTracker(), OriginalTracker()
    for image, places_m in enumerate(walks(images, np.random.RandomState(seed))):
        stamp_ns, detections = image * benchmark.PERIOD_NS, [Detection(place_m, SIZE) for place_m in places_m]
        expected, tracks = ours.update(stamp_ns, detections), theirs.step(stamp_ns, detections)
        assert [track.id for track in tracks] == [track.id for track in expected]
        for track, other in zip(tracks, expected):
            np.testing.assert_allclose(track.position_m, other.position_m)
            np.testing.assert_allclose(track.velocity_mps, other.velocity_mps, atol=1e-9)


def test_the_thesis_predicts_two_seconds_along_the_velocity(session):
    algorithm = benchmark.Theirs(crowd_of(people_of(session), 1, session))
    for image, x_m in enumerate((0.0, 0.1, 0.2)):  # to the right of a camera that faces along x
        ahead_m = algorithm.track(image * NS // 10, [Box3D(np.array([x_m, 0, 3.0]), SIZE, (0, 0, 9, 9), 1.0, ())])
    np.testing.assert_allclose(ahead_m[1], (3, -0.2 - 2 * (0.2 + 0.8 * 0.2), 1), atol=1e-6)


def test_people_of_a_crowd_have_the_depth_they_had(session):
    people = people_of(session)
    crowd = crowd_of(people, len(people) + 2, session)
    assert len(crowd.rects_px) == len(people) + 2
    for (x1, y1, x2, y2), after, (depth, top) in zip(crowd.rects_px, crowd.rects_px[1:], people):
        assert (x2 - x1, y2 - y1) == depth.shape[::-1] and x1 < after[0] < x2 and y1 == top
        np.testing.assert_array_equal(crowd.depth.values[y1:y2, x1:after[0]], depth[:, :after[0] - x1])
    for rect, jittered in zip(crowd.rects_px, crowd.jittered(np.random.RandomState(0))):
        assert np.abs(np.subtract(rect, jittered)).max() <= JITTER_PX
        assert jittered[0] >= 0 and jittered[3] <= crowd.camera.height


def test_results_and_table_for_each_number_of_people(session):
    result = dict(benchmark.speed(session, counts=(1, 5), images=3), detector=[])
    assert result['objects'] == [1, 5] and result['machine'] == describe_machine()
    for name in ('ours', 'thesis'):
        assert set(result[name]) == {stage + suffix for stage in ('estimation', 'tracking', 'both')
                                     for suffix in ('_ms', '_mean_ms', '_sd_ms')}
        assert all(len(times) == 2 and min(times) >= 0 for times in result[name].values())
        assert result[name]['estimation_ms'][1] > 0
    assert len(result['ratio']) == 2 and result['growth'][1] == 1
    text = '\n'.join(benchmark.table(result))
    assert '%.2f' % result['thesis']['both_ms'][1] in text and '%.2f' % result['ratio'][0] in text


def test_both_algorithms_detect_and_track_everybody(session):
    crowd, random = crowd_of(people_of(session), 6, session), np.random.RandomState(0)
    for algorithm in (benchmark.Ours(crowd), benchmark.Theirs(crowd)):
        for image in range(8):
            boxes = algorithm.estimate(crowd.depth, crowd.jittered(random))
            tracks = algorithm.track(image * benchmark.PERIOD_NS, boxes)
        assert len(boxes) >= 5 and len(tracks) >= 4  # two people may stand where one is


def test_algorithms_take_turns_and_medians_count(session, monkeypatch):
    turns = []

    def timed(algorithm, _depth, rects_px, stamp_ns):
        turns.append((type(algorithm).__name__, len(rects_px)))
        cost = len(rects_px) * (1.0 if isinstance(algorithm, benchmark.Ours) else 4.0) * (1 + stamp_ns % 2)
        return cost, cost, 2 * cost
    monkeypatch.setattr(benchmark, '_time_ms', timed)
    result = benchmark.speed(session, counts=(2, 3), images=3)
    assert turns[:4] == [('Ours', 2), ('Theirs', 2), ('Ours', 3), ('Theirs', 3)]
    assert len(turns) == 4 * (3 + benchmark.WARM_UPS)
    assert result['ratio'] == [0.25, 0.25] and result['growth'] == [1, 1.5]


@pytest.mark.slow
def test_without_data_the_command_measures_simulated_people(tmp_path, monkeypatch, capsys):
    path = str(tmp_path / 'speed.json')
    monkeypatch.delenv('ROS_3D_BB_DATA', raising=False)
    monkeypatch.setattr(benchmark, 'OBJECTS', (1,))
    monkeypatch.setattr(sys, 'argv', ['speed', '--images', '1', '--json', path])
    benchmark.main()
    with open(path) as stream:
        result = json.load(stream)
    assert result['data'] == 'simulated' and result['objects'] == [1]
    assert describe_machine() in capsys.readouterr().out


@pytest.mark.parametrize('options,complaint', [(['--images', '0'], 'images is 0'), (['--data', '/nowhere'], 'nowhere')])
def test_invalid_options_are_named(options, complaint, monkeypatch, capsys):
    monkeypatch.setattr(sys, 'argv', ['speed'] + options)
    with pytest.raises(SystemExit) as raised:
        benchmark.main()
    assert complaint in str(raised.value) + capsys.readouterr().err


@pytest.fixture
def checkpoint(tmp_path):
    from support.checkpoints import write_checkpoint  # imports torch
    from support.layouts import layout
    path = str(tmp_path / 'random.pt')
    write_checkpoint(path, layout('6.0', 'n', 3))
    return path


@pytest.mark.needs('torch')
def test_detectors_take_turns_and_the_median_counts(checkpoint, monkeypatch):
    turns = []

    def timed(detector, image):
        turns.append((detector.size, int(image[0, 0, 0])))
        return detector.size + image[0, 0, 0] ** 2.0, 2.0 * detector.size
    monkeypatch.setattr(benchmark, '_detector_time_ms', timed)
    monkeypatch.setattr(benchmark, '_detector', lambda weights, runtime, size: mock.Mock(size=size))
    images = [np.full((2, 2, 3), value, np.uint8) for value in (1, 2, 9)]
    rows = benchmark.detector_speed(images, checkpoint, ('torch',), (100, 200))
    assert turns == [(size, value) for value in (1, 2, 9) for size in (100, 200)]
    assert rows == [{'runtime': 'torch', 'threads': 1, 'size': size, 'cpu_ms': size + 4, 'wall_ms': 2 * size}
                    for size in (100, 200)]


@pytest.mark.needs('torch')
def test_no_images_and_unknown_runtimes_are_rejected(checkpoint):
    with pytest.raises(ValueError, match='no images'):
        benchmark.detector_speed([], checkpoint)
    with pytest.raises(ValueError, match="'tensorflow'"):
        benchmark.detector_speed([np.zeros((64, 64, 3), np.uint8)], checkpoint, runtimes=('tensorflow',))
