import pytest

from ros_3d_bb.core.senders import Senders
from ros_3d_bb.core.time_jumps import SETTLING_S, TimeJumps
from ros_3d_bb.core.time_sync import NS


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
