"""Parts of the nodes in situations that a graph cannot produce: threads, and masters and detectors that hang."""
import contextlib
import socket
import threading
from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest
import rospy
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header
from std_srvs.srv import SetBoolRequest

from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.core.event_counter import EventCounter
from ros_3d_bb.nodes.bbox3d_node import SampleImages
from ros_3d_bb.nodes.common import master, startup, subscribers
from ros_3d_bb.nodes.common.detector_output import DetectorWorker
from ros_3d_bb.nodes.common.diagnostics import Diagnostics
from ros_3d_bb.nodes.common.startup import Part
from ros_3d_bb.pipeline.estimation_stage import Bbox3dParams
from ros_3d_bb.nodes.tracker_node import RESERVED_IDS, TrackIdReservation
from support.ros import header_at, wait_until

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
            as mocked, mock.patch.object(startup, 'cache_logging_parameter'), pytest.raises(SystemExit):
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


def test_a_master_that_hangs_is_queried_once_for_all_silent_inputs():
    """Each failed query takes two seconds, in which nothing is published on /diagnostics."""
    silent = [subscribers.Input('topic', Image) for _input in range(3)]
    for number, each in enumerate(silent):
        each.subscriber = mock.Mock(resolved_name='/topic%d' % number)
    query = mock.Mock(side_effect=socket.timeout('timed out'))
    with mock.patch.multiple(subscribers, _inputs=silent, published_topics=query, SILENT_S=-1.0), \
            mock.patch('rospy.get_rostime', lambda: rospy.Time(1)):
        monitor = subscribers.InputMonitor()
        sentences = [sentence for _check in range(2) for _event, sentence in monitor.faults()]
    assert query.call_count == 1
    assert sentences == ['no messages on /topic%d, and the master does not respond (timed out)' % number
                         for number in range(3)] * 2


def test_3d_boxes_do_not_wait_for_a_master_to_subscribe_colour():
    """rospy.Subscriber would wait for one, under the node's lock."""
    with mock.patch('rospy.Publisher') as publisher, mock.patch('rospy.Subscriber') as subscriber, \
            mock.patch('ros_3d_bb.nodes.bbox3d_node.patient_master', side_effect=OSError('no route')) as query:
        publisher.return_value.get_num_connections.return_value = 1
        diagnostics = mock.MagicMock()
        depth = DepthImage(np.zeros((4, 4), np.uint16), 0.001)
        images = SampleImages(Bbox3dParams(), None, diagnostics)
        images.publish(Header(), depth, [])
        wait_until(lambda: diagnostics.warn.called, 'a warning')
        assert 'no route' in diagnostics.warn.call_args[0][1] and not subscriber.called
        query.side_effect = None
        images.publish(Header(), depth, [])
        wait_until(lambda: subscriber.called, 'a subscription')


def test_the_diagnostics_continue_after_a_failed_report():
    path = 'ros_3d_bb.nodes.common.diagnostics.'
    with mock.patch('rospy.Publisher') as publisher, mock.patch('rospy.logwarn') as log, \
            mock.patch('rospy.get_rostime', return_value=rospy.Time(1)), mock.patch(path + 'PERIOD_S', 0.01):
        publish = publisher.return_value.publish
        publish.side_effect = [ZeroDivisionError('by nothing')] + 1000 * [None]

        def reported(name):
            return [shown.value for call in publish.call_args_list for shown in call[0][0].status[0].values
                    if shown.key == name]
        Diagnostics().record_latency(rospy.Time(0, 200000000))
        wait_until(lambda: publish.call_count >= 3 and reported('latency'), 'another report')
    assert reported('latency')[0].startswith('mean 800.0 ms')
    assert 'by nothing' in log.call_args[0][1]
    status, = publish.call_args[0][0].status
    assert (status.name, status.message) == (rospy.get_name()[1:] + ': pipeline', 'no input yet')


def test_an_input_subscribed_while_the_others_are_listed_is_kept():
    """As colour is, when a subscriber of the debug images connects while the diagnostics check the inputs."""
    threads = []

    class Inputs(list):
        """Gives another thread the time to subscribe, whenever the list is written back."""

        def __setitem__(self, index, value):
            if not threads:
                threads.append(threading.Thread(target=subscribers.subscribe, args=('second', Image, None)))
                threads[0].start()
                threads[0].join(0.2)
            super(Inputs, self).__setitem__(index, value)
    with mock.patch('rospy.Subscriber'), mock.patch.object(subscribers, '_inputs', Inputs()):
        subscribers.subscribe('first', Image, None)
        subscribers.inputs()
        threads[0].join()
        assert [each.name for each in subscribers.inputs()] == ['first', 'second']


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


def test_a_detector_without_images_is_not_reported(rig, now_s):
    """After a pause of the camera, the first image is still being processed."""
    now_s[0] += 60
    rig.offer(IMAGE)
    assert rig.faults() == []
    rig.work((IMAGE,))
    now_s[0] += 60
    rig.offer(IMAGE)
    now_s[0] += 1
    assert rig.faults() == []


def test_a_rejected_image_is_a_completed_detection(rig):
    for _image in range(10):
        rig.offer(UNUSABLE)
        rig.work((UNUSABLE,))
        assert rig.faults() == []
