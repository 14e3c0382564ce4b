"""The speed benchmark: its implementation of the thesis' algorithms."""
import numpy as np
import pytest

from ros_3d_bb.sessions.session_reader import read_session
from ros_3d_bb_lab.evaluation import speed as benchmark
from ros_3d_bb_lab.evaluation.speed import crowd_of, people_of


@pytest.fixture(scope='module')
def session(session_folder):
    whole = read_session(session_folder)
    return whole._replace(frames=whole.frames[::8])


def test_both_algorithms_detect_and_track_everybody(session):
    crowd, random = crowd_of(people_of(session), 6, session), np.random.RandomState(0)
    for algorithm in (benchmark.Ours(crowd), benchmark.Theirs(crowd)):
        for image in range(8):
            boxes = algorithm.estimate(crowd.depth, crowd.jittered(random))
            tracks = algorithm.track(image * benchmark.PERIOD_NS, boxes)
        assert len(boxes) >= 5 and len(tracks) >= 4  # two people may stand where one is
