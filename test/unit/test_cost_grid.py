import numpy as np
import pytest

from ros_3d_bb.camera.camera_model import transform_from
from ros_3d_bb.planning.cost_grid import ACROSS, CELL_M, COMFORT_M, HALF_SIZE_M, HIGHEST, RISKY, presence_costs
from support.tracks import STEP_S, track_at

WIDTH_M = 0.5
RADIUS_M = WIDTH_M / 2 + COMFORT_M
ROBOT_RADIUS_M = 0.35


def walking(position_m, velocity_mps, stds_m=(0.0, 0.0)):
    """A track whose standard deviation grows linearly from now to the end of the prediction of 2 s."""
    covariances_m2 = np.interp(STEP_S * np.arange(9), (0, 2), stds_m)[:, np.newaxis, np.newaxis] ** 2 * np.eye(3)
    covariance = np.zeros((6, 6))
    covariance[:3, :3] = covariances_m2[0]
    return track_at(position_m + (0.85,), velocity_mps + (0.0,), covariance=covariance)._replace(
        prediction_covariance_m2=covariances_m2[1:])


def cost_at(costs, x_m, y_m):
    row, column = (int((part + HALF_SIZE_M) // CELL_M) for part in (y_m, x_m))
    return costs[row, column]


def test_certain_predictions_cost_most_along_the_way_and_nothing_beside():
    costs = presence_costs([walking((1.0, -2.0), (0.0, 1.5))], np.eye(4), ROBOT_RADIUS_M)
    assert costs.dtype == np.int8 and costs.shape == (100, 100)
    for y_m in np.arange(-1.95, 1.0, 0.1):
        assert cost_at(costs, 1.0, y_m) == HIGHEST
        assert cost_at(costs, 1.0 + 2 * RADIUS_M, y_m) == cost_at(costs, 1.0 - 2 * RADIUS_M, y_m) == 0
    assert cost_at(costs, 1.0, 1.0 + 2 * RADIUS_M) == cost_at(costs, 1.0, -2.0 - 2 * RADIUS_M) == 0


def test_costs_follow_the_probability_of_presence():
    """Against the share of samples of the predicted position that cover the cell, where that varies slowly."""
    track = walking((2.0, 0.0), (1.0, 0.0), (0.8, 0.8))
    for covariances_m2 in (track.covariance, track.prediction_covariance_m2):
        covariances_m2[..., 1, 1] /= ACROSS ** 2
    costs = presence_costs([track], np.eye(4), ROBOT_RADIUS_M)
    offsets = np.random.RandomState(3).normal(scale=0.8, size=(200000, 2))
    for x_m, y_m in ((3.05, 0.05), (3.05, 0.95), (3.05, -1.55)):
        nearest_m = min(4.0, max(2.0, x_m))
        expected = (np.hypot(*(offsets + [nearest_m - x_m, -y_m]).T) < RADIUS_M).mean()
        assert cost_at(costs, x_m, y_m) / float(HIGHEST) * RISKY == pytest.approx(expected, abs=0.02)


def test_a_robot_in_the_way_pays_only_for_going_further_into_it():
    """A person comes towards the robot from ahead; the probability decreases to the sides."""
    tracks = [walking((2.0, 0.3), (-1.0, 0.0), (0.1, 0.5))]
    costs = presence_costs(tracks, np.eye(4), ROBOT_RADIUS_M)
    assert cost_at(costs, 0.0, 0.0) == cost_at(costs, 0.0, -1.0) == cost_at(costs, 0.0, 1.0) == 0
    assert cost_at(costs, 1.0, 0.3) == HIGHEST
    behind = walking((-0.6, 0.0), (0.8, 0.0), (0.1, 0.5))  # does not hide the costs of the other person
    assert cost_at(presence_costs(tracks + [behind], np.eye(4), ROBOT_RADIUS_M), 1.0, 0.3) == HIGHEST
    two_m_beside = presence_costs(tracks, transform_from((0, 2, 0), (0, 0, 0, 1)), ROBOT_RADIUS_M)
    assert cost_at(two_m_beside, 0.0, 2.0) > HIGHEST / 2 and cost_at(two_m_beside, 1.0, 2.3) == HIGHEST


def test_positions_and_covariances_are_transformed_to_the_robot_frame():
    """The robot stands at (3, 1) and looks along y of the tracks; the position is uncertain along x only."""
    track = walking((3.0, 3.0), (0.0, 0.0), (0.0, 0.0))
    uncertain = np.diag([1.0, 0.0, 0.0])
    track.covariance[:3, :3] = track.prediction_covariance_m2[:] = uncertain
    robot_from_tracks = np.linalg.inv(transform_from((3, 1, 0), (0, 0, np.sin(np.pi / 4), np.cos(np.pi / 4))))
    costs = presence_costs([track], robot_from_tracks, ROBOT_RADIUS_M)
    assert cost_at(costs, 2.0, 0.0) > 0
    assert cost_at(costs, 2.0, 1.5) > 0 and cost_at(costs, 2.0, -1.5) > 0
    assert cost_at(costs, 3.5, 0.0) == cost_at(costs, 0.5, 0.0) == 0
