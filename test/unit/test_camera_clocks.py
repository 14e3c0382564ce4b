"""Which stamps leap ahead of those of other cameras."""
import pytest
from hypothesis import given, strategies as st

from ros_3d_bb.camera_clocks import ALIVE_NS, JUMP_NS, MOST_RECENT, CameraClocks, RecentStamps
from ros_3d_bb.stamped import NS

HOUR_NS = 3600 * NS


@pytest.fixture
def clocks():
    """Of two cameras that have just sent an image of the same time."""
    clocks = CameraClocks()
    assert clocks.accept(9 * NS, 0, 'front') is None and clocks.accept(9 * NS, 0, 'rear') is None
    return clocks


@pytest.mark.parametrize('now_ns,ahead_of', [(1, 'rear'), (ALIVE_NS, 'rear'), (ALIVE_NS + 1, None)])
def test_a_leap_is_refused_while_the_other_camera_is_alive(clocks, now_ns, ahead_of):
    assert clocks.accept(9 * NS + HOUR_NS, now_ns, 'front') == ahead_of


def test_a_leap_of_all_is_accepted(clocks):
    assert clocks.accept(9 * NS + HOUR_NS, 1, 'front') == 'rear'
    assert clocks.accept(9 * NS + HOUR_NS, 2, 'rear') is None
    assert clocks.accept(9 * NS + HOUR_NS, 3, 'front') is None


@pytest.mark.parametrize('passed_ns', [0, NS // 2])
def test_a_leap_is_what_arrival_does_not_explain(clocks, passed_ns):
    assert clocks.accept(9 * NS + passed_ns + JUMP_NS, passed_ns, 'front') is None
    assert clocks.accept(9 * NS + passed_ns + 2 * JUMP_NS + 1, passed_ns, 'front') == 'rear'


def test_clocks_that_differ_from_the_beginning_are_that_of_the_first_camera():
    clocks = CameraClocks()
    for number in range(100):
        assert clocks.accept(HOUR_NS + number, number, 'front') is None
        assert clocks.accept(NS + number, number, 'rear') is None  # the tracker refuses it, as late
        assert clocks.accept(2 * HOUR_NS + number, number, 'left') == 'front'


def test_a_trusted_leap_is_accepted_and_what_follows_it(clocks):
    assert clocks.accept(9 * NS + HOUR_NS, 1, 'front', is_trusted=True) is None
    assert clocks.accept(9 * NS + HOUR_NS, 2, 'front') is None
    clocks.forget('front')
    assert clocks.accept(9 * NS + HOUR_NS, 3, 'front') == 'rear'


@given(st.lists(st.tuples(st.integers(0, 2 ** 31 * NS), st.integers(0, 10 * NS)), max_size=30))
def test_of_a_single_camera_nothing_is_refused(images):
    clocks = CameraClocks()
    assert all(clocks.accept(stamp_ns, now_ns, '') is None for stamp_ns, now_ns in images)


def test_images_whose_stamps_stand_still_are_too_many_until_they_advance():
    recent = RecentStamps(NS // 2)
    for number in range(MOST_RECENT):
        recent.check(NS + number, 'front')
        recent.add(NS + number, 'front')
    with pytest.raises(ValueError, match='of 100 images of camera'):
        recent.check(NS + MOST_RECENT, 'front')
    recent.check(NS, 'rear')
    recent.check(2 * NS, 'front')
