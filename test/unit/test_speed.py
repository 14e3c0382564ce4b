"""The speed benchmark: its times, its output, and its implementation of the thesis' algorithms."""

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
from ros_3d_bb_lab.evaluation.speed import crowd_of, people_of

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
def test_the_original_tracks_are_those_of_the_mended_tracker(seed, images):
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


def test_results_for_each_number_of_people(session):
    result = benchmark.speed(session, counts=(1, 5), images=3)
    assert result['objects'] == [1, 5] and result['machine'] == describe_machine()
    for name in ('ours', 'thesis'):
        assert set(result[name]) == {'estimation_ms', 'tracking_ms', 'both_ms'}
        assert all(len(times) == 2 and min(times) >= 0 for times in result[name].values())
        assert result[name]['estimation_ms'][1] > 0
    assert len(result['ratio']) == 2


def test_both_algorithms_detect_and_track_everybody(session):
    crowd, random = crowd_of(people_of(session), 6, session), np.random.RandomState(0)
    for algorithm in (benchmark.Ours(crowd), benchmark.Theirs(crowd)):
        for image in range(8):
            boxes = algorithm.estimate(crowd.depth, crowd.jittered(random))
            tracks = algorithm.track(image * benchmark.PERIOD_NS, boxes)
        assert len(boxes) >= 5 and len(tracks) >= 4  # two people may stand where one is
