import sys
from types import SimpleNamespace

import numpy as np
import pytest

from ros_3d_bb.core.detector_model import DetectorModel
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.estimation.error_model import read_error_model
from ros_3d_bb.tracking.measurement_model import DEFAULT_RANGE_M, learned_range
from ros_3d_bb.tracking.tracker import Tracker
from ros_3d_bb.tracking.types import VISIBLE
from ros_3d_bb_lab.evaluation.noise import __main__ as command
from ros_3d_bb_lab.evaluation.tracking.recorded_detections import RecordedRun
from ros_3d_bb_lab.evaluation.tracking.run_generator import Image, RunTruth
from support.people import VIEW, at, play

PERIOD_S = 0.1
LASTING_M, TIME_S, INDEPENDENT_M, PROBABILITY, RANGE_M = 0.06, 0.4, 0.03, 0.9, 12.0


@pytest.fixture(scope='module')
def run():
    """People walk around at 2 to 18 m; beyond 12 m, one of three is detected."""
    random, people = np.random.RandomState(0), 12
    slow_m, kept = np.zeros((people, 2)), np.exp(-PERIOD_S / TIME_S)
    starts_m, phases = np.linspace(3, 17, people), random.uniform(0, 6, people)
    taken = []
    for number in range(150):
        time_s = number * PERIOD_S
        slow_m = kept * slow_m + LASTING_M * np.sqrt(1 - kept ** 2) * random.normal(size=(people, 2))
        places_m = np.stack((starts_m + np.sin(0.3 * time_s + phases), 2 * np.sin(0.5 * time_s + phases)), axis=1)
        measured_m = places_m + slow_m + INDEPENDENT_M * random.normal(size=(people, 2))
        ranges_m = np.hypot(*places_m.T)
        found = random.uniform(size=people) < np.where(ranges_m < RANGE_M, PROBABILITY, 0.33)
        truth = RunTruth(np.arange(people), places_m, None, None, np.full(people, VISIBLE), None)
        detections = [at(*place_m, covariance_m2=None) for place_m in measured_m[found]]
        stamp_ns = int(round((1 + time_s) * NS))
        taken.append(Image(stamp_ns, detections, VIEW, truth, stamp_ns, VIEW))
    return RecordedRun('made', tuple(taken), None)


@pytest.mark.slow
def test_the_command_measures_errors_detections_and_range_of_a_recording(run, tmp_path, monkeypatch):
    monkeypatch.setattr(command, 'read_recordings', lambda folder: [run])
    monkeypatch.setattr(sys, 'argv', ['./run noise', '--recordings', 'made', '--out', str(tmp_path / 'out')])
    command.main()
    model = read_error_model(tmp_path / 'out' / 'error_model.yaml')
    detector = model.detector
    assert detector.lasting_sigma_m == pytest.approx(LASTING_M, rel=0.15)
    assert detector.correlation_time_s == pytest.approx(TIME_S, rel=0.35)
    assert detector.detection_probability == pytest.approx(PROBABILITY, abs=0.02) and detector.max_range_m == RANGE_M
    sigma_m = np.hypot(LASTING_M, INDEPENDENT_M)
    assert sigma_m < model.z_sigma.at(8.0) < 2 * sigma_m and abs(model.z_bias[-1]) < 0.05  # widened for few people
    assert model.provenance.positions == 12


def test_the_range_is_learned_from_people_farther_away():
    def matches(*distances_m, is_confirmed=True):
        return [(SimpleNamespace(is_confirmed=is_confirmed), SimpleNamespace(distance_m=distance_m))
                for distance_m in distances_m]
    range_m = DEFAULT_RANGE_M
    for _image in range(100):
        range_m = learned_range(range_m, matches(3.0, 7.0))
    assert range_m == DEFAULT_RANGE_M
    for _image in range(100):
        range_m = learned_range(range_m, matches(3.0, 12.0, 20.0) + matches(90.0, is_confirmed=False))
    assert range_m == pytest.approx(16.0, abs=0.1)


def leave(detector):
    """A person stands there for two seconds and is then not detected. Returns how long the track is published."""
    published = play(Tracker(detector=detector), 4, lambda time_s: [at(4.0, 0)] if time_s < 2 else [])
    return published[60:].index([]) / 30.0


def test_detectors_that_miss_people_often_end_tracks_later():
    assert leave(DetectorModel(detection_probability=0.5)) > 2 * leave(DetectorModel())
