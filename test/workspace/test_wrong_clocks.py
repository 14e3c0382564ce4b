"""Recovery of the other cameras when the clock of one camera is wrong, lags or hangs."""
import pytest

from ros_3d_bb.core.time_sync import NS
from support.two_cameras import Play

RECOVERY_NS = 2 * NS
PERIODS_NS = {'front': NS // 10, 'rear': NS // 8, 'left': NS // 5}
HOUR_NS = 3600 * NS


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


def from_the_start(play, fault, _seconds):
    play.faults['rear'] = fault()


def first(play, fault, seconds):
    """The other cameras start later."""
    play.faults['rear'] = fault()
    play.run(seconds, {'rear'}, count=0)


def in_the_middle(play, fault, _seconds):
    play.run(2, count=0)
    play.faults['rear'] = fault()


def before_a_pause(play, fault, seconds):
    """No other camera sends for a while."""
    in_the_middle(play, fault, 0)
    play.run(2, count=0).run(seconds, {'rear'}, count=0)


def before_a_respawn(play, fault, _seconds):
    in_the_middle(play, fault, 0)
    play.run(2, count=0).respawn()


def before_a_seek(play, fault, seconds):
    """Forward, or back as where a bag loops."""
    in_the_middle(play, fault, 0)
    play.run(2, count=0)
    play.ahead_ns += seconds * NS


FAULTS = [(leaps_once, HOUR_NS), (leaps_once, 3 * NS // 2), (stays_ahead, HOUR_NS), (stays_ahead, 3 * NS // 2),
          (stays_ahead, 4 * NS), (stays_ahead, -900 * NS), (stays_ahead, -6 * NS // 5), (stays_ahead, -3 * NS),
          (hangs, 0), (hangs, NS // 1000)]
TIMES = [(from_the_start, 0), (first, 2), (in_the_middle, 0), (before_a_pause, 1.2), (before_a_pause, 1.5),
         (before_a_pause, 3), (before_a_respawn, 0), (before_a_seek, 100), (before_a_seek, -100), (before_a_seek, -2)]


def is_decidable(fault, ahead_ns, when, number):
    """Where stamps differ from the first image on, the majority is right, or else the camera ahead by a moment."""
    if fault is not stays_ahead or when not in (from_the_start, first, before_a_respawn):
        return True
    return ahead_ns < 0 and ahead_ns > -60 * NS or abs(ahead_ns) > 60 * NS and number == 3


@pytest.mark.parametrize('fault,ahead_ns,when,seconds,number', [
    (fault, ahead_ns, when, seconds, number) for fault, ahead_ns in FAULTS for when, seconds in TIMES
    for number in (2, 3) if is_decidable(fault, ahead_ns, when, number)])
def test_each_image_of_a_healthy_camera_is_tracked_again(fault, ahead_ns, when, seconds, number):
    play = Play(*('front', 'rear', 'left')[:number], periods_ns=PERIODS_NS)
    when(play, lambda: fault(play, ahead_ns), seconds)
    begun_ns = play.now_ns
    play.run(4, count=0)
    for camera in play.cameras - {'rear'}:
        assert play.lost(camera, begun_ns + RECOVERY_NS) == 0 < len(play.results)


@pytest.mark.parametrize('fault,ahead_ns', [(stays_ahead, -6 * NS // 5), (stays_ahead, -3 * NS), (hangs, 0)])
def test_a_camera_that_lags_or_hangs_ends_no_track_while_the_other_pauses(fault, ahead_ns):
    play = Play('front', 'rear')
    play.faults['rear'] = fault(play, ahead_ns)
    play.run(3).run(1.5, {'rear'}, count=0).run(1)
    assert play.lost('front') == 0 == play.counts.get('jumps back in time', 0) and play.ids == [1]
