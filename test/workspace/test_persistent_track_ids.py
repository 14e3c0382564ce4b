"""Numbers of tracks over several lives of the tracker, with a dictionary for the parameter server."""
import numpy as np
import pytest

from ros_3d_bb.core.event_counter import EventCounter
from ros_3d_bb.nodes.common.persistent_track_ids import RESERVED, PersistentTrackIds
from ros_3d_bb.tracking.thesis_tracker import ThesisTracker
from ros_3d_bb.tracking.types import Detection

TRACK, = ThesisTracker().update(0, [Detection(np.zeros(3), np.ones(3))])
NAME = '/tracker_node_numbers'


@pytest.fixture
def parameters(monkeypatch):
    """The parameters; 'fails' among them lets the master refuse new ones."""
    parameters = {}

    def set_param(name, value):
        if 'fails' in parameters:
            raise ConnectionRefusedError(111, 'Connection refused')
        parameters[name] = value
    monkeypatch.setattr('rospy.get_name', lambda: '/tracker_node')
    monkeypatch.setattr('rospy.get_param', lambda name, default: parameters.get(name, default))
    monkeypatch.setattr('rospy.set_param', set_param)
    monkeypatch.setattr('ros_3d_bb.nodes.common.persistent_track_ids.on_new_master', lambda _function: None)
    monkeypatch.setattr('ros_3d_bb.nodes.common.persistent_track_ids.NewestWorker', Immediately)
    return parameters


class Immediately(object):
    """In place of the thread."""

    def __init__(self, work, on_error):
        self._work, self._on_error = work, on_error

    def offer(self, item):
        try:
            self._work(item)
        except OSError as error:
            self._on_error(error)


def given(numbers, *ids):
    """The numbers of tracks to which a tracker gave some."""
    tracks = [TRACK._replace(id=number) for number in ids]
    return [track.id for track in numbers.assign(tracks)]


def test_a_tracker_that_is_started_again_goes_on_with_the_next_thousand(parameters):
    assert given(PersistentTrackIds(EventCounter()), 1, 2, 7) == [1, 2, 7]
    assert given(PersistentTrackIds(EventCounter()), 1, 2) == [RESERVED + 1, RESERVED + 2]


def test_whatever_it_has_given_is_below_what_the_next_one_gives(parameters):
    """As many as there are, for each of five lives."""
    largest = 0
    for life in range(5):
        numbers = PersistentTrackIds(EventCounter())
        for number in range(1, 700 * (life + 1), 100):
            first, = given(numbers, number)
            assert first > largest
        largest = first
        assert parameters[NAME] > largest


def test_without_the_master_numbers_go_on_and_it_is_said(parameters):
    events = EventCounter()
    numbers = PersistentTrackIds(events)
    parameters['fails'] = True
    assert given(numbers, 5 * RESERVED) == [5 * RESERVED]
    assert 'Connection refused' in events.sentences['numbers not reserved'] and NAME in events.sentences[
        'numbers not reserved']
    del parameters['fails']
    given(numbers, 5 * RESERVED + 1)
    assert parameters[NAME] == 6 * RESERVED + 1


@pytest.mark.parametrize('value', ['many', -1, 1.5, True, 2 ** 31 - 1])
def test_a_parameter_of_somebody_else_is_refused(parameters, value):
    parameters[NAME] = value
    with pytest.raises(ValueError, match=NAME):
        PersistentTrackIds(EventCounter())
