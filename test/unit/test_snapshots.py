import itertools

import pytest

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.sessions.burst import Burst
from ros_3d_bb.sessions.snapshots import Snapshots

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


def test_3d_boxes_have_the_stamp_of_the_depth_image():
    snapshots, depth_ns = made(), 7 * PERIOD + 4 * MS
    send(snapshots, 7, ('color', 'camera', 'boxes2d'))
    snapshots.add_depth(depth_ns, 0, 'depth')
    snapshots.add_boxes3d(depth_ns, 0, 'boxes3d')
    assert snapshots.newest[:6] == (7 * PERIOD, 7, 'depth', 7, 7, 'boxes3d')


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
