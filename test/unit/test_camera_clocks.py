"""Which of several cameras has the correct time."""
import pytest

from ros_3d_bb.core.camera_clocks import ALIVE_NS, LONGEST_LAG_NS, CameraClocks
from ros_3d_bb.core.time_sync import NS

HOUR_NS = 3600 * NS


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


@pytest.mark.parametrize('leap_ns', [HOUR_NS, -8 * NS])
@pytest.mark.parametrize('now_ns,right', [(1, 'rear'), (ALIVE_NS, 'rear'), (ALIVE_NS + 1, None)])
def test_a_jump_is_rejected_while_the_other_camera_is_tracked(clocks, leap_ns, now_ns, right):
    assert accepted(clocks, 9 * NS + leap_ns, now_ns, 'front') == right


@pytest.mark.parametrize('ahead_ns,right', [(LONGEST_LAG_NS, None), (LONGEST_LAG_NS + 1, 'rear')])
def test_a_new_camera_has_the_correct_time_if_the_other_may_lag(ahead_ns, right):
    clocks = CameraClocks()
    assert accepted(clocks, 9 * NS, 0, 'rear') is None
    assert accepted(clocks, 9 * NS + ahead_ns, 0, 'front') == right


def test_a_duplicate_of_the_latest_tracked_stamp_is_rejected(clocks):
    with pytest.raises(ValueError, match='duplicate'):
        clocks.accept(9 * NS, 1, 'front')
    assert clocks.accept(9 * NS + 1, 2, 'front') is None
    assert clocks.accept(9 * NS + 1, 3, 'front') is None  # it was not tracked
