"""When a detector is said to be silent, without a master."""
from unittest import mock

import pytest
from std_srvs.srv import SetBoolRequest

from ros_3d_bb.nodes.common.detector_output import Switch


class Noting(object):
    """In place of Diagnostics: keeps what it is to show and to check."""

    def show(self, _name, text):
        self.text = text

    def check(self, faults):
        self.faults = faults


@pytest.fixture
def switch():
    """A detector's switch, what it shows and checks, the clock of the machine as [seconds], and its service."""
    diagnostics, now_s = Noting(), [1000.0]
    with mock.patch('time.monotonic', lambda: now_s[0]), mock.patch('rospy.Service') as service:
        switch = Switch(True, diagnostics)
        yield switch, diagnostics, now_s, service.call_args[0][2]


def test_a_detector_whose_search_does_not_end_is_silent_unless_it_is_paused(switch):
    switch, diagnostics, now_s, enable = switch
    switch.offered()
    now_s[0] += 4
    switch.offered()  # images go on
    assert list(diagnostics.faults()) == [] and diagnostics.text() == 'working'
    now_s[0] += 2
    (event, sentence), = diagnostics.faults()
    assert event == 'detector hangs' and 'for 6 s' in sentence
    enable(SetBoolRequest(False))
    now_s[0] += 60
    assert list(diagnostics.faults()) == [] and diagnostics.text() == 'paused'
    enable(SetBoolRequest(True))
    assert list(diagnostics.faults()) == []


def test_a_detector_is_not_silent_where_it_had_nothing_to_search(switch):
    """After a pause of the camera the first image is on its way through the detector."""
    switch, diagnostics, now_s, _enable = switch
    now_s[0] += 60
    switch.offered()
    assert list(diagnostics.faults()) == []
    with switch.detecting():
        now_s[0] += 1
    now_s[0] += 60
    switch.offered()
    now_s[0] += 1
    assert list(diagnostics.faults()) == []


def test_a_refused_image_is_an_answer(switch):
    switch, diagnostics, now_s, _enable = switch
    for _image in range(10):
        switch.offered()
        with pytest.raises(ValueError), switch.detecting():
            raise ValueError('an image that cannot be used')
        now_s[0] += 1
        assert list(diagnostics.faults()) == []
