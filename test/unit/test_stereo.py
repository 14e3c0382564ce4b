"""Simulated D435i: properties of the depth images, and statistics compared with those of real frames.

The constants below are the statistics of the first two frames at each of the 22 places of the thesis.
"""
from typing import NamedTuple

import numpy as np
import pytest

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb_lab.simulation.sensors import StereoCamera, StereoParams

D435I = Camera(640, 480, 614.686, 614.842, 319.199, 242.08)
LEVEL_MM = 610140.  # depth levels are this divided by an integer
STEPS_PER_PX = 32
NO_NOISE = StereoParams(noise_px=0, white_noise_px=0, jitter_px=0, hole_share=0)

WINDOW_PX = 24
LAGS_PX = (1, 2, 4, 8)
# Limits of the ranges in metres, and the median over windows of sigma of the disparity in each range, in px. The near
# ranges contain the person.
RANGES_M = (0.87, 1.53, 2.35, 3.39, 4.69, 6.78, 10.17)
REAL_SPATIAL_PX = (0.0365, 0.0393, 0.0450, 0.0575, 0.0561, 0.0525)
REAL_SPATIAL_CORRELATION = (0.896, 0.803, 0.602, 0.197)


class Standing(NamedTuple):
    """Medians over frames of a person in front of the camera, x = 0: depths at both ends of the shadow to the left of
    the torso."""

    person_m: float
    wall_m: float


REAL_STANDING = (Standing(0.942, 8.416), Standing(1.246, 6.973), Standing(1.762, 7.586), Standing(2.251, 8.973),
                 Standing(2.542, 9.533))


def steps_of(depth_mm):
    """Disparity in steps, float; 0 without depth."""
    return np.where(depth_mm > 0, LEVEL_MM / np.maximum(depth_mm, 1), 0).astype(np.float32)


def spatial_statistics(images):
    """Residual of disparity after a plane fit in square windows: sigma by range, and correlation by lag."""
    v, u = np.mgrid[:WINDOW_PX, :WINDOW_PX]
    plane = np.stack((u.ravel(), v.ravel(), np.ones(u.size)), -1)
    to_residual = np.eye(u.size) - plane.dot(np.linalg.pinv(plane))
    medians, sigmas, correlations = [], [], []
    for depth_mm in images:
        rows, columns = (size // WINDOW_PX for size in depth_mm.shape)
        steps = steps_of(depth_mm)[:rows * WINDOW_PX, :columns * WINDOW_PX]
        windows = steps.reshape(rows, WINDOW_PX, columns, WINDOW_PX).swapaxes(1, 2).reshape(-1, u.size)
        windows = windows[(windows.min(axis=1) > 0) & (np.ptp(windows, axis=1) <= 20)]  # no holes, no silhouettes
        residual = windows.dot(to_residual).reshape(-1, WINDOW_PX, WINDOW_PX)
        medians.append(np.median(windows, axis=1))
        sigmas.append(residual.std(axis=(1, 2)) / STEPS_PER_PX)
        correlations.append([(residual[..., lag:] * residual[..., :-lag]).mean(axis=(1, 2)) for lag in LAGS_PX]
                            / np.maximum((residual ** 2).mean(axis=(1, 2)), 1e-9))
    range_m, sigma = LEVEL_MM / 1000 / np.concatenate(medians), np.concatenate(sigmas)
    return ([np.median(sigma[(range_m >= near) & (range_m < far)]) for near, far in zip(RANGES_M, RANGES_M[1:])],
            np.median(np.hstack(correlations), axis=1))


def shadows(depth_mm, rect_px):
    """Shadows to the left of the torso (n, 3): width in px, depth of the person and of the wall at its ends in metres.
    """
    x1, y1, x2, y2 = rect_px
    middle, rows = (x1 + x2) // 2, []
    for row in depth_mm[int(0.8 * y1 + 0.2 * y2):int(0.45 * y1 + 0.55 * y2):4].astype(float):
        last = np.append(0, np.flatnonzero(row[:middle] == 0))[-1]
        first = np.append(0, np.flatnonzero(row[:last] > 0))[-1]
        person, wall = row[last + 1:last + 7], row[max(first - 7, 0):first + 1]
        if last + 7 < middle and np.ptp(row[last + 1:middle]) < 500 and wall.size and wall.min() > person.max():
            rows.append((last - first, np.median(person) / 1000, np.median(wall) / 1000))
    return np.array(rows).reshape(-1, 3)


def scene(depth_m, camera=D435I):
    """Inverse depth image of depth in metres, which is broadcast to the image."""
    return np.ascontiguousarray(np.broadcast_to(1 / np.asarray(depth_m, float), (camera.height, camera.width)),
                                dtype=np.float32)


def plate(near_m, wall_m, camera=D435I, columns=slice(300, 450)):
    """Plate in front of a wall, over the full height of the image."""
    depth_m = np.full(camera.width, wall_m, float)
    depth_m[columns] = near_m
    return scene(depth_m, camera)


def room(wall_m):
    """Floor 0.93 m below the camera, ceiling, wall, and a board at 3.5 m, similar to the real frames."""
    v, _ = np.mgrid[:480, :640]
    y = (v - D435I.cy) / D435I.fy
    inverse_depth = np.maximum(1. / wall_m, np.maximum(y / 0.93, -y / 2.2))
    inverse_depth[158:381, 316:402] = 1 / 3.5
    return inverse_depth.astype(np.float32)


def add_person(inverse_depth, person_m):
    """Draw a person of flat plates into the room."""
    v, u = np.mgrid[:480, :640]
    x, y = np.abs(u - D435I.cx) / D435I.fx * person_m, (v - D435I.cy) / D435I.fy * person_m
    for half_width_m, top_m, bottom_m in ((0.10, -0.82, -0.5), (0.27, -0.55, 0.1), (0.18, 0.1, 0.93)):
        inverse_depth[(x <= half_width_m) & (y >= top_m) & (y < bottom_m)] = 1 / person_m


@pytest.fixture(scope='module')
def d435i():
    return StereoCamera(D435I, seed=1)


@pytest.fixture(scope='module')
def simulated(d435i):
    """Two images of the person at each place of the real frames, and two images of the empty room."""
    images = [d435i.measure(room(8), number) for number in range(2)]
    for place, standing in enumerate(REAL_STANDING):
        inverse_depth = room(standing.wall_m)
        add_person(inverse_depth, standing.person_m)
        images += [d435i.measure(inverse_depth, 2 + 2 * place + k) for k in range(2)]
    return images


def shadow_formula_px(near_m, wall_m, fx=D435I.fx):
    return 0.0606 * fx * (1 / near_m - 1 / wall_m) + 4


def test_spatial_noise_agrees_with_real_frames(simulated):
    """At a lag of 8 px the residuals of real windows contain unevenness of the room, too."""
    sigmas_px, correlation = spatial_statistics(simulated)
    np.testing.assert_allclose(sigmas_px, REAL_SPATIAL_PX, rtol=.35)
    np.testing.assert_array_less(np.abs(correlation - REAL_SPATIAL_CORRELATION), (0.15, 0.15, 0.15, 0.3))


@pytest.mark.parametrize('params', [StereoParams(), NO_NOISE])
def test_shadow_follows_the_formula(params):
    camera = Camera(400, 60, 614.686, 614.842, 200, 30)
    stereo = StereoCamera(camera, params=params)
    for near_m, wall_m in ((0.5, 2), (0.5, 8), (1, 2), (1, 4), (1, 8), (2, 3), (2, 8), (4, 8)):
        depth_mm = stereo.measure(plate(near_m, wall_m, camera, slice(200, 300)), 0)
        measured = shadows(depth_mm, (200, 0, 300, 60))
        assert len(measured) > 3
        assert np.median(measured[:, 0]) == pytest.approx(shadow_formula_px(near_m, wall_m), abs=1.5)
        assert np.mean(depth_mm[:, 300:] == 0) < 0.01


def test_without_noise_the_only_error_is_quantisation():
    camera = Camera(8, 2000, 600, 600, 4, 1000)
    depth_m = np.linspace(0.1, 25, 2000)[:, None]
    depth_mm = StereoCamera(camera, params=NO_NOISE).measure(scene(depth_m, camera), 0).astype(float)
    assert (depth_mm == depth_mm[:, :1]).all()
    depth_mm, steps = depth_mm[:, 0], LEVEL_MM / 1000 / depth_m[:, 0]
    in_range = (steps >= 30) & (steps <= 126 * STEPS_PER_PX)
    np.testing.assert_array_equal(depth_mm[in_range], np.rint(LEVEL_MM / np.rint(steps[in_range].astype(np.float32))))
    assert (np.diff(depth_mm[in_range]) >= 0).all()
    assert not depth_mm[(steps < 29.5) | (steps > 126 * STEPS_PER_PX + 0.5)].any()
