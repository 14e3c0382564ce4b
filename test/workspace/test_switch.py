"""When a detector is reported to hang, without a master."""
from types import SimpleNamespace
from unittest import mock

import pytest
from std_srvs.srv import SetBoolRequest

from ros_3d_bb.core.event_counter import EventCounter
from ros_3d_bb.nodes.common.detector_output import DetectorWorker
from ros_3d_bb.nodes.common.part import Part


@pytest.fixture
def now_s():
    """The clock of the machine, as [seconds]."""
    seconds = [1000.0]
    with mock.patch('time.monotonic', lambda: seconds[0]):
        yield seconds


@pytest.fixture
def rig(now_s):
    """The worker, its service, the state and faults that it reports, and its detector, which takes a second."""
    def detect(image):
        now_s[0] += 1
        if image == 'unusable':
            raise ValueError('an unusable image')

    diagnostics, path = EventCounter(), 'ros_3d_bb.nodes.common.detector_output.'
    diagnostics.show, diagnostics.check = mock.Mock(), mock.Mock()
    with mock.patch(path + 'rospy') as rospy, mock.patch(path + 'NewestWorker') as thread:
        worker = DetectorWorker(SimpleNamespace(enabled=True, publish_empty=True), diagnostics, detect, (), Part())
    yield SimpleNamespace(offer=worker.offer, enable=rospy.Service.call_args[0][2], work=thread.call_args[0][0],
                          state=diagnostics.show.call_args[0][1],
                          faults=lambda: list(diagnostics.check.call_args[0][0]()))


def test_a_detector_that_hangs_is_reported_unless_it_is_paused(rig, now_s):
    rig.offer('image')
    now_s[0] += 4
    rig.offer('image')  # images continue
    assert rig.faults() == [] and rig.state() == 'working'
    now_s[0] += 2
    (event, sentence), = rig.faults()
    assert event == 'detector hangs' and '6 s' in sentence
    rig.enable(SetBoolRequest(False))
    now_s[0] += 60
    assert rig.faults() == [] and rig.state() == 'paused'
    rig.enable(SetBoolRequest(True))
    assert rig.faults() == []


def test_a_detector_without_images_is_not_reported(rig, now_s):
    """After a pause of the camera, the first image is still being processed."""
    now_s[0] += 60
    rig.offer('image')
    assert rig.faults() == []
    rig.work(('image',))
    now_s[0] += 60
    rig.offer('image')
    now_s[0] += 1
    assert rig.faults() == []


def test_a_rejected_image_is_a_completed_detection(rig):
    for _image in range(10):
        rig.offer('unusable')
        rig.work(('unusable',))
        assert rig.faults() == []
