"""Pairing by stamp: exact at any delay, whatever comes first, and after time went back."""
import pytest
from hypothesis import given, strategies as st

from ros_3d_bb.stamped import NS, Pairing, StampedCache

MS = NS // 1000
PERIOD = 33 * MS


def play(delay_ns, stamped=True, frames=60, pairing=None):
    """Send depth images at 30 Hz and their boxes `delay_ns` later; returns (box frame, depth frame) numbers."""
    pairing = pairing or Pairing(NS, 5 * MS, delay_ns)
    events = [(n * PERIOD, 1, n) for n in range(frames)] + [(n * PERIOD + delay_ns, 0, n) for n in range(frames)]
    pairs = []
    for time_ns, is_depth, number in sorted(events):
        if is_depth:
            got = pairing.add_depth(number * PERIOD, time_ns, number)
        else:
            got = pairing.add_boxes(number * PERIOD if stamped else None, time_ns, number)
        pairs += [(boxes, entry and entry.value) for entry, boxes in got]
    return pairs


@given(st.integers(-300 * MS, 900 * MS))
def test_every_array_gets_its_own_depth_image_at_any_delay(delay_ns):
    pairs = play(delay_ns)
    assert all(boxes == depth for boxes, depth in pairs)
    assert len(pairs) >= 60 - 30  # the last ones of a late detector come after the last image


@pytest.mark.parametrize('delay_ms', [0, 50, 200])
def test_all_arrays_are_paired_at_the_delays_of_real_detectors(delay_ms):
    assert play(delay_ms * MS) == [(n, n) for n in range(60)]


@pytest.mark.parametrize('delay_ms', [1, 50, 200])
def test_arrays_without_stamp_are_paired_by_the_assumed_delay(delay_ms):
    assert all(boxes == depth for boxes, depth in play(delay_ms * MS, stamped=False) if depth is not None)


def test_boxes_that_come_first_wait_for_their_image():
    pairing = Pairing(NS, 5 * MS, 0)
    assert pairing.add_boxes(2 * PERIOD, 0, 'boxes') == []
    assert pairing.add_depth(1 * PERIOD, 1, 'one') == []
    (entry, boxes), = pairing.add_depth(2 * PERIOD, 2, 'two')
    assert (entry.value, boxes) == ('two', 'boxes')
    assert pairing.add_depth(3 * PERIOD, 3, 'three') == []


def test_boxes_whose_image_was_lost_are_given_up_when_the_next_comes():
    pairing = Pairing(NS, 5 * MS, 0)
    pairing.add_depth(1 * PERIOD, 0, 'one')
    pairing.add_boxes(2 * PERIOD, 1, 'boxes')
    assert pairing.add_depth(3 * PERIOD, 2, 'three') == [(None, 'boxes')]


def test_boxes_from_the_future_do_not_wait_for_ever():
    pairing = Pairing(NS, 5 * MS, 0)
    pairing.add_boxes(3600 * NS, 0, 'boxes')
    assert pairing.add_depth(PERIOD, NS // 2, 'early') == []
    assert pairing.add_depth(2 * PERIOD, 2 * NS, 'late') == [(None, 'boxes')]


def test_boxes_older_than_the_cache_get_nothing():
    pairing = Pairing(NS, 5 * MS, 0)
    for number in range(40):
        pairing.add_depth(number * PERIOD, number, number)
    assert pairing.add_boxes(0, 99, 'boxes') == [(None, 'boxes')]


def test_a_slightly_different_stamp_is_the_same_image():
    pairing = Pairing(NS, 5 * MS, 0)
    pairing.add_depth(PERIOD, 0, 'one')
    pairing.add_depth(2 * PERIOD, 0, 'two')
    (entry, _boxes), = pairing.add_boxes(PERIOD + 2 * MS, 0, 'boxes')
    assert entry.value == 'one'
    assert pairing.add_boxes(PERIOD + 10 * MS, 0, 'boxes') == [(None, 'boxes')]


def test_time_that_goes_back_clears_everything():
    pairing = Pairing(NS, 5 * MS, 50 * MS)
    play(50 * MS, pairing=pairing)
    pairing.add_boxes(99 * PERIOD, 0, 'of the time before')
    assert play(50 * MS, pairing=pairing) == [(n, n) for n in range(60)]


@given(st.lists(st.integers(0, 5 * NS), min_size=1, max_size=50))
def test_the_cache_keeps_no_more_than_its_length_in_order(stamps):
    cache = StampedCache(NS)
    for stamp_ns in stamps:
        newest_ns = cache.newest_ns
        assert cache.add(stamp_ns, 0, stamp_ns) == (newest_ns is not None and stamp_ns < newest_ns)
        kept = [entry.stamp_ns for entry in cache._entries]
        assert kept == sorted(kept) and kept[-1] - kept[0] <= NS and cache.at(stamp_ns).value == stamp_ns


def test_an_empty_cache_has_no_answer():
    cache = StampedCache(NS)
    assert cache.newest_ns is None and cache.at(0, NS) is None and cache.arrived_at(0) is None
