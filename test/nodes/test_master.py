"""The whole pipeline while the ROS master is killed and started again. Needs a master of its own for that."""
import contextlib
import os
import socket
import subprocess
import time

import pytest
import rospy
from dynamic_reconfigure.client import Client
from std_srvs.srv import Trigger

from ros_3d_bb.measurements import read_session
from ros_3d_bb.msg import TrackedObjectArray
from ros_3d_bb.nodes.registration import Registration
from support.processes import killed_and_back, pid_of
from support.ros import TIMEOUT_S, Recorder, launched, wait_until
from support.stage import RECOVERY_IMAGES, Stage

NODES = '/depth_detector_node', '/bbox3d_node', '/tracker_node', '/planner_bridge_node'


def free_port():
    with contextlib.closing(socket.socket()) as listener:
        listener.bind(('', 0))
        return listener.getsockname()[1]


def answers():
    try:
        return rospy.get_master().getPid()[0] == 1
    except OSError:
        return False


@contextlib.contextmanager
def master(port):
    process = subprocess.Popen(['rosmaster', '--core', '-p', str(port)])
    try:
        wait_until(answers, 'a master')
        yield process
    finally:
        process.kill()
        process.wait()


@pytest.fixture(scope='module')
def port():
    port = free_port()
    os.environ['ROS_MASTER_URI'] = 'http://localhost:%d' % port
    return port


def test_the_master_is_killed_and_started_again(port, tmp_path):
    """Who is connected goes on meanwhile and afterwards; the nodes register again, and are found by who comes later."""
    with contextlib.ExitStack() as running:
        with master(port):
            rospy.set_param('/use_sim_time', True)
            rospy.init_node('test_master')
            Registration()  # this process has to be found again, too
            running.enter_context(launched('pipeline.launch', 'detector:=depth', 'planner:=costmap', 'respawn:=true'))
            stage = Stage()
            before, pids = stage.recovered('(before the fault)', 60), [pid_of(node) for node in NODES]
            running.enter_context(launched('viewer.launch', 'window:=false', 'label:=A1', 'session:=%s' % tmp_path))
            rospy.wait_for_service('viewer_node/capture', timeout=20)
            capture = rospy.ServiceProxy('viewer_node/capture', Trigger, persistent=True)
            wait_until(lambda: stage.tries(TIMEOUT_S) and capture().success, 'a measurement')
            Client('tracker_node', timeout=20).update_configuration({'marker_history': 3.0})
        for _image in range(RECOVERY_IMAGES):
            stage.step()  # without a master
        wait_until(lambda: capture().success, 'a measurement without a master')
        assert [frame.label for frame in read_session(str(tmp_path)).frames] == ['A1', 'A1']
        with master(port):
            began_s = time.monotonic()
            assert stage.recovered('master killed and started again') == before
            wait_until(lambda: [pid_of(node) for node in NODES + ('/test_master',)] == pids + [os.getpid()],
                       'the nodes in the new master')
            stage.rows.append('all nodes are registered again after %.1f s' % (time.monotonic() - began_s))
            assert rospy.get_param('/tracker_node/tracker') == 'kalman' and rospy.get_param('/use_sim_time')
            with Recorder('/ros_3d_bb/tracks', TrackedObjectArray) as newcomer:
                stage.send()
                newcomer.wait_for(1)
            rospy.wait_for_service('viewer_node/capture', timeout=20)
            wait_until(lambda: rospy.get_param('/tracker_node/marker_history', 0) == 3, 'what was changed meanwhile')
            wait_until(lambda: rospy.has_param('/tracker_node_numbers'), 'the numbers in the new master')
            killed_and_back('/tracker_node', lambda: time.sleep(0.1))
            after = stage.recovered('tracker killed after that')
            assert min(after.values()) > max(before.values())
            running.close()
    print('\n' + '\n'.join(stage.rows))
