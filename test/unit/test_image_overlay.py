"""Image overlays: where depth was measured, and depth as grey."""
import numpy as np

from ros_3d_bb.camera.depth_image import DepthImage
from ros_3d_bb.estimation.box3d_estimator import sample_depth
from ros_3d_bb.visualization.image_overlay import INVALID_COLOR, VALID_COLOR, draw_samples, depth_to_grey


def test_samples_show_where_depth_was_measured():
    values = np.full((60, 60), 2000, np.uint16)
    values[:, 30:] = 0
    rect = (5, 5, 55, 55)
    samples = sample_depth(DepthImage(values, 0.001), rect, 10)
    image = draw_samples(np.zeros((60, 60, 3), np.uint8), rect, samples)
    for (u, v), valid in zip(samples.pixels.reshape(-1, 2), samples.valid.ravel()):
        assert image[v, u].tolist() == list(VALID_COLOR if valid else INVALID_COLOR)


def test_near_depth_is_bright_far_depth_is_dark_and_no_depth_is_black():
    grey = depth_to_grey(DepthImage(np.array([[0, 500, 3000, 9000]], np.uint16), 0.001), 6.0)[0]
    assert grey[0] == 0 and grey[1] > grey[2] > grey[3] > 0
    unknown = DepthImage(np.array([[np.nan, np.inf, -1]], np.float32), 1.0)
    assert depth_to_grey(unknown, 6.0)[0].tolist() == [0, 0, 0]
