import numpy as np
import pytest

from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.estimation.box3d import Box3D
from ros_3d_bb.sessions.snapshots import ColorImage, Snapshot
from ros_3d_bb.visualization.cv_window import character_of
from ros_3d_bb.visualization.image_overlay import BOX_COLOR, colorize_depth
from ros_3d_bb.visualization.viewer_layout import compose

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


WITH_SHIFT = 1 << 16  # GTK's state of modifiers


@pytest.mark.parametrize('code, character', [
    (ord('a'), 'a'), (ord('A') | WITH_SHIFT, 'A'), (0xf6, 'ö'), (0xd6 - 256, 'ö'), (0xff08, '\b'), (0xff8d, '\r'),
    (0xffb7, '7'), (27, '\x1b')])
def test_keys_with_a_character_give_it(code, character):
    assert character_of(code) == character
