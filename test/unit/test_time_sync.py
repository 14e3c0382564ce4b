import pytest
from hypothesis import given, strategies as st

from ros_3d_bb.core.senders import Senders
from ros_3d_bb.core.time_jumps import SETTLING_S, TimeJumps
from ros_3d_bb.core.time_sync import NS, CameraClocks, StampSynchronizer

MS = NS // 1000
PERIOD = 33 * MS


class Recorder(object):
    """A synchronizer with the `frames` (boxes, depth, camera) of its callbacks, depth and camera None for lost boxes.

    `dropped` are the boxes from before a time jump.
    """

    def __init__(self, length_ns=NS, tolerance_ns=5 * MS, assumed_delay_ns=0):
        self.sync = StampSynchronizer(length_ns, tolerance_ns, assumed_delay_ns, self._on_frame, self._on_lost)
        self.frames, self.dropped = [], []

    def _on_frame(self, boxes, depth, camera):
        self.frames.append((boxes.value, depth.value, camera))

    def _on_lost(self, boxes, _stamp_ns, before_jump):
        if before_jump:
            self.dropped.append(boxes)
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
def test_boxes_are_paired_with_their_frame_at_any_delay(delay_ns, info_delay_ns):
    """Depth always its own; the camera too, unless it comes later than the next depth image."""
    settled = play(delay_ns, info_delay_ns=info_delay_ns)
    assert all(boxes == depth for boxes, depth, _camera in settled)
    assert [boxes for boxes, _depth, _camera in settled] == list(range(len(settled)))
    assert len(settled) >= 60 - max(0, delay_ns - 900 * MS) // PERIOD - max(0, info_delay_ns) // PERIOD - 1
    if info_delay_ns < PERIOD:
        assert all(boxes == camera for boxes, _depth, camera in settled)


@pytest.mark.parametrize('delay_ms', [1, 50, 200])
@pytest.mark.parametrize('stamped', [True, False])
def test_all_boxes_are_paired_at_the_delays_of_real_detectors(delay_ms, stamped):
    assert play(delay_ms * MS, stamped) == [(n, n, n) for n in range(60)]


@pytest.mark.parametrize('offset_ms', [-14, -5, 0, 8, 14])
@pytest.mark.parametrize('delay_ms', [1, 50, 200])
def test_a_free_running_depth_camera_is_paired_by_the_nearest_image(offset_ms, delay_ms):
    """Every seventh depth image is lost, and its boxes with it."""
    recorder = Recorder(tolerance_ns=0)
    events = [(n * PERIOD, 'boxes', n) for n in range(60)] + [(n * PERIOD, 'camera', n) for n in range(60)]
    events += [(n * PERIOD + offset_ms * MS, 'depth', n) for n in range(60) if n % 7 != 3]
    arrivals = sorted((stamp_ns + (delay_ms * MS if kind == 'boxes' else 0), stamp_ns, kind, number)
                      for stamp_ns, kind, number in events)
    for now_ns, stamp_ns, kind, number in arrivals:
        recorder.add(kind, stamp_ns, now_ns, number)
    paired = [(boxes, depth) for boxes, depth, _camera in recorder.frames if depth is not None]
    assert paired == [(n, n) for n in range(60) if n % 7 != 3][-len(paired):] and len(paired) >= 49


def pairs_ms(colors_ms, depths_ms, late_ms):
    """Pairs (colour, depth) of stamps; depth arrives `late_ms` after colour."""
    recorder = Recorder(tolerance_ns=0)
    recorder.add('camera', None, 0, 'K')
    events = [(ms, 'boxes', ms) for ms in colors_ms] + [(ms + late_ms, 'depth', ms) for ms in depths_ms]
    for now_ms, kind, ms in sorted(events):
        recorder.add(kind, ms * MS, now_ms * MS, ms)
    recorder.sync.end()
    return [(color_ms, depth_ms) for color_ms, depth_ms, _camera in recorder.frames if depth_ms is not None]


@pytest.mark.parametrize('before_ms,after_ms', [(66, 33), (166, 66)])
def test_each_image_gets_its_own_depth_though_the_rate_changes(before_ms, after_ms):
    stamps_ms = list(range(0, 5000, before_ms)) + list(range(5000, 7000, after_ms))
    assert pairs_ms(stamps_ms, stamps_ms, late_ms=25) == [(ms, ms) for ms in stamps_ms]


@pytest.mark.parametrize('depth_late_ms', [-8, 0, 8])
def test_boxes_before_their_depth_image_wait_for_it_with_a_long_tolerance(depth_late_ms):
    """As of a fast detector. The stamps of one image differ by 8 ms at most, and by up to 50 ms elsewhere."""
    recorder = Recorder(tolerance_ns=50 * MS)
    recorder.add('camera', None, 0, 'camera')
    for number in range(20):
        recorder.add('boxes', number * PERIOD, number * PERIOD, number)
        recorder.add('depth', number * PERIOD + depth_late_ms * MS, number * PERIOD + 10 * MS, number)
    assert recorder.frames[1:] == [(n, n, 'camera') for n in range(1, 20)]


@pytest.fixture
def recorder():
    """With the camera of image 0 and nothing else."""
    recorder = Recorder(assumed_delay_ns=50 * MS)
    recorder.add('camera', 0, 0, 'first')
    return recorder


# Events (kind, stamp in periods or None), and the frame (boxes, depth, camera) that the last one completes, where each
# is the number of its event. Previous events complete nothing. Camera 'first' has the stamp 0.
SEQUENCES = {
    'boxes wait for their depth image and camera':
        ([('boxes', 2), ('depth', 1), ('depth', 2), ('camera', 2)], (0, 2, 3)),
    'the nearest camera replaces one that was lost': ([('boxes', 2), ('depth', 2), ('depth', 3)], (0, 1, 'first')),
    'a camera is published once': ([('depth', 1), ('depth', 2), ('depth', 3), ('boxes', 3)], (3, 2, 'first')),
    'a camera is published once, before a time jump':
        ([('camera', 9999), ('depth', 9999), ('depth', 1), ('boxes', 1)], (3, 2, 0)),
    'the depth image was lost': ([('depth', 1), ('boxes', 2), ('depth', 3)], (1, None, None)),
    'the depth image is no longer cached':
        ([('depth', 1), ('depth', 20), ('depth', 40), ('boxes', 1)], (3, None, None)),
    'boxes arrive first after a pause':
        ([('depth', 1), ('boxes', 9999), ('camera', 9999), ('depth', 9999)], (1, 3, 2)),
    'boxes without a stamp, and no depth image': ([('boxes', None)], (0, None, None)),
    'stamps differ by less than the tolerance': ([('depth', 1), ('depth', 2), ('boxes', 1.1)], (2, 0, 'first')),
    'stamps differ by more than the tolerance': ([('depth', 1), ('depth', 2), ('boxes', 1.3)], (2, None, None)),
    'a camera without a stamp replaces one with': ([('camera', None), ('depth', 1), ('boxes', 1)], (2, 1, 0)),
    'a camera with a stamp replaces one without':
        ([('camera', None), ('camera', 2), ('depth', 2), ('boxes', 2)], (3, 2, 1))}


@pytest.mark.parametrize('name', SEQUENCES)
def test_sequence(recorder, name):
    events, frame = SEQUENCES[name]
    completed = [recorder.add(kind, None if stamp is None else int(stamp * PERIOD), number, number)
                 for number, (kind, stamp) in enumerate(events)]
    assert completed == [[]] * (len(events) - 1) + [[frame]]


def test_boxes_without_a_stamp_get_no_outdated_depth(recorder):
    recorder.add('depth', PERIOD, 0, 'depth')
    assert recorder.add('boxes', None, 3 * NS, 'boxes') == [('boxes', None, None)]


def test_boxes_first_after_a_time_jump_wait_for_their_depth_image(recorder):
    recorder.add('camera', None, 0, 'camera')
    recorder.add('depth', 3600 * NS, 0, 'end')
    recorder.add('boxes', 3600 * NS, 0, 'end')
    recorder.add('boxes', 3600 * NS + PERIOD, 0, 'old')
    assert recorder.add('boxes', PERIOD, 1, 'boxes') == []
    assert recorder.add('depth', PERIOD, 2, 'start') == [('boxes', 'start', 'camera')]
    assert recorder.dropped == ['old']


def test_the_number_of_waiting_boxes_is_bounded(recorder):
    settled = [pair for n in range(150) for pair in recorder.add('boxes', PERIOD + n, 0, n)]
    assert settled == [(n, None, None) for n in range(50)]


@given(st.lists(st.tuples(st.sampled_from(['depth', 'camera', 'boxes', 'plain boxes']), st.integers(1, 200)),
                max_size=80))
def test_all_boxes_are_matched_or_lost_for_any_messages(events):
    recorder, sent = Recorder(assumed_delay_ns=50 * MS), 0
    for number, (kind, stamp) in enumerate(events):
        sent += 'boxes' in kind
        stamp_ns = None if kind == 'plain boxes' else stamp * PERIOD
        recorder.add('boxes' if 'boxes' in kind else kind, stamp_ns, number * PERIOD, number)
    recorder.sync.end()
    ended = [boxes for boxes, _depth, _camera in recorder.frames] + recorder.dropped
    assert len(ended) == sent and len(set(ended)) == sent
    recorder.sync.end()
    assert len(recorder.frames) + len(recorder.dropped) == sent


@pytest.mark.parametrize('kind', ['depth', 'camera', 'boxes'])
def test_one_stamp_from_the_future_loses_only_images_in_the_detector(kind):
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


def accepted(clocks, stamp_ns, now_ns, camera):
    """Result for an image that is tracked if it is accepted."""
    right = clocks.accept(stamp_ns, now_ns, camera)
    if right is None:
        clocks.track(stamp_ns, camera)
    return right


@pytest.fixture
def clocks():
    """Clocks of two cameras with an image of the same time."""
    clocks = CameraClocks()
    assert accepted(clocks, 9 * NS, 0, 'front') is None and accepted(clocks, 9 * NS, 0, 'rear') is None
    return clocks


def test_a_duplicate_of_the_latest_tracked_stamp_is_rejected(clocks):
    with pytest.raises(ValueError, match='duplicate'):
        clocks.accept(9 * NS, 1, 'front')
    assert clocks.accept(9 * NS + 1, 2, 'front') is None
    assert clocks.accept(9 * NS + 1, 3, 'front') is None  # it was not tracked


@pytest.mark.parametrize('clock', ['ROS time', 'stamps'])
@pytest.mark.parametrize('jump_s, expected', [
    (-20.0, True), (-1.3, True), (-0.5, False), (0.0, False), (0.9, False), (1.1, True), (3600.0, True)])
def test_a_jump_of_either_clock_is_recent_for_a_while(clock, jump_s, expected):
    jumps = TimeJumps()
    for number in range(40):
        now_s = number / 10
        for each in ('ROS time', 'stamps'):
            jumps.see(each, int((100 + now_s + (jump_s if each == clock and number >= 20 else 0)) * NS), now_s)
        assert jumps.are_recent(now_s) == (expected and 2.0 <= now_s <= 2.0 + SETTLING_S)


def test_a_pause_of_the_machine_or_a_constant_difference_is_no_jump():
    jumps = TimeJumps()
    for now_s in (0.0, 0.1, 7.0, 7.1):
        jumps.see('ROS time', int((1e9 + now_s) * NS), now_s)
        jumps.see('stamps', int(now_s * NS), now_s)
        assert not jumps.are_recent(now_s)


@pytest.mark.parametrize('sent, expected', [
    ('aaaa', ''), ('aaabbb', ''), ('abc', ''), ('aabab', 'ab'), ('abca', 'abc'),
    ('aaab|ba', ''), ('aaab|bab', 'ab'), ('ab|bb|bb', '')])
def test_nodes_send_at_once_if_one_sends_again_after_another(sent, expected):
    """`|`: they are asked for."""
    senders = Senders()
    for node in sent:
        if node == '|':
            senders.take()
        else:
            senders.add(node)
    assert senders.take() == tuple(expected)
