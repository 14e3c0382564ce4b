"""Depth as grey in images."""
import numpy as np

from ros_3d_bb.camera.depth_image import DepthImage
from ros_3d_bb.visualization.image_overlay import depth_to_grey


def test_near_depth_is_bright_far_depth_is_dark_and_no_depth_is_black():
    grey = depth_to_grey(DepthImage(np.array([[0, 500, 3000, 9000]], np.uint16), 0.001), 6.0)[0]
    assert grey[0] == 0 and grey[1] > grey[2] > grey[3] > 0
    unknown = DepthImage(np.array([[np.nan, np.inf, -1]], np.float32), 1.0)
    assert depth_to_grey(unknown, 6.0)[0].tolist() == [0, 0, 0]
