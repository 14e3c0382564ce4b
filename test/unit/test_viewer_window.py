import numpy as np
import pytest

from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.estimation.box3d import Box3D
from ros_3d_bb.sessions.snapshots import ColorImage, Snapshot
from ros_3d_bb.visualization.cv_window import character_of
from ros_3d_bb.visualization.image_overlay import BOX_COLOR, colorize_depth, depth_to_grey
from ros_3d_bb.visualization.viewer_layout import RATE_WINDOW_NS, FrameRate, compose

BOX = Box3D(np.array([0.5, -0.25, 2.0]), np.array([0.5, 1.75, 0.5]), (100, 40, 200, 160), 0.75,
            (True,) * 4)


def view(**changes):
    snapshot = Snapshot(0, ColorImage(np.full((240, 320, 3), (10, 20, 30), np.uint8), 'optical'),
                        DepthImage(np.full((240, 320), 1500, np.uint16), 0.001), None, ((100, 40, 200, 160),), (BOX,))
    return snapshot._replace(**changes)


@pytest.mark.parametrize('width_px', [160, 320, 640])
def test_three_panels_are_side_by_side(width_px):
    picture = compose(view(), width_px, 6.0)
    height_px = width_px * 3 // 4
    assert picture.dtype == np.uint8 and picture.shape[1] == 3 * width_px and picture.shape[0] > height_px
    row, column = int(height_px * 0.95), int(width_px * 0.5)
    assert picture[row, column].tolist() == picture[row, column + 2 * width_px].tolist() == [10, 20, 30]
    depth = colorize_depth(np.full((1, 1), 255 - int(254 * 1.5 / 6.0), np.uint8))[0, 0].astype(int)
    assert np.abs(picture[row, column + width_px] - depth).max() <= 8


def test_boxes_are_drawn_in_the_third_panel_only():
    picture = compose(view(), 320, 6.0)
    assert picture[100, 640 + 100].tolist() == list(BOX_COLOR)
    for panel in range(2):
        assert not (picture[:240, 320 * panel:320 * (panel + 1)] == BOX_COLOR).all(axis=2).any()


def test_near_depth_is_bright_far_depth_is_dark_and_no_depth_is_black():
    grey = depth_to_grey(DepthImage(np.array([[0, 500, 3000, 9000]], np.uint16), 0.001), 6.0)[0]
    assert grey[0] == 0 and grey[1] > grey[2] > grey[3] > 0
    unknown = DepthImage(np.array([[np.nan, np.inf, -1]], np.float32), 1.0)
    assert depth_to_grey(unknown, 6.0)[0].tolist() == [0, 0, 0]


def test_the_frame_rate_is_that_of_recent_images_and_its_memory_is_limited():
    rate = FrameRate()
    assert rate.at(0) == 0
    for number in range(3000):
        rate.add(number * NS // 30)
    assert len(rate._arrivals_ns) <= 31 * RATE_WINDOW_NS // NS
    assert rate.at(2999 * NS // 30) == pytest.approx(30.0)
    assert rate.at(110 * NS) == 0


SHIFT, CAPS_LOCK, LEFT, DELETE, NUM_LOCK = 0xffe1, 0xffe5, 0xff51, 0xffff, 0xff7f
WITH_SHIFT = 1 << 16  # GTK's state of modifiers


@pytest.mark.parametrize('code, character', [
    (ord('a'), 'a'), (ord('A') | WITH_SHIFT, 'A'), (0xf6, 'ö'), (0xd6 - 256, 'ö'), (0xff08, '\b'), (0xff8d, '\r'),
    (0xffb7, '7'), (27, '\x1b')])
def test_keys_with_a_character_give_it(code, character):
    assert character_of(code) == character


@pytest.mark.parametrize('code', [-1, SHIFT, SHIFT | WITH_SHIFT, CAPS_LOCK, LEFT, DELETE, NUM_LOCK])
def test_other_keys_give_none(code):
    assert character_of(code) == ''
