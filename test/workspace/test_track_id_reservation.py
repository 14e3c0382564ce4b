"""Track IDs over several lives of tracker_node, with a dictionary for the parameter server."""
from unittest import mock

import pytest

from ros_3d_bb.core.event_counter import EventCounter
from ros_3d_bb.nodes.tracker_node import RESERVED_IDS, TrackIdReservation

NAME = '/tracker_node_numbers'


def immediately(work, on_error):
    """In place of the worker thread."""
    def offer(item):
        try:
            work(item)
        except OSError as error:
            on_error(error)
    return mock.Mock(offer=offer)


@pytest.fixture
def parameters(monkeypatch):
    """The parameters; if 'fails' is among them, the master accepts no others."""
    parameters = {}

    def set_param(name, value):
        if 'fails' in parameters:
            raise ConnectionRefusedError(111, 'Connection refused')
        parameters[name] = value
    monkeypatch.setattr('rospy.get_name', lambda: '/tracker_node')
    monkeypatch.setattr('rospy.get_param', lambda name, default: parameters.get(name, default))
    monkeypatch.setattr('rospy.set_param', set_param)
    monkeypatch.setattr('ros_3d_bb.nodes.tracker_node.on_new_master', lambda _function: None)
    monkeypatch.setattr('ros_3d_bb.nodes.tracker_node.NewestWorker', immediately)
    return parameters


def test_a_restarted_tracker_continues_after_all_ids_assigned_before(parameters):
    largest = 0
    for life in range(5):
        reservation = TrackIdReservation(EventCounter())
        assert reservation.last_id >= largest and parameters[NAME] == reservation.last_id + RESERVED_IDS
        for number in range(1, 700 * (life + 1), 100):
            largest = reservation.last_id + number
            reservation.reserve([mock.Mock(id=largest)])
            assert parameters[NAME] > largest


def test_ids_continue_without_the_master_and_the_fault_is_reported(parameters):
    events = EventCounter()
    reservation = TrackIdReservation(events)
    parameters['fails'] = True
    reservation.reserve([mock.Mock(id=5 * RESERVED_IDS)])
    assert NAME in events.sentences['track IDs not reserved']
    del parameters['fails']
    reservation.reserve([mock.Mock(id=5 * RESERVED_IDS + 1)])
    assert parameters[NAME] == 6 * RESERVED_IDS + 1


@pytest.mark.parametrize('value', ['many', -1, 1.5, True, 2 ** 31 - 1])
def test_an_invalid_parameter_is_rejected(parameters, value):
    parameters[NAME] = value
    with pytest.raises(ValueError, match=NAME):
        TrackIdReservation(EventCounter())
