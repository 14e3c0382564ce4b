"""Snapshots combine the messages of one image for any order of arrival and any delay of the detector."""
import itertools

import pytest
from hypothesis import given, strategies as st

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.sessions.frame_synchronizer import Snapshots

MS = NS // 1000
PERIOD = 33 * MS
PARTS = ('color', 'depth', 'camera', 'boxes2d', 'boxes3d')


def made():
    """Snapshots, which keep the stamps of lost colour images in `lost`."""
    lost = []
    snapshots = Snapshots(NS, 5 * MS, lost.append)
    snapshots.lost = lost
    return snapshots


def send(snapshots, number, parts=PARTS, period_ns=PERIOD):
    """Send parts of an image, each of them its number; returns the stamps that were lost."""
    before = len(snapshots.lost)
    for part in parts:
        getattr(snapshots, 'add_' + part)(number * period_ns, number * period_ns, number)
    return snapshots.lost[before:]


def parts_of(snapshot):
    return tuple(snapshot)[1:]


@pytest.mark.parametrize('order', itertools.permutations(PARTS))
def test_parts_are_combined_in_any_order(order):
    snapshots = made()
    assert snapshots.newest is None
    send(snapshots, 7, order)
    assert snapshots.newest == (7 * PERIOD, 7, 7, 7, 7, 7)


@given(st.integers(0, 29), st.integers(0, 5))
def test_the_newest_complete_snapshot_is_kept_while_the_detector_works(delay_2d, more_delay_3d):
    delay_3d = min(29, delay_2d + more_delay_3d)
    snapshots = made()
    for number in range(60):
        send(snapshots, number, PARTS[:3])
        for part, delay in (('boxes2d', delay_2d), ('boxes3d', delay_3d)):
            if number >= delay:
                send(snapshots, number - delay, [part])
    assert parts_of(snapshots.newest) == (59 - delay_3d,) * 5


def test_images_without_detections_are_skipped():
    snapshots = made()
    for number in range(50):
        send(snapshots, number, PARTS if number % 10 == 5 else PARTS[:3])
    assert parts_of(snapshots.newest) == (45,) * 5


def test_boxes_of_another_stamp_are_ignored():
    snapshots = made()
    send(snapshots, 1, PARTS[:3])
    snapshots.add_boxes3d(PERIOD + 1, 0, 'other')
    assert snapshots.newest.boxes3d is None


def test_without_boxes_the_newest_images_are_returned_after_the_delay():
    snapshots = made()
    assert snapshots.is_early
    for number in range(40):
        send(snapshots, number, PARTS[:3])
        assert snapshots.is_early == (number * PERIOD < NS)
    assert parts_of(snapshots.newest) == (39, 39, 39, None, None)


def test_missing_boxes_are_not_replaced_by_those_of_an_old_image():
    snapshots = made()
    for number in range(80):
        send(snapshots, number, PARTS if number < 10 else PARTS[:3])
    assert parts_of(snapshots.newest) == (79, 79, 79, None, None) and not snapshots.is_early


def test_the_stamp_of_a_colour_image_without_depth_is_returned():
    snapshots = made()
    lost = [stamp for number in range(5) for stamp in
            send(snapshots, number, [part for part in PARTS if number != 2 or part != 'depth'])]
    assert lost == [2 * PERIOD] and parts_of(snapshots.newest) == (4,) * 5


def test_older_messages_are_dropped_when_time_jumps_back():
    snapshots = made()
    for number in range(100, 140):
        send(snapshots, number)
    assert send(snapshots, 2) == [2 * PERIOD]  # it cannot be distinguished from a late image
    send(snapshots, 3, PARTS[:3])
    assert parts_of(snapshots.newest) == (3, 3, 3, None, None) and snapshots.is_early
    send(snapshots, 3, PARTS[3:])
    assert parts_of(snapshots.newest) == (3,) * 5
