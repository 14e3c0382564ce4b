import numpy as np
import pytest

from ros_3d_bb.detection.depth.walls import NOISE, is_wall

HEIGHT_M = 1.0  # of a level camera
RIGHT, UP = np.meshgrid(np.linspace(-0.55, 0.55, 160), np.linspace(0.4, -0.4, 120))
RAYS = np.stack((RIGHT, np.ones(RIGHT.shape), UP)).reshape(3, -1).astype(np.float32)


def wall_depths(distance_m, angle):
    """Depths (n,) of a wall at a distance, whose normal has an angle to the optical axis, positive to the right."""
    with np.errstate(divide='ignore'):
        depth_m = distance_m / (np.cos(angle) * RAYS[1] + np.sin(angle) * RAYS[0])
    return np.where((depth_m > 0) & (depth_m < 12), depth_m, 12)


def marked(depth_m):
    """Cells of a noisy depth image that are taken for a wall."""
    inverse = 1 / depth_m + NOISE / 2.5 * np.random.RandomState(1).randn(len(depth_m))
    depth_m = (1 / np.maximum(inverse, 0.05)).astype(np.float32)
    return is_wall(RAYS, depth_m, HEIGHT_M + depth_m * RAYS[2])


@pytest.mark.parametrize('distance_m, angle', [(1.0, -1.5), (0.8, 1.45), (2.0, -0.9), (3.0, 0.3), (5.0, 0.0)])
def test_walls_are_found_at_any_angle(distance_m, angle):
    """Seen along the wall, one cell of the image shows half a metre of it."""
    depth_m = wall_depths(distance_m, angle)
    on_wall = (depth_m < 6) & (np.abs(HEIGHT_M + depth_m * RAYS[2] - 1.4) < 1)
    assert marked(depth_m)[on_wall].mean() > 0.95


def test_people_are_no_wall():
    """One before a wall, people side by side, and one who is seen through a door."""
    body = np.abs(RAYS[0] - 0.1) < 0.05
    assert marked(np.where(body, 4.6, wall_depths(5.0, 0.0)))[body].mean() < 0.05
    row = (np.abs(RAYS[0] * 4 % 0.8 - 0.4) < 0.25) & (RAYS[2] < 0.18)  # each 0.5 m wide
    assert marked(np.where(row, 4.0, 9.0))[row].mean() < 0.05
    door = np.abs(RAYS[0] * 4) < 0.45
    beyond = marked(np.where(body, 5.0, np.where(door, 9.0, wall_depths(4.0, 0.0))))
    assert not beyond[body].any() and beyond[~door].mean() > 0.6
