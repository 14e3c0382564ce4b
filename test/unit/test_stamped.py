"""Pairing by stamp: exact at any delay, whatever comes first, and after time went back."""
import pytest
from hypothesis import given, strategies as st

from ros_3d_bb.stamped import MAX_RATE_HZ, MAX_WAITING, NS, Frame, Pairing, StampedCache

MS = NS // 1000
PERIOD = 33 * MS


def play(delay_ns, stamped=True, frames=60, pairing=None, info_delay_ns=0):
    """Send images at 30 Hz and their boxes `delay_ns` later; returns numbers (of boxes, of depth, of camera)."""
    pairing = pairing or Pairing(NS, 5 * MS, delay_ns)
    events = [(n * PERIOD, 'depth', n) for n in range(frames)]
    events += [(n * PERIOD + info_delay_ns, 'camera', n) for n in range(frames)]
    events += [(n * PERIOD + delay_ns, 'boxes', n) for n in range(frames)]
    settled = []
    for now_ns, kind, number in sorted(events):
        if kind == 'boxes':
            settled += pairing.add_boxes(number * PERIOD if stamped else None, now_ns, number)
        else:
            add = pairing.add_depth if kind == 'depth' else pairing.add_camera
            settled += add(number * PERIOD, now_ns, number)
    return [(boxes, frame and frame.depth, frame and frame.camera) for frame, boxes in settled]


@given(st.integers(-900 * MS, 900 * MS), st.integers(-100 * MS, 100 * MS))
def test_every_array_gets_its_own_frame_at_any_delay(delay_ns, info_delay_ns):
    """Depth always its own; the camera too, unless it comes later than the next depth image."""
    settled = play(delay_ns, info_delay_ns=info_delay_ns)
    assert all(boxes == depth for boxes, depth, _camera in settled)
    assert [boxes for boxes, _depth, _camera in settled] == list(range(len(settled)))
    assert len(settled) >= 60 - max(0, delay_ns - 900 * MS) // PERIOD - max(0, info_delay_ns) // PERIOD - 1
    if info_delay_ns < PERIOD:
        assert all(boxes == camera for boxes, _depth, camera in settled)


@pytest.mark.parametrize('delay_ms', [0, 50, 200])
def test_all_arrays_are_paired_at_the_delays_of_real_detectors(delay_ms):
    assert play(delay_ms * MS) == [(n, n, n) for n in range(60)]


@pytest.mark.parametrize('delay_ms', [1, 50, 200])
def test_arrays_without_stamp_are_paired_by_the_assumed_delay(delay_ms):
    assert play(delay_ms * MS, stamped=False) == [(n, n, n) for n in range(60)]


@pytest.fixture
def pairing():
    """With the camera of image 0 and nothing else."""
    pairing = Pairing(NS, 5 * MS, 50 * MS)
    pairing.add_camera(0, 0, 'camera')
    return pairing


def test_arrays_without_stamp_and_without_recent_depth_get_nothing(pairing):
    assert pairing.add_boxes(None, 0, 'boxes') == [(None, 'boxes')]
    pairing.add_depth(PERIOD, 0, 'depth')
    assert pairing.add_boxes(None, 3 * NS, 'boxes') == [(None, 'boxes')]


def test_boxes_that_come_first_wait_for_their_image(pairing):
    assert pairing.add_boxes(2 * PERIOD, 0, 'boxes') == []
    assert pairing.add_depth(PERIOD, 1, 'one') == []
    assert pairing.add_depth(2 * PERIOD, 2, 'two') == []
    assert pairing.add_camera(2 * PERIOD, 3, 'its own') == [(Frame(2 * PERIOD, 'two', 'its own'), 'boxes')]
    assert pairing.add_depth(3 * PERIOD, 4, 'three') == []


def test_a_camera_that_is_sent_once_serves_all_images(pairing):
    pairing.add_boxes(2 * PERIOD, 0, 'boxes')
    assert pairing.add_depth(2 * PERIOD, 1, 'two') == []
    assert pairing.add_depth(3 * PERIOD, 2, 'three') == [(Frame(2 * PERIOD, 'two', 'camera'), 'boxes')]


def test_without_any_camera_boxes_are_given_up_in_time():
    pairing = Pairing(NS, 5 * MS, 0)
    pairing.add_boxes(PERIOD, 0, 'boxes')
    assert pairing.add_depth(PERIOD, 1, 'one') == [] and not pairing.has_camera
    assert pairing.add_depth(40 * PERIOD, 40 * PERIOD, 'later') == [(None, 'boxes')]


def test_without_any_depth_boxes_are_given_up_in_time():
    """Nothing comes but boxes: they themselves show that too much time has passed."""
    pairing = Pairing(NS, 5 * MS, 0)
    settled = [pair for n in range(60) for pair in pairing.add_boxes(n * PERIOD, n * PERIOD, n)]
    assert settled == [(None, n) for n in range(60 - 31)] and pairing.newest_ns is None


def test_boxes_whose_image_was_lost_are_given_up_when_the_next_comes(pairing):
    pairing.add_depth(1 * PERIOD, 0, 'one')
    pairing.add_boxes(2 * PERIOD, 1, 'boxes')
    assert pairing.add_depth(3 * PERIOD, 2, 'three') == [(None, 'boxes')]


def test_boxes_that_were_on_their_way_when_a_bag_looped_are_dropped(pairing):
    pairing.add_depth(3600 * NS, 0, 'end')
    pairing.add_depth(PERIOD, 1, 'start')
    assert pairing.add_boxes(3600 * NS, 2, 'boxes') == []
    assert pairing.add_depth(2 * PERIOD, 9 * NS, 'two') == []


def test_after_a_pause_boxes_may_come_before_their_image(pairing):
    pairing.add_depth(PERIOD, 0, 'one')
    assert pairing.add_boxes(3600 * NS, 1, 'boxes') == []
    pairing.add_camera(3600 * NS, 2, 'new camera')
    (frame, boxes), = pairing.add_depth(3600 * NS, 3, 'two')
    assert (frame.depth, frame.camera, boxes) == ('two', 'new camera', 'boxes')


def test_no_more_than_so_many_boxes_wait(pairing):
    settled = [pair for n in range(150) for pair in pairing.add_boxes(PERIOD + n, 0, n)]
    assert settled == [(None, n) for n in range(50)]


def test_boxes_older_than_the_cache_get_nothing(pairing):
    for number in range(40):
        pairing.add_depth(number * PERIOD, number, number)
    assert pairing.add_boxes(0, 99, 'boxes') == [(None, 'boxes')]


def test_a_slightly_different_stamp_is_the_same_image(pairing):
    for number in (1, 2, 3):
        pairing.add_depth(number * PERIOD, 0, number)
    (frame, _boxes), = pairing.add_boxes(PERIOD + 2 * MS, 0, 'boxes')
    assert frame.depth == 1
    assert pairing.add_boxes(PERIOD + 10 * MS, 0, 'boxes') == [(None, 'boxes')]


def test_time_that_goes_back_clears_everything():
    pairing = Pairing(NS, 5 * MS, 50 * MS)
    play(50 * MS, pairing=pairing)
    pairing.add_boxes(60 * PERIOD, 60 * PERIOD, 'of the time before')
    assert play(50 * MS, pairing=pairing) == [(n, n, n) for n in range(60)]


@given(st.lists(st.tuples(st.sampled_from(['depth', 'camera', 'boxes', 'plain boxes']), st.integers(1, 200)),
                max_size=80))
def test_boxes_are_settled_or_counted_as_forgotten_whatever_comes(events):
    pairing, settled, forgotten, sent = Pairing(NS, 5 * MS, 50 * MS), [], 0, 0
    for number, (kind, stamp) in enumerate(events):
        sent += 'boxes' in kind
        add = {'depth': pairing.add_depth, 'camera': pairing.add_camera}.get(kind, pairing.add_boxes)
        settled += add(None if kind == 'plain boxes' else stamp * PERIOD, number * PERIOD, number)
        forgotten += pairing.take_forgotten()
    settled += pairing.end()
    assert len(settled) + forgotten == sent
    assert len(set(boxes for _frame, boxes in settled)) == len(settled) and pairing.take_forgotten() == 0


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
    assert cache.newest_ns is None and cache.at(0, NS) is None and cache.arrived_at(0, NS) is None


def test_of_equal_stamps_the_newest_value_is_kept():
    """The clock of a driver hangs, or /clock is frozen."""
    cache = StampedCache(NS)
    for number in range(1000):
        assert cache.add(NS, number, number) is False
    assert len(cache) == 1 and cache.at(NS) == (NS, 999, 999)


@pytest.mark.parametrize('length_ns', [0, NS // 2, NS, 10 * NS])
def test_stamps_that_creep_keep_no_more_than_the_fastest_camera_would(length_ns):
    cache = StampedCache(length_ns)
    for number in range(4000):
        cache.add(number, number, number)
    kept = [entry.value for entry in reversed(cache)]
    assert len(kept) == length_ns * MAX_RATE_HZ // NS + 1 and kept == list(range(3999, 3999 - len(kept), -1))


@pytest.mark.parametrize('rate_hz,length_ns', [(90, NS), (120, 10 * NS), (300, NS), (30, 60 * NS)])
def test_what_a_real_camera_sends_is_kept_for_the_whole_length(rate_hz, length_ns):
    """However slowly it is played: nothing depends on when it arrives."""
    cache = StampedCache(length_ns)
    for number in range(70 * rate_hz):
        cache.add(number * NS // rate_hz, 3600 * NS * number, number)
    oldest = [entry for entry in reversed(cache)][-1]
    assert cache.newest_ns - oldest.stamp_ns > length_ns - NS // rate_hz


def held_by(pairing):
    return len(pairing._depths), len(pairing._cameras), len(pairing._waiting)


@given(st.lists(st.tuples(st.sampled_from(['depth', 'camera', 'boxes']),
                          st.sampled_from([0, 0, 1, 2, MS, PERIOD, -1, -PERIOD, 3600 * NS, -3600 * NS])),
                min_size=200, max_size=600))
def test_a_pairing_holds_a_bounded_number_whatever_the_stamps_are(steps):
    """Stamps stand still, creep, leap and go back."""
    pairing, stamp_ns = Pairing(NS // 10, 5 * MS, 0), 10000 * NS
    for number, (kind, step_ns) in enumerate(steps):
        stamp_ns = max(1, stamp_ns + step_ns)
        getattr(pairing, 'add_' + kind)(stamp_ns, number, number)
        depths, cameras, waiting = held_by(pairing)
        assert max(depths, cameras) <= 11 and waiting <= MAX_WAITING


@pytest.mark.parametrize('kind', ['depth', 'camera', 'boxes'])
def test_one_stamp_of_the_future_costs_what_is_on_its_way(kind):
    """An hour ahead, while the detector takes 0.2 s: at most these six images and the wrong one are lost."""
    pairing, settled = Pairing(NS, 5 * MS, 0), []
    for number in range(120):
        for other, late in (('camera', 0), ('depth', 0), ('boxes', 6)):
            sent = number - late
            ahead_ns = 3600 * NS if other == kind and sent == 60 else 0
            settled += getattr(pairing, 'add_' + other)(sent * PERIOD + 9 * NS + ahead_ns, number * PERIOD, sent)
    answered = [boxes for frame, boxes in settled if frame is not None and frame.depth == boxes]
    lost = set(range(114)) - set(answered)
    expected = {'depth': set(range(54, 61)), 'camera': set(), 'boxes': {60}}
    assert lost == expected[kind]


def test_a_camera_without_a_stamp_serves_any_image_at_once():
    pairing = Pairing(NS, 5 * MS, 0)
    for number in range(1000):
        assert pairing.add_camera(None, number, 'plain') == []
    assert pairing.has_camera and held_by(pairing) == (0, 0, 0)
    pairing.add_depth(PERIOD, 0, 'one')
    assert pairing.add_boxes(PERIOD, 0, 'boxes') == [(Frame(PERIOD, 'one', 'plain'), 'boxes')]
    pairing.add_depth(3600 * NS, 1, 'later')
    pairing.add_depth(2 * PERIOD, 2, 'after time went back')
    (frame, _boxes), = pairing.add_boxes(2 * PERIOD, 3, 'boxes')
    assert frame.camera == 'plain'


def test_the_newest_camera_counts_with_a_stamp_or_without(pairing):
    pairing.add_camera(None, 0, 'plain')
    pairing.add_depth(PERIOD, 1, 'one')
    assert pairing.add_boxes(PERIOD, 1, 'boxes')[0][0].camera == 'plain'
    pairing.add_camera(2 * PERIOD, 2, 'stamped')
    pairing.add_depth(2 * PERIOD, 3, 'two')
    assert pairing.add_boxes(2 * PERIOD, 3, 'boxes')[0][0].camera == 'stamped'
