"""Parts of the nodes in situations that a graph cannot produce: late transforms, masters and detectors that hang."""
import contextlib
import socket
from types import SimpleNamespace
from unittest import mock

import pytest
import rospy
import tf2_ros
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header
from std_srvs.srv import SetBoolRequest
from tf2_msgs.msg import TFMessage

from ros_3d_bb.camera.camera_model import transform_from
from ros_3d_bb.conversions.camera_msgs import transform_messages
from ros_3d_bb.core.event_counter import EventCounter
from ros_3d_bb.nodes.common import master, startup, subscribers
from ros_3d_bb.nodes.common.detector_output import DetectorWorker
from ros_3d_bb.nodes.common.diagnostics import Diagnostics
from ros_3d_bb.nodes.common.startup import Part
from ros_3d_bb.nodes.common.tf_lookup import Transforms
from support.masterless import masterless
from support.ros import header_at, wait_until

IMAGE = Image(header=header_at(1000))


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


@pytest.mark.parametrize('subscribe, kind, before, count', [
    (lambda: subscribers.subscribe('once', OccupancyGrid, str, is_irregular=True), OccupancyGrid, [], 0),
    (lambda: subscribers.subscribe_camera_info('once', 'image', str), CameraInfo, [('silence on once', 'silent')], 1)])
def test_what_is_published_once_is_no_silent_input(subscribe, kind, before, count):
    """Nor does its stamp show that clocks differ. Only a camera_info is awaited. Without a publisher, a map is missing
    if it has not arrived, and a camera_info in any case, for a node that is restarted."""
    with mock.patch('rospy.Subscriber') as subscriber, mock.patch.object(subscribers, '_inputs', []) as inputs, \
            mock.patch.object(subscribers, '_cause_of_silence', return_value='silent'), \
            mock.patch('rospy.get_rostime', lambda: rospy.Time(1000)):
        subscriber().impl.connections = [mock.Mock()]
        subscribe()
        monitor = subscribers.InputMonitor()
        monitor._began_s = -100.0
        assert list(monitor.faults()) == before
        inputs[0].take(kind(header=Header(stamp=rospy.Time(100))))
        assert not list(monitor.faults())
        inputs[0].received_s = -100.0
        assert not list(monitor.faults())
        inputs[0].count, subscriber().impl.connections[0].socket = count, None  # as rospy 1.15
        assert list(monitor.faults()) == [('silence on once', 'silent')]


@pytest.fixture
def now_s():
    seconds = [1000.0]
    with mock.patch('time.monotonic', lambda: seconds[0]):
        yield seconds


@pytest.fixture
def rig(now_s):
    """The worker, its service, and the state and faults that it reports. Its detector never completes."""
    diagnostics, path = EventCounter(), 'ros_3d_bb.nodes.common.detector_output.'
    diagnostics.show, diagnostics.check = mock.Mock(), mock.Mock()
    with mock.patch(path + 'rospy') as rospy, mock.patch(path + 'NewestWorker'):
        worker = DetectorWorker(SimpleNamespace(enabled=True, publish_empty=True), diagnostics, None, (), Part())
    yield SimpleNamespace(offer=worker.offer, enable=rospy.Service.call_args[0][2],
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


STAMP = rospy.Time(100)


@pytest.fixture
def tf():
    with masterless() as connections:
        yield SimpleNamespace(connections=connections, transforms=Transforms(wait_s=0.0),
                              send=lambda *links: connections.send('/tf', TFMessage(list(links))))


def link(parent, child, stamp=STAMP, x_m=0.0):
    message, = transform_messages(stamp, [(parent, child, transform_from((x_m, 0, 0), (0, 0, 0, 1)))])
    return message


def test_the_transform_is_that_of_the_stamp(tf):
    """The robot drives on while an image waits for its boxes."""
    for number in range(2):
        tf.send(link('map', 'base_link', STAMP + rospy.Duration(number), number))
    assert tf.transforms.lookup('map', 'base_link', STAMP + rospy.Duration(0.5))[0, 3] == 0.5


def test_the_missing_frame_of_each_camera_is_named(tf):
    tf.send(link('map', 'base_link'))
    for camera in 2 * ('front', 'rear'):
        with pytest.raises(tf2_ros.TransformException, match='tf has no frame %s;' % camera):
            tf.transforms.lookup('map', camera, STAMP)


def test_a_transform_of_the_future_does_not_stop_the_latest_pose(tf):
    for number in range(30):
        tf.connections.now = stamp = STAMP + rospy.Duration(number * 0.1)
        if number == 10:
            later = stamp + rospy.Duration(3600)
            tf.send(link('map', 'odom', later), link('odom', 'base_link', later))
        tf.send(link('map', 'odom', stamp), link('odom', 'base_link', stamp, number))
        if number < 10 or number >= 12:
            assert tf.transforms.latest('map', 'base_link', 0.5)[0][0, 3] == number


@pytest.mark.parametrize('in_flight_s', [0.05, 5.9])
def test_a_transform_from_before_a_jump_back_that_arrives_late_is_not_the_latest(tf, in_flight_s):
    """As at each restart of a bag that is shorter than the cache of tf2, which would keep it until the next one."""
    tf.connections.now = STAMP + rospy.Duration(5.9)
    tf.send(link('map', 'base_link', tf.connections.now))
    tf.connections.now = STAMP
    tf.send(link('map', 'base_link', STAMP + rospy.Duration(in_flight_s)))
    for number in range(30):
        tf.connections.now = stamp = STAMP + rospy.Duration(number * 0.1)
        tf.send(link('map', 'base_link', stamp, number))
        if number:
            assert tf.transforms.latest('map', 'base_link', 0.5)[0][0, 3] == number


@pytest.mark.parametrize('back_s, is_kept', [(0.02, True), (0.9, True), (3.0, False)])
def test_transforms_are_kept_when_time_goes_back_by_less_than_a_jump(tf, back_s, is_kept):
    """As with each message of a second publisher of /clock, such as a bag that was recorded with all topics."""
    tf.connections.now = STAMP
    tf.send(link('map', 'front'))
    tf.connections.now = STAMP - rospy.Duration(back_s)
    tf.send(link('map', 'rear'))
    assert bool(tf.transforms.can_transform_core('map', 'front', STAMP)[0]) is is_kept


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
