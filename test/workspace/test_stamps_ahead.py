"""Stamps of the future from one of several cameras, without a master: which images of the others are lost."""
import pytest

from ros_3d_bb.core.time_sync import NS
from support.two_cameras import Play

HOUR_NS, MS = 3600 * NS, NS // 1000
AHEAD, BEHIND, BACK = 'images ahead of other cameras', 'images behind other cameras', 'jumps back in time'


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


@pytest.mark.parametrize('seconds', [2, 100, 3600])
def test_a_forward_seek_costs_one_image(play, seconds):
    """The camera that is first after the seek loses it."""
    play.run(3)
    play.ahead_ns += seconds * NS
    play.run(3)
    assert play.counts[AHEAD] == 1 == play.lost('front') + play.lost('rear') and BACK not in play.counts


@pytest.mark.parametrize('seconds', [0.5, 1.5, 10])
@pytest.mark.parametrize('others, bag_pauses', [({'front'}, False), ({'rear'}, False), (set(), False), (set(), True)])
def test_a_pause_of_a_camera_or_of_the_bag_costs_no_image(play, seconds, others, bag_pauses):
    """The other cameras continue meanwhile. If the bag is paused, stamps stand still."""
    play.run(2, count=0).run(seconds, others, count=0)
    play.ahead_ns -= int(seconds * NS) if bag_pauses else 0
    play.run(2, count=0)
    assert play.lost('front') + play.lost('rear') == 0 and set(play.counts) == {'images tracked'}


def test_a_camera_without_a_transform_neither_loses_nor_costs_images(play):
    play.transforms.missing.add('rear')
    play.run(3)
    play.send('rear', HOUR_NS)
    play.run(3)
    play.transforms.missing.clear()
    begun_ns = play.now_ns
    play.run(3)
    assert play.lost('front') == 0 and play.lost('rear', begun_ns) == 0


@pytest.mark.parametrize('ahead_ns', [HOUR_NS, 700 * MS])
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
