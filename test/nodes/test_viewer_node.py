"""The window of viewer_node, which needs a display."""
import os
import subprocess

import pytest
import rospy

from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, DEPTH_TOPIC, INFO_TOPICS
from ros_3d_bb.conversions.perception_msgs import BOXES3D_TOPIC, BOXES_TOPIC
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.sessions.session_reader import read_session
from ros_3d_bb_lab.evaluation.launching import running
from support.inputs import good_messages
from support.ros import TIMEOUT_S, publisher, wait_until
from support.screen import press, start_screen

START_NS = 1000 * NS
TITLE = 'ros_3d_bb viewer'


def test_without_a_display_the_error_names_the_option():
    process = subprocess.Popen(['rosrun', 'ros_3d_bb', 'viewer_node', '__name:=blind'],
                               env=dict(os.environ, DISPLAY=':9876', WAYLAND_DISPLAY=''), stderr=subprocess.PIPE)
    output = process.communicate()[1].decode()
    assert process.returncode == 1 and '~window' in output and 'Traceback' not in output


def entries(folder):
    return read_session(folder).frames if os.path.exists(os.path.join(folder, 'frames.json')) else ()


def press_key(key):
    wait_until(lambda: press(TITLE, key), 'the window')


@pytest.fixture
def window(monkeypatch, tmp_path):
    """Start the node with a window, and send it an image; returns its process and session."""
    monkeypatch.setenv('DISPLAY', '')  # restored afterwards
    screen, folder, messages = start_screen(), str(tmp_path / 'session'), good_messages(START_NS)
    with running(['rosrun', 'ros_3d_bb', 'viewer_node', '__name:=window', '_session:=' + folder,
                  '_label:=by hand']) as process:
        for topic in (COLOR_TOPIC, DEPTH_TOPIC, INFO_TOPICS[0], BOXES_TOPIC, BOXES3D_TOPIC):
            publisher(topic, type(messages[topic])).publish(messages[topic])
        rospy.wait_for_service('window/capture', timeout=TIMEOUT_S)
        yield process, folder
    screen.kill()


def test_keys_store_and_quit(window):
    process, folder = window

    def stored():
        press_key('s')
        rospy.sleep(0.3)
        return entries(folder)
    wait_until(stored, 'a measurement')
    assert [(entry.stamp_ns, entry.label) for entry in entries(folder)] == [(START_NS, 'by hand')]
    # It can close before press returns.
    wait_until(lambda: press(TITLE, 'q') or process.poll() is not None, 'the window')
    assert process.wait(timeout=20) == 0
