"""Parts of the nodes by themselves, at moments that no graph comes to at will: threads that meet, and a master that
takes connections and never answers.
"""
import contextlib
import socket
import threading
from unittest import mock

import numpy as np
import pytest
import rospy
from sensor_msgs.msg import Image
from std_msgs.msg import Header

from ros_3d_bb.camera.depth_image import DepthImage
from ros_3d_bb.nodes.bbox3d_node import SampleImages
from ros_3d_bb.nodes.common.diagnostics import Diagnostics
from ros_3d_bb.nodes.common.input_monitor import InputWatch, unheard
from ros_3d_bb.nodes.common.master import NO_ANSWER
from ros_3d_bb.nodes.common.subscribers import inputs, subscribe
from ros_3d_bb.nodes.common.topic_publishers import published_topics, publishers_of
from support.ros import wait_until

PATIENCE_S = 0.2


@pytest.fixture
def hanging_master(monkeypatch):
    """It takes connections, as the kernel of a machine does whose master hangs, and never answers."""
    with contextlib.closing(socket.socket()) as listener:
        listener.bind(('localhost', 0))
        listener.listen(10)
        monkeypatch.setenv('ROS_MASTER_URI', 'http://localhost:%d' % listener.getsockname()[1])
        monkeypatch.setattr('ros_3d_bb.nodes.common.master.PATIENCE_S', PATIENCE_S)
        yield


@pytest.mark.parametrize('ask', [published_topics, lambda: publishers_of('/camera/color/image_raw', False)])
def test_a_question_to_a_master_that_hangs_ends(hanging_master, ask):
    errors = []

    def asking():
        try:
            ask()
        except NO_ANSWER as error:
            errors.append(error)
    thread = threading.Thread(target=asking)
    thread.daemon = True
    thread.start()
    wait_until(lambda: errors, 'an end of the question')


def test_a_master_that_hangs_is_asked_once_for_all_silent_inputs():
    """Each question in vain takes two seconds, in which nothing comes on /diagnostics."""
    silent = [mock.Mock(came_s=None, count=0, lags_s=(None, None)) for _input in range(3)]
    for number, noted in enumerate(silent):
        noted.name, noted.subscriber.resolved_name = 'topic', '/topic%d' % number
    asked = mock.Mock(side_effect=socket.timeout('timed out'))
    with mock.patch('ros_3d_bb.nodes.common.input_monitor.inputs', lambda: silent), \
            mock.patch('ros_3d_bb.nodes.common.input_monitor.published_topics', asked), \
            mock.patch('ros_3d_bb.nodes.common.input_monitor.SILENT_S', -1.0), \
            mock.patch('rospy.get_rostime', lambda: rospy.Time(1)):
        watch = InputWatch()
        said = [sentence for _look in range(2) for _event, sentence in watch.faults()]
    assert asked.call_count == 1
    assert said == ['nothing comes on /topic%d, and the master does not answer (timed out)' % number
                    for number in range(3)] * 2


def test_3d_boxes_do_not_wait_for_a_master_to_subscribe_colour():
    """rospy.Subscriber would wait for one, under the node's lock."""
    with mock.patch('rospy.Publisher') as publisher, mock.patch('rospy.Subscriber') as subscriber, \
            mock.patch('ros_3d_bb.nodes.bbox3d_node.patient_master', side_effect=OSError('no route')) as master:
        publisher.return_value.get_num_connections.return_value = 1
        diagnostics, depth = mock.MagicMock(), DepthImage(np.zeros((4, 4), np.uint16), 0.001)
        images = SampleImages(10 ** 9, None, 6.0, diagnostics)
        images.publish(Header(), depth, [])
        wait_until(lambda: diagnostics.warn.called, 'a warning')
        assert 'no route' in diagnostics.warn.call_args[0][1] and not subscriber.called
        master.side_effect = None
        images.publish(Header(), depth, [])
        wait_until(lambda: subscriber.called, 'a subscription')


def test_the_diagnostics_go_on_after_a_report_that_could_not_be_made():
    with mock.patch('diagnostic_updater.Updater') as updater, mock.patch('rospy.logwarn') as said, \
            mock.patch('ros_3d_bb.nodes.common.diagnostics.PERIOD_S', 0.01):
        updater.return_value.force_update.side_effect = [ZeroDivisionError('by nothing')] + 1000 * [None]
        Diagnostics()
        wait_until(lambda: updater.return_value.force_update.call_count >= 3, 'another report')
    assert 'by nothing' in said.call_args[0][1]


def test_an_input_subscribed_while_others_are_looked_through_is_kept():
    """As colour is, when somebody begins to look, while the diagnostics look at the inputs."""
    threads = []

    class Inputs(list):
        """Whoever writes them back gives another thread the time to subscribe the second."""

        def __setitem__(self, index, value):
            if not threads:
                threads.append(threading.Thread(target=subscribe, args=('second', Image, None)))
                threads[0].start()
                threads[0].join(0.2)
            super(Inputs, self).__setitem__(index, value)
    with mock.patch('rospy.Subscriber'), mock.patch('ros_3d_bb.nodes.common.subscribers._inputs', Inputs()):
        subscribe('first', Image, None)
        inputs()
        threads[0].join()
        assert [noted.name for noted in inputs()] == ['first', 'second']


@pytest.mark.parametrize('tuned', ['/parameter_descriptions', '/parameter_updates'])
def test_what_tools_subscribe_for_tuning_is_no_result(tuned):
    """Else nobody would be told that nobody sees the tracks while rqt_reconfigure is open."""
    def publisher(connected):
        return mock.Mock(has_connections=lambda: connected)
    pubs = {'/ros_3d_bb/tracks': publisher(False), rospy.get_name() + tuned: publisher(True)}
    with mock.patch('ros_3d_bb.nodes.common.input_monitor.get_topic_manager') as manager:
        manager.return_value.pubs = pubs
        assert unheard() == ['/ros_3d_bb/tracks']
        pubs['/ros_3d_bb/tracks'] = publisher(True)
        assert unheard() == []
