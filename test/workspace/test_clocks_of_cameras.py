import pytest

from ros_3d_bb.core.time_sync import NS
from support.two_cameras import Play

HOUR_NS = 3600 * NS
RECOVERY_NS = 2 * NS
PERIODS_NS = {'front': NS // 10, 'rear': NS // 8, 'left': NS // 5}
AHEAD, BACK = 'images ahead of other cameras', 'jumps back in time'


@pytest.fixture
def play():
    return Play('front', 'rear')


@pytest.mark.parametrize('goes_on', [True, False])
@pytest.mark.parametrize('ahead_ns', [HOUR_NS, 10 * NS, 3 * NS // 2])
def test_one_stamp_of_the_future_costs_the_other_camera_no_image(play, ahead_ns, goes_on):
    play.run(2)
    assert play.send('rear', ahead_ns) is None
    play.run(3, {'front', 'rear'} if goes_on else {'front'})
    assert play.lost('front') == 0 and play.lost('rear') == 1 and play.ids == [1]
    assert dict(play.counts, **{'images tracked': 0}) == {'images tracked': 0, AHEAD: 1}


@pytest.mark.parametrize('seconds', [0.5, 1.5, 10])
@pytest.mark.parametrize('others, bag_pauses', [({'front'}, False), ({'rear'}, False), (set(), False), (set(), True)])
def test_a_pause_of_a_camera_or_of_the_bag_costs_no_image(play, seconds, others, bag_pauses):
    """The other cameras continue meanwhile. If the bag is paused, stamps stand still."""
    play.run(2, count=0).run(seconds, others, count=0)
    play.ahead_ns -= int(seconds * NS) if bag_pauses else 0
    play.run(2, count=0)
    assert play.lost('front') + play.lost('rear') == 0 and set(play.counts) == {'images tracked'}


@pytest.mark.parametrize('ahead_ns', [HOUR_NS, 7 * NS // 10])
def test_a_single_camera_continues_after_one_stamp_of_the_future(ahead_ns):
    """By less than a second the next images are late, and refused for no longer than that."""
    play = Play('front')
    play.run(2)
    assert play.send('front', ahead_ns) is not None
    begun_ns = play.now_ns
    play.run(3)
    assert AHEAD not in play.counts and play.lost('front') == (0 if ahead_ns == HOUR_NS else 6)
    assert play.counts.get(BACK, 0) == (ahead_ns == HOUR_NS) and len(play.ids) == 1
    shown = [now_ns for now_ns, _camera, result in play.results if result and result.tracks and now_ns > begun_ns]
    assert min(shown) - begun_ns < NS // 2


def leaps_once(play, ahead_ns):
    rest = iter([ahead_ns])
    return lambda: next(rest, 0)


def stays_ahead(play, ahead_ns):
    return lambda: ahead_ns


def hangs(play, step_ns):
    """All stamps are the same, or differ by a step."""
    stamp_ns = play.now_ns + play.ahead_ns

    def ahead_ns():
        nonlocal stamp_ns
        stamp_ns += step_ns
        return stamp_ns - play.now_ns - play.ahead_ns
    return ahead_ns


def in_the_middle(play, fault, _seconds):
    play.run(2, count=0)
    play.faults['rear'] = fault()


def before_a_pause(play, fault, seconds):
    """No other camera sends for a while."""
    in_the_middle(play, fault, 0)
    play.run(2, count=0).run(seconds, {'rear'}, count=0)


def before_a_seek(play, fault, seconds):
    """Forward, or back as where a bag loops."""
    in_the_middle(play, fault, 0)
    play.run(2, count=0)
    play.ahead_ns += seconds * NS


FAULTS = [(leaps_once, HOUR_NS), (leaps_once, 3 * NS // 2), (stays_ahead, HOUR_NS), (stays_ahead, 3 * NS // 2),
          (stays_ahead, 4 * NS), (stays_ahead, -900 * NS), (stays_ahead, -6 * NS // 5), (stays_ahead, -3 * NS),
          (hangs, 0), (hangs, NS // 1000)]
TIMES = [(in_the_middle, 0), (before_a_pause, 1.5), (before_a_seek, 100), (before_a_seek, -100), (before_a_seek, -2)]


@pytest.mark.parametrize('fault,ahead_ns', FAULTS)
@pytest.mark.parametrize('when,seconds', TIMES)
@pytest.mark.parametrize('number', [2, 3])
def test_each_image_of_a_healthy_camera_is_tracked_again(fault, ahead_ns, when, seconds, number):
    play = Play(*('front', 'rear', 'left')[:number], periods_ns=PERIODS_NS)
    when(play, lambda: fault(play, ahead_ns), seconds)
    begun_ns = play.now_ns
    play.run(4, count=0)
    for camera in play.cameras - {'rear'}:
        assert play.lost(camera, begun_ns + RECOVERY_NS) == 0 < len(play.results)
