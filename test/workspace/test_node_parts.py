"""Parts of the nodes in situations that a graph cannot produce: threads, and masters and detectors that hang."""
import contextlib
import socket
from types import SimpleNamespace
from unittest import mock

import pytest
import rospy
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header
from std_srvs.srv import SetBoolRequest

from ros_3d_bb.core.event_counter import EventCounter
from ros_3d_bb.nodes.common import master, startup, subscribers
from ros_3d_bb.nodes.common.detector_output import DetectorWorker
from ros_3d_bb.nodes.common.startup import Part
from support.ros import header_at

IMAGE, UNUSABLE = Image(header=header_at(1000)), Image(header=header_at(1000))


@pytest.mark.parametrize('name, parts, fault, place', [
    ('bbox3d_node', (), 'parameter ~stride is 0', '~stride: launch argument bbox3d_params:=FILE'),
    ('people_node', ('tracker_node', 'bbox3d_node'), '~stride is 0', '~stride: launch argument bbox3d_params:=FILE'),
    ('detector_node', (), 'no ~weights given', '~weights: launch argument weights:='),
    ('bbox3d_node', (), 'no ~frame_id', '~frame_id: launch argument frame_id:='),
    ('doctor', (), '~weights', '~weights')])
def test_a_node_that_cannot_start_names_the_launch_argument(name, parts, fault, place):
    def node():
        raise ValueError(fault)
    stored = {'/bbox3d_node': {'stride': 0}, '/tracker_node': {}, '/detector_node': {'weights': ''}}
    with mock.patch.multiple(rospy, init_node=mock.DEFAULT, logfatal=mock.DEFAULT, get_name=lambda: '/' + name,
                             resolve_name=lambda each: '/' + each, get_param=lambda each, _none: stored[each]) \
            as mocked, mock.patch.object(startup, 'Registration'), pytest.raises(SystemExit):
        startup.run_node(name, node, parts=parts)
    text, *values = mocked['logfatal'].call_args[0]
    printed = text % tuple(values)
    assert place in printed and printed.count('launch argument') == place.count('launch argument')


def test_a_request_to_a_master_that_hangs_ends(monkeypatch):
    """The kernel of a machine whose master hangs accepts connections."""
    with contextlib.closing(socket.socket()) as listener:
        listener.bind(('localhost', 0))
        listener.listen(10)
        monkeypatch.setenv('ROS_MASTER_URI', 'http://localhost:%d' % listener.getsockname()[1])
        monkeypatch.setattr(master, 'TIMEOUT_S', 0.2)
        with pytest.raises(socket.timeout):
            master.published_topics()


@pytest.mark.parametrize('subscribe, kind, before, count', [
    (lambda: subscribers.subscribe('once', OccupancyGrid, str, is_irregular=True), OccupancyGrid, [], 0),
    (lambda: subscribers.subscribe_camera_info('once', 'image', str), CameraInfo, [('silence on once', 'silent')], 1)])
def test_what_is_published_once_is_no_silent_input(subscribe, kind, before, count):
    """Nor does its stamp show that clocks differ. Only a camera_info is awaited. Without a publisher, a map is missing
    if it has not arrived, and a camera_info in any case, for a node that is restarted."""
    with mock.patch('rospy.Subscriber') as subscriber, mock.patch.object(subscribers, '_inputs', []) as inputs, \
            mock.patch.object(subscribers, '_cause_of_silence', return_value='silent'), \
            mock.patch('rospy.get_rostime', lambda: rospy.Time(1000)):
        subscriber().get_num_connections.return_value = 1
        subscribe()
        monitor = subscribers.InputMonitor()
        monitor._began_s = -100.0
        assert list(monitor.faults()) == before
        inputs[0].take(kind(header=Header(stamp=rospy.Time(100))))
        assert not list(monitor.faults())
        inputs[0].received_s = -100.0
        assert not list(monitor.faults())
        inputs[0].count, subscriber().get_num_connections.return_value = count, 0
        assert list(monitor.faults()) == [('silence on once', 'silent')]


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
        if image is UNUSABLE:
            raise ValueError('an unusable image')

    diagnostics, path = EventCounter(), 'ros_3d_bb.nodes.common.detector_output.'
    diagnostics.show, diagnostics.check = mock.Mock(), mock.Mock()
    with mock.patch(path + 'rospy') as rospy, mock.patch(path + 'NewestWorker') as thread:
        worker = DetectorWorker(SimpleNamespace(enabled=True, publish_empty=True), diagnostics, detect, (), Part())
    yield SimpleNamespace(offer=worker.offer, enable=rospy.Service.call_args[0][2], work=thread.call_args[0][0],
                          state=dict(call[0] for call in diagnostics.show.call_args_list)['detector'],
                          faults=lambda: list(diagnostics.check.call_args[0][0]()))


def test_a_detector_that_hangs_is_reported_unless_it_is_paused(rig, now_s):
    rig.offer(IMAGE)
    now_s[0] += 4
    rig.offer(IMAGE)  # images continue
    assert rig.faults() == [] and rig.state() == 'working'
    now_s[0] += 2
    (event, sentence), = rig.faults()
    assert event == 'detector hangs' and '6 s' in sentence
    rig.enable(SetBoolRequest(False))
    now_s[0] += 60
    assert rig.faults() == [] and rig.state() == 'paused'
    rig.enable(SetBoolRequest(True))
    assert rig.faults() == []
