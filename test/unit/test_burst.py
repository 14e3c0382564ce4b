"""Countdown and burst of measurements."""
from ros_3d_bb.sessions.burst import Burst


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


def test_a_burst_can_be_cancelled_and_started_again():
    burst = Burst(5.0, 3, 1.0)
    burst.toggle(0.0)
    burst.toggle(2.0)
    assert not burst.is_due(6.0)
    burst.toggle(10.0)
    assert burst.is_due(15.0)
