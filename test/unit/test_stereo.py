import numpy as np
import pytest

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb_lab.simulation.sensors import StereoCamera, StereoParams

LEVEL_MM = 610140.  # depth levels are this divided by an integer
STEPS_PER_PX = 32
NO_NOISE = StereoParams(noise_px=0, white_noise_px=0, jitter_px=0, hole_share=0)
CAMERA = Camera(400, 60, 614.686, 614.842, 200, 30)


def scene(depth_m, camera=CAMERA):
    """Inverse depth image of depth in metres, which is broadcast to the image."""
    return np.ascontiguousarray(np.broadcast_to(1 / np.asarray(depth_m, float), (camera.height, camera.width)),
                                dtype=np.float32)


@pytest.mark.parametrize('params', [StereoParams(), NO_NOISE])
def test_shadow_follows_the_formula(params):
    """Of a plate in front of a wall."""
    stereo = StereoCamera(CAMERA, params=params)
    for near_m, wall_m in ((0.5, 8), (1, 2), (1, 8), (2, 3), (4, 8)):
        depth_m = np.full(CAMERA.width, wall_m, float)
        depth_m[200:300] = near_m
        depth_mm = stereo.measure(scene(depth_m), 0)
        shadow_px = 0.0606 * CAMERA.fx * (1 / near_m - 1 / wall_m) + 4
        assert np.median((depth_mm[:, 100:200] == 0).sum(axis=1)) == pytest.approx(shadow_px, abs=2.5)
        assert np.mean(depth_mm[:, 300:] == 0) < 0.01


def test_noise_of_depth_grows_with_its_square():
    """As measured on walls by a D435i: 0.04 to 0.06 px of disparity."""
    for wall_m in (1.0, 2.0, 4.0):
        depth_mm = StereoCamera(CAMERA, seed=1).measure(scene(wall_m), 0)[:, 100:].astype(float)
        noise_px = LEVEL_MM * depth_mm[depth_mm > 0].std() / (1000 * wall_m) ** 2 / STEPS_PER_PX
        assert 0.025 < noise_px < 0.1
