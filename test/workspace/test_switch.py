"""When the switch of a detector reports it as silent, without a master."""
from unittest import mock

import pytest
from std_srvs.srv import SetBoolRequest

from ros_3d_bb.nodes.common.detector_output import Switch


@pytest.fixture
def now_s():
    """The clock of the machine, as [seconds]."""
    seconds = [1000.0]
    with mock.patch('time.monotonic', lambda: seconds[0]):
        yield seconds


@pytest.fixture
def rig(now_s):
    """A switch, its service, and the state and faults that it reports."""
    with mock.patch('rospy.Service') as service:
        diagnostics = mock.Mock()
        switch = Switch(True, diagnostics)
    return switch, service.call_args[0][2], diagnostics.show.call_args[0][1], diagnostics.check.call_args[0][0]


def test_a_detector_that_hangs_is_silent_unless_it_is_paused(rig, now_s):
    switch, enable, state, faults = rig
    switch.offered()
    now_s[0] += 4
    switch.offered()  # images continue
    assert list(faults()) == [] and state() == 'working'
    now_s[0] += 2
    (event, sentence), = faults()
    assert event == 'detector hangs' and '6 s' in sentence
    enable(SetBoolRequest(False))
    now_s[0] += 60
    assert list(faults()) == [] and state() == 'paused'
    enable(SetBoolRequest(True))
    assert list(faults()) == []


def test_a_detector_without_images_is_not_silent(rig, now_s):
    """After a pause of the camera, the first image is still being processed."""
    switch, _enable, _state, faults = rig
    now_s[0] += 60
    switch.offered()
    assert list(faults()) == []
    with switch.detecting():
        now_s[0] += 1
    now_s[0] += 60
    switch.offered()
    now_s[0] += 1
    assert list(faults()) == []


def test_a_rejected_image_is_an_answer(rig, now_s):
    switch, _enable, _state, faults = rig
    for _image in range(10):
        switch.offered()
        with pytest.raises(ValueError), switch.detecting():
            raise ValueError('an unusable image')
        now_s[0] += 1
        assert list(faults()) == []
