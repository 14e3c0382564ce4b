"""Backward jumps in time of one of several cameras, or of all, without a master."""
import pytest

from ros_3d_bb.conversions.perception_msgs import stamp_of
from ros_3d_bb.core.time_sync import NS
from support.two_cameras import PERIOD_NS, START_NS, Rig


@pytest.fixture
def rig():
    return Rig('front', 'rear')


def test_time_jumps_back_once_if_all_cameras_do(rig):
    """A bag loops; the rear camera's detector takes longer. Tracks begin once more, and once only."""
    def send(number, camera):
        rig.now_ns = number * PERIOD_NS
        return rig.send(START_NS + number % 200 * PERIOD_NS, camera)
    for number in range(200):
        assert send(number, 'front') and (number < 3 or send(number - 3, 'rear'))
    for number in range(200, 220):
        front, rear = send(number, 'front'), send(number - 3, 'rear')
        assert rear and (front is None) == (number <= 203)
    assert rig.events.counts['jumps back in time'] == 1 and rig.events.counts['images behind other cameras'] == 4
    assert [track.id for track in front.tracks] == [2] and stamp_of(rear) == START_NS + 19 * PERIOD_NS


def test_time_jumps_back_twice(rig):
    """Two seeks in a bag before the rear camera's detector is ready."""
    for number in range(200):
        for camera in ('front', 'rear'):
            rig.send(START_NS + number * PERIOD_NS, camera)
    for seconds in (10, 5):
        assert rig.send(START_NS + seconds * NS, 'front') is None
    for camera in ('rear', 'front'):
        assert rig.send(START_NS + 5 * NS + PERIOD_NS, camera) is not None


def test_image_awaiting_its_transform_is_dropped_when_time_goes_back(rig):
    """The front camera's first image of the new time comes in the rear camera's wait; the rear camera ends there."""
    for number in range(200):
        rig.send(START_NS + number * PERIOD_NS, 'front')
    rig.transforms.while_waiting['rear'] = lambda: rig.send(START_NS, 'front')
    assert rig.send(START_NS + 200 * PERIOD_NS, 'rear') is None
    for number in range(1, 20):
        front = rig.send(START_NS + number * PERIOD_NS, 'front')
    assert rig.events.counts['jumps back in time'] == 1 and rig.events.counts['images behind other cameras'] == 1
    assert [track.id for track in front.tracks] == [2]
