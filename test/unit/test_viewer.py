import itertools

import numpy as np
import pytest

from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.estimation.box3d import Box3D
from ros_3d_bb.sessions.burst import Burst
from ros_3d_bb.sessions.snapshots import ColorImage, Snapshot, Snapshots
from ros_3d_bb.visualization.cv_window import character_of
from ros_3d_bb.visualization.image_overlay import colorize_depth
from ros_3d_bb.visualization.viewer_layout import compose

BOX = Box3D(np.array([0.5, -0.25, 2.0]), np.array([0.5, 1.75, 0.5]), (100, 40, 200, 160), 0.75, (True,) * 4)


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


WITH_SHIFT = 1 << 16  # GTK's state of modifiers


@pytest.mark.parametrize('code, character', [
    (ord('a'), 'a'), (ord('A') | WITH_SHIFT, 'A'), (0xf6, 'ö'), (0xd6 - 256, 'ö'), (0xff08, '\b'), (0xff8d, '\r'),
    (0xffb7, '7'), (27, '\x1b')])
def test_keys_with_a_character_give_it(code, character):
    assert character_of(code) == character


MS = NS // 1000
PERIOD = 33 * MS
PARTS = ('color', 'depth', 'camera', 'boxes2d', 'boxes3d')


def made(on_lost=lambda stamp_ns: None):
    return Snapshots(NS, 5 * MS, on_lost)


def send(snapshots, number, parts=PARTS):
    """Send parts of an image, each of which is its number."""
    for part in parts:
        getattr(snapshots, 'add_' + part)(number * PERIOD, number * PERIOD, number)


def parts_of(snapshot):
    return tuple(snapshot)[1:6]


@pytest.mark.parametrize('order', itertools.permutations(PARTS))
def test_parts_are_combined_in_any_order(order):
    snapshots = made()
    assert snapshots.newest is None
    send(snapshots, 7, order)
    assert snapshots.newest[:6] == (7 * PERIOD, 7, 7, 7, 7, 7)


def test_the_newest_images_are_returned_without_boxes_that_are_late():
    snapshots = made()
    assert snapshots.is_early
    for number in range(80):
        send(snapshots, number, PARTS if number == 10 else PARTS[:3])
        assert snapshots.is_early == (number * PERIOD < NS)
        is_recent = 10 <= number and (number - 10) * PERIOD <= NS  # boxes of an older image are not returned
        assert parts_of(snapshots.newest) == ((10,) * 5 if is_recent else (number,) * 3 + (None,) * 2)


def test_older_messages_are_dropped_when_time_jumps_back():
    lost = []
    snapshots = made(lost.append)
    for number in range(100, 140):
        send(snapshots, number)
    send(snapshots, 2, PARTS[:3])
    assert parts_of(snapshots.newest) == (2, 2, 2, None, None) and snapshots.is_early and not lost
    send(snapshots, 2, PARTS[3:])
    assert parts_of(snapshots.newest) == (2,) * 5


def test_a_burst_follows_a_countdown():
    burst = Burst(5.0, 3, 1.0)
    assert not burst.is_due(100.0) and burst.text(100.0) == ''
    burst.toggle(0.0)
    assert burst.text(0.1) == '5' and burst.text(4.9) == '1' and not burst.is_due(4.9)
    stored_s = []
    for tenth in range(200):
        if burst.is_due(tenth / 10):
            stored_s.append(tenth / 10)
            assert burst.text(tenth / 10) == '%d/3' % len(stored_s)
            burst.report(tenth / 10, True)
    assert stored_s == [5.0, 6.0, 7.0] and not burst.is_active and burst.text(20.0) == ''
