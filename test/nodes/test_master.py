"""The whole pipeline while the ROS master is killed and restarted. The test starts a master of its own for that."""
import contextlib
import os
import signal
import subprocess
import time
from unittest import mock

import pytest
import rosgraph
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from dynamic_reconfigure.client import Client
from sensor_msgs.msg import CameraInfo
from std_srvs.srv import Trigger

from ros_3d_bb.conversions.camera_msgs import INFO_TOPICS
from ros_3d_bb.msg import TrackedObjectArray
from ros_3d_bb.nodes.common.master import Registration, on_new_master
from ros_3d_bb.nodes.viewer_node import Label
from ros_3d_bb.sessions.session_reader import read_session
from ros_3d_bb_lab.evaluation.launching import free_port
from ros_3d_bb_lab.evaluation.latency.latency_probe_node import pid_of
from support.processes import killed_and_back
from support.ros import TIMEOUT_S, Recorder, launched, wait_until
from support.stage import RECOVERY_IMAGES, Stage

NODES = '/people_node', '/planner_bridge_node'


@pytest.fixture(scope='session', autouse=True)
def ros_node():
    """Without the master of rostest."""


@contextlib.contextmanager
def master(port):
    process = subprocess.Popen(['rosmaster', '--core', '-p', str(port)])
    try:
        wait_until(rosgraph.is_master_online, 'a master')
        yield process
    finally:
        process.kill()
        process.wait()


def set_label(label):
    rosgraph.Master('/somebody').setParam('/test_master/label', label)


def wait_for_reports(recorder, node, count):
    begin = len(recorder.messages)
    wait_until(lambda: count <= sum(status.name.startswith(node) for message in recorder.messages[begin:]
                                    for status in message.status), '%d reports of %s' % (count, node), 40)


def test_the_master_is_killed_and_restarted(tmp_path, monkeypatch):
    """Connected nodes continue meanwhile; then they register again, so that later nodes find them."""
    port = free_port()
    monkeypatch.setenv('ROS_MASTER_URI', 'http://localhost:%d' % port)
    with contextlib.ExitStack() as running:
        with master(port) as first:
            rospy.set_param('/use_sim_time', True)
            rospy.init_node('test_master')
            Registration()  # this process has to be found again, too
            running.enter_context(launched('pipeline.launch', 'detector:=depth', 'planner:=costmap', 'respawn:=true'))
            label, failing_once = Label(''), mock.Mock(side_effect=[OSError('the network is gone again'), None])
            on_new_master(failing_once)
            rospy.set_param('~label', 'A1')
            assert label.from_cache() == 'A1'
            stage = Stage()
            depth_camera_pub = rospy.Publisher(INFO_TOPICS[1], CameraInfo, queue_size=10)
            rospy.Subscriber(INFO_TOPICS[0], CameraInfo, depth_camera_pub.publish)  # depth is that of colour
            before, pids = stage.recovered('(before the fault)', 60), [pid_of(node) for node in NODES]
            running.enter_context(launched('viewer.launch', 'window:=false', 'label:=A1', 'session:=%s' % tmp_path))
            rospy.wait_for_service('viewer_node/capture', timeout=TIMEOUT_S)
            capture = rospy.ServiceProxy('viewer_node/capture', Trigger, persistent=True)
            wait_until(lambda: stage.tries(TIMEOUT_S) and capture().success, 'a measurement')
            Client('tracker_node', timeout=TIMEOUT_S).update_configuration({'marker_history': 3.0})
            set_label('A2')
            wait_until(lambda: label.from_cache() == 'A2', 'the label that was set')
            diagnostics = running.enter_context(Recorder('/diagnostics', DiagnosticArray))
            wait_for_reports(diagnostics, 'tracker_node', 1)
            first.send_signal(signal.SIGSTOP)
            wait_for_reports(diagnostics, 'tracker_node', 10)  # after 5 s without images it queries the master
        for _image in range(RECOVERY_IMAGES):
            stage.step()  # without a master
        wait_until(lambda: capture().success, 'a measurement without a master')
        assert [frame.label for frame in read_session(str(tmp_path)).frames] == ['A1', 'A1']
        with master(port):
            began_s = time.monotonic()
            assert stage.recovered('master killed and restarted') == before
            wait_until(lambda: [pid_of(node) for node in NODES + ('/test_master',)] == pids + [os.getpid()],
                       'the nodes in the new master')
            stage.rows.append('all nodes are registered again after %.1f s' % (time.monotonic() - began_s))
            assert rospy.get_param('/tracker_node/max_age') == 4.0 and rospy.get_param('/use_sim_time')
            with Recorder('/ros_3d_bb/tracks', TrackedObjectArray) as later_subscriber:
                stage.send()
                later_subscriber.wait_for(1)
            rospy.wait_for_service('viewer_node/capture', timeout=TIMEOUT_S)
            wait_until(lambda: rospy.get_param('/tracker_node/marker_history', 0) == 3, 'the live parameter')
            wait_until(lambda: failing_once.call_count == 2, 'another registration after an incomplete one')
            assert rospy.get_param('~label') == 'A2'
            set_label('B1')
            wait_until(lambda: label.from_cache() == 'B1', 'the label that was set in the new master')
            wait_until(lambda: rospy.has_param('/tracker_node_numbers'), 'the reserved IDs in the new master')
            killed_and_back('/people_node', lambda: time.sleep(0.1))
            after = stage.recovered('tracker killed after that')
            assert min(after.values()) > max(before.values())
            running.close()
    print('\n' + '\n'.join(stage.rows))
