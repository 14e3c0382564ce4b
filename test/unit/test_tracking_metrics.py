import numpy as np
import pytest

from ros_3d_bb.tracking.types import VISIBLE
from ros_3d_bb_lab.evaluation.tracking.d435_model import CameraModel
from ros_3d_bb_lab.evaluation.tracking.metrics import score_run, scores_of
from ros_3d_bb_lab.evaluation.tracking.run_generator import HORIZONS_S, Image, Run, RunTruth
from support.tracks import STEP_S, track_at

pytestmark = pytest.mark.needs('trackeval')
IMAGES = 40
PLACES_M = np.array([(3.0, 0.0), (4.0, 1.5)])
VELOCITY_MPS = np.array([0.5, 0.0])


def run_of(images=IMAGES):
    """Two walking people; the robot stands at the origin and faces along x."""
    found = []
    for number in range(images):
        places_m = PLACES_M + number / 30.0 * VELOCITY_MPS
        future_m = places_m[:, None] + HORIZONS_S[:, None] * VELOCITY_MPS
        truth = RunTruth(np.array([10, 20]), places_m, np.tile(VELOCITY_MPS, (2, 1)),
                         future_m, np.array([VISIBLE, VISIBLE]), np.zeros(3))
        found.append(Image(number, [], None, truth, number, None))
    return Run('made', CameraModel(), tuple(found))


def track(track_id, place_m, velocity_mps=VELOCITY_MPS, covariances=(None, None)):
    covariance, prediction_covariance_m2 = covariances
    return track_at(np.append(place_m, 1.0), np.append(velocity_mps, 0), covariance=covariance,
                    number=track_id)._replace(prediction_covariance_m2=prediction_covariance_m2)


def scores(run, make):
    return scores_of([score_run(run, [make(number, image.truth) for number, image in enumerate(run.images)])])


def test_two_people_who_swap_ids_half_way_are_two_switches():
    late = IMAGES // 2
    result = scores(run_of(), lambda number, truth: [
        track(1 + (number >= late), truth.position_m[0]), track(2 - (number >= late), truth.position_m[1])])
    assert result['id_switches'] == 2
    assert result['mota'] == pytest.approx(100 * (1 - 2 / (2.0 * IMAGES)))
    assert result['idf1'] == pytest.approx(50)
    assert result['deta'] == pytest.approx(100) and result['assa'] == pytest.approx(100 / 3.0)  # 20 of 20 + 20 + 20
    assert result['hota'] == pytest.approx(100 * np.sqrt(1 / 3.0))


def test_errors_of_velocity_and_prediction_are_lengths_in_the_plane():
    result = scores(run_of(), lambda _number, truth: [
        track(person + 1, truth.position_m[person], VELOCITY_MPS + (0.3, 0.4)) for person in (0, 1)])
    assert result['velocity_rmse_mps'] == pytest.approx(0.5)
    assert result['fde_1s_m'] == pytest.approx(0.5) and result['fde_2s_m'] == pytest.approx(1.0)
    assert result['ade_1s_m'] == pytest.approx(0.375) and result['ade_2s_m'] == pytest.approx(0.625)


@pytest.mark.slow
@pytest.mark.parametrize('factor,coverage', [(1.0, 0.95), (0.25, 1 - np.exp(-5.991 * 0.25 / 2)), (100.0, 1.0)])
def test_coverage_is_the_share_of_errors_within_the_ellipse(factor, coverage):
    """`factor`: of the covariance that the track claims to that of its errors."""
    random, run = np.random.RandomState(0), run_of(images=1500)
    position_m2, velocity_m2 = np.array([[0.02, 0.01], [0.01, 0.03]]), np.array([[0.1, -0.02], [-0.02, 0.05]])
    covariance = np.eye(6)
    covariance[:2, :2], covariance[3:5, 3:5] = factor * position_m2, factor * velocity_m2
    times_s = STEP_S * np.arange(1, 9)
    prediction_m2 = np.tile(np.eye(3), (8, 1, 1))
    prediction_m2[:, :2, :2] = factor * (position_m2 + times_s[:, None, None] ** 2 * velocity_m2)

    def noisy(_number, truth):
        return [track(person + 1, truth.position_m[person] + random.multivariate_normal((0, 0), position_m2),
                      VELOCITY_MPS + random.multivariate_normal((0, 0), velocity_m2), (covariance, prediction_m2))
                for person in (0, 1)]
    result = scores(run, noisy)
    for key in ('coverage_95_position', 'coverage_95_velocity', 'coverage_95_1s', 'coverage_95_2s'):
        assert result[key] == pytest.approx(coverage, abs=0.025), key
