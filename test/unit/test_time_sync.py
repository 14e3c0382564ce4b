"""Synchronization by stamp: exact at any delay, whatever comes first, and after time went back."""
import pytest
from hypothesis import given, strategies as st

from ros_3d_bb.core.time_sync import MAX_RATE_HZ, MAX_WAITING, NS, MessageCache, StampSynchronizer

MS = NS // 1000
PERIOD = 33 * MS


class Recorder(object):
    """A synchronizer and what its callbacks got.

    Attributes
    ----------
    frames : list of (boxes, depth, camera)
        Depth and camera are None for lost boxes.
    forgotten : list
        Boxes of the time before.
    """

    def __init__(self, length_ns=NS, tolerance_ns=5 * MS, assumed_delay_ns=0):
        self.sync = StampSynchronizer(length_ns, tolerance_ns, assumed_delay_ns, self._on_frame, self._on_lost)
        self.frames, self.forgotten = [], []

    def _on_frame(self, boxes, depth, camera):
        self.frames.append((boxes, depth, camera))

    def _on_lost(self, boxes, of_time_before):
        if of_time_before:
            self.forgotten.append(boxes)
        else:
            self.frames.append((boxes, None, None))

    def add(self, kind, stamp_ns, now_ns, value):
        """Add a depth image, a camera or boxes. Returns the frames that this completed."""
        before = len(self.frames)
        {'depth': self.sync.add_depth, 'camera': self.sync.add_camera, 'boxes': self.sync.add_boxes}[kind](
            stamp_ns, now_ns, value)
        return self.frames[before:]


def play(delay_ns, stamped=True, frames=60, recorder=None, info_delay_ns=0):
    """Send images at 30 Hz and their boxes `delay_ns` later; returns numbers (of boxes, of depth, of camera)."""
    recorder = recorder or Recorder(assumed_delay_ns=delay_ns)
    events = [(n * PERIOD, 'depth', n) for n in range(frames)]
    events += [(n * PERIOD + info_delay_ns, 'camera', n) for n in range(frames)]
    events += [(n * PERIOD + delay_ns, 'boxes', n) for n in range(frames)]
    settled = []
    for now_ns, kind, number in sorted(events):
        stamp_ns = None if kind == 'boxes' and not stamped else number * PERIOD
        settled += recorder.add(kind, stamp_ns, now_ns, number)
    return settled


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
def recorder():
    """With the camera of image 0 and nothing else."""
    recorder = Recorder(assumed_delay_ns=50 * MS)
    recorder.add('camera', 0, 0, 'camera')
    return recorder


def test_arrays_without_stamp_and_without_recent_depth_get_nothing(recorder):
    assert recorder.add('boxes', None, 0, 'boxes') == [('boxes', None, None)]
    recorder.add('depth', PERIOD, 0, 'depth')
    assert recorder.add('boxes', None, 3 * NS, 'boxes') == [('boxes', None, None)]


def test_boxes_that_come_first_wait_for_their_image(recorder):
    assert recorder.add('boxes', 2 * PERIOD, 0, 'boxes') == []
    assert recorder.add('depth', PERIOD, 1, 'one') == []
    assert recorder.add('depth', 2 * PERIOD, 2, 'two') == []
    assert recorder.add('camera', 2 * PERIOD, 3, 'its own') == [('boxes', 'two', 'its own')]
    assert recorder.add('depth', 3 * PERIOD, 4, 'three') == []


def test_a_camera_that_is_sent_once_serves_all_images(recorder):
    recorder.add('boxes', 2 * PERIOD, 0, 'boxes')
    assert recorder.add('depth', 2 * PERIOD, 1, 'two') == []
    assert recorder.add('depth', 3 * PERIOD, 2, 'three') == [('boxes', 'two', 'camera')]


def test_without_any_camera_boxes_are_given_up_in_time():
    recorder = Recorder()
    recorder.add('boxes', PERIOD, 0, 'boxes')
    assert recorder.add('depth', PERIOD, 1, 'one') == [] and not recorder.sync.has_camera
    assert recorder.add('depth', 40 * PERIOD, 40 * PERIOD, 'later') == [('boxes', None, None)]


def test_without_any_depth_boxes_are_given_up_in_time():
    """Nothing comes but boxes: they themselves show that too much time has passed."""
    recorder = Recorder()
    settled = [pair for n in range(60) for pair in recorder.add('boxes', n * PERIOD, n * PERIOD, n)]
    assert settled == [(n, None, None) for n in range(60 - 31)] and recorder.sync.newest_ns is None


def test_boxes_whose_image_was_lost_are_given_up_when_the_next_comes(recorder):
    recorder.add('depth', 1 * PERIOD, 0, 'one')
    recorder.add('boxes', 2 * PERIOD, 1, 'boxes')
    assert recorder.add('depth', 3 * PERIOD, 2, 'three') == [('boxes', None, None)]


def test_boxes_that_were_on_their_way_when_a_bag_looped_are_dropped(recorder):
    recorder.add('depth', 3600 * NS, 0, 'end')
    recorder.add('depth', PERIOD, 1, 'start')
    assert recorder.add('boxes', 3600 * NS, 2, 'boxes') == []
    assert recorder.add('depth', 2 * PERIOD, 9 * NS, 'two') == []


def test_after_a_pause_boxes_may_come_before_their_image(recorder):
    recorder.add('depth', PERIOD, 0, 'one')
    assert recorder.add('boxes', 3600 * NS, 1, 'boxes') == []
    recorder.add('camera', 3600 * NS, 2, 'new camera')
    assert recorder.add('depth', 3600 * NS, 3, 'two') == [('boxes', 'two', 'new camera')]


def test_no_more_than_so_many_boxes_wait(recorder):
    settled = [pair for n in range(150) for pair in recorder.add('boxes', PERIOD + n, 0, n)]
    assert settled == [(n, None, None) for n in range(50)]


def test_boxes_older_than_the_cache_get_nothing(recorder):
    for number in range(40):
        recorder.add('depth', number * PERIOD, number, number)
    assert recorder.add('boxes', 0, 99, 'boxes') == [('boxes', None, None)]


def test_a_slightly_different_stamp_is_the_same_image(recorder):
    for number in (1, 2, 3):
        recorder.add('depth', number * PERIOD, 0, number)
    assert recorder.add('boxes', PERIOD + 2 * MS, 0, 'boxes') == [('boxes', 1, 'camera')]
    assert recorder.add('boxes', PERIOD + 10 * MS, 0, 'boxes') == [('boxes', None, None)]


def test_time_that_goes_back_clears_everything():
    recorder = Recorder(assumed_delay_ns=50 * MS)
    play(50 * MS, recorder=recorder)
    recorder.add('boxes', 60 * PERIOD, 60 * PERIOD, 'of the time before')
    assert play(50 * MS, recorder=recorder) == [(n, n, n) for n in range(60)]


@given(st.lists(st.tuples(st.sampled_from(['depth', 'camera', 'boxes', 'plain boxes']), st.integers(1, 200)),
                max_size=80))
def test_boxes_are_settled_or_counted_as_forgotten_whatever_comes(events):
    recorder, sent = Recorder(assumed_delay_ns=50 * MS), 0
    for number, (kind, stamp) in enumerate(events):
        sent += 'boxes' in kind
        stamp_ns = None if kind == 'plain boxes' else stamp * PERIOD
        recorder.add('boxes' if 'boxes' in kind else kind, stamp_ns, number * PERIOD, number)
    recorder.sync.end()
    ended = [boxes for boxes, _depth, _camera in recorder.frames] + recorder.forgotten
    assert len(ended) == sent and len(set(ended)) == sent
    recorder.sync.end()
    assert len(recorder.frames) + len(recorder.forgotten) == sent


@given(st.lists(st.integers(0, 5 * NS), min_size=1, max_size=50))
def test_the_cache_keeps_no_more_than_its_length_in_order(stamps):
    cache = MessageCache(NS)
    for stamp_ns in stamps:
        newest_ns = cache.newest_ns
        assert cache.add(stamp_ns, 0, stamp_ns) == (newest_ns is not None and stamp_ns < newest_ns)
        kept = [entry.stamp_ns for entry in cache._entries]
        assert kept == sorted(kept) and kept[-1] - kept[0] <= NS and cache.nearest(stamp_ns).value == stamp_ns


def test_an_empty_cache_has_no_answer():
    cache = MessageCache(NS)
    assert cache.newest_ns is None and cache.nearest(0, NS) is None and cache.arrived_at(0, NS) is None


def test_of_equal_stamps_the_newest_value_is_kept():
    """The clock of a driver hangs, or /clock is frozen."""
    cache = MessageCache(NS)
    for number in range(1000):
        assert cache.add(NS, number, number) is False
    assert len(cache) == 1 and cache.nearest(NS) == (NS, 999, 999)


@pytest.mark.parametrize('length_ns', [0, NS // 2, NS, 10 * NS])
def test_stamps_that_creep_keep_no_more_than_the_fastest_camera_would(length_ns):
    cache = MessageCache(length_ns)
    for number in range(4000):
        cache.add(number, number, number)
    kept = [entry.value for entry in reversed(cache)]
    assert len(kept) == length_ns * MAX_RATE_HZ // NS + 1 and kept == list(range(3999, 3999 - len(kept), -1))


@pytest.mark.parametrize('rate_hz,length_ns', [(90, NS), (120, 10 * NS), (300, NS), (30, 60 * NS)])
def test_what_a_real_camera_sends_is_kept_for_the_whole_length(rate_hz, length_ns):
    """However slowly it is played: nothing depends on when it arrives."""
    cache = MessageCache(length_ns)
    for number in range(70 * rate_hz):
        cache.add(number * NS // rate_hz, 3600 * NS * number, number)
    oldest = [entry for entry in reversed(cache)][-1]
    assert cache.newest_ns - oldest.stamp_ns > length_ns - NS // rate_hz


def held_by(sync):
    return len(sync._depths), len(sync._cameras), len(sync._waiting)


@pytest.mark.slow
@given(st.lists(st.tuples(st.sampled_from(['depth', 'camera', 'boxes']),
                          st.sampled_from([0, 0, 1, 2, MS, PERIOD, -1, -PERIOD, 3600 * NS, -3600 * NS])),
                min_size=200, max_size=600))
def test_a_synchronizer_holds_a_bounded_number_whatever_the_stamps_are(steps):
    """Stamps stand still, creep, leap and go back."""
    recorder, stamp_ns = Recorder(NS // 10), 10000 * NS
    for number, (kind, step_ns) in enumerate(steps):
        stamp_ns = max(1, stamp_ns + step_ns)
        recorder.add(kind, stamp_ns, number, number)
        depths, cameras, waiting = held_by(recorder.sync)
        assert max(depths, cameras) <= 11 and waiting <= MAX_WAITING


@pytest.mark.parametrize('kind', ['depth', 'camera', 'boxes'])
def test_one_stamp_of_the_future_costs_what_is_on_its_way(kind):
    """An hour ahead, while the detector takes 0.2 s: at most these six images and the wrong one are lost."""
    recorder, settled = Recorder(), []
    for number in range(120):
        for other, late in (('camera', 0), ('depth', 0), ('boxes', 6)):
            sent = number - late
            ahead_ns = 3600 * NS if other == kind and sent == 60 else 0
            settled += recorder.add(other, sent * PERIOD + 9 * NS + ahead_ns, number * PERIOD, sent)
    answered = [boxes for boxes, depth, _camera in settled if depth == boxes]
    lost = set(range(114)) - set(answered)
    expected = {'depth': set(range(54, 61)), 'camera': set(), 'boxes': {60}}
    assert lost == expected[kind]


def test_a_camera_without_a_stamp_serves_any_image_at_once():
    recorder = Recorder()
    for number in range(1000):
        assert recorder.add('camera', None, number, 'plain') == []
    assert recorder.sync.has_camera and held_by(recorder.sync) == (0, 0, 0)
    recorder.add('depth', PERIOD, 0, 'one')
    assert recorder.add('boxes', PERIOD, 0, 'boxes') == [('boxes', 'one', 'plain')]
    recorder.add('depth', 3600 * NS, 1, 'later')
    recorder.add('depth', 2 * PERIOD, 2, 'after time went back')
    assert recorder.add('boxes', 2 * PERIOD, 3, 'boxes') == [('boxes', 'after time went back', 'plain')]


def test_the_newest_camera_counts_with_a_stamp_or_without(recorder):
    recorder.add('camera', None, 0, 'plain')
    recorder.add('depth', PERIOD, 1, 'one')
    assert recorder.add('boxes', PERIOD, 1, 'boxes') == [('boxes', 'one', 'plain')]
    recorder.add('camera', 2 * PERIOD, 2, 'stamped')
    recorder.add('depth', 2 * PERIOD, 3, 'two')
    assert recorder.add('boxes', 2 * PERIOD, 3, 'boxes') == [('boxes', 'two', 'stamped')]
