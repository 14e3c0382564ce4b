"""viewer_node on simulated images. Needs a master for five topics, services and a window."""
import os
import subprocess

import numpy as np
import pytest
import rospy
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header, Int32MultiArray
from std_srvs.srv import SetBool, SetBoolResponse, Trigger

from ros_3d_bb.conversions.camera_msgs import frame_id_of
from ros_3d_bb.conversions.perception_msgs import boxes2d_to_msg, boxes3d_to_msg, time_from
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.estimation.box3d import Box3D
from ros_3d_bb.msg import BoundingBox3DArray
from ros_3d_bb.sessions.session_reader import read_color, read_depth, read_session
from ros_3d_bb_lab.evaluation.launching import running
from ros_3d_bb_lab.simulation.ros.scenario_to_bag import simulated_messages
from ros_3d_bb_lab.simulation.scenario import scenario_from
from ros_3d_bb_lab.simulation.simulator import Simulator
from support.ros import Recorder, launched, publisher, wait_until
from support.screen import press, start_screen

START_NS = 1000 * NS
PERIOD = NS // 10
PEOPLE = [{'start': [4.0, 0.8], 'facing': 3.1}, {'start': [5.0, -0.9], 'facing': 1.6}]
COLOR, DEPTH, INFO = 'camera/color/image_raw', 'camera/aligned_depth_to_color/image_raw', 'camera/color/camera_info'
BOXES2D, BOXES3D = 'yolo_bounding_box', 'ros_3d_bb/bb_3d'
TYPES = {COLOR: Image, DEPTH: Image, INFO: CameraInfo, BOXES2D: Int32MultiArray, BOXES3D: BoundingBox3DArray}
TITLE = 'ros_3d_bb viewer'


class Rig(object):
    """A simulated camera and a detector with exact boxes."""

    def __init__(self):
        self.simulator = Simulator(scenario_from({'rate': 10.0, 'duration': 30.0, 'people': PEOPLE}))
        self.pubs = {topic: publisher(topic, kind) for topic, kind in TYPES.items()}
        self._sent = 0

    def send(self, with_boxes=True):
        """Send the next image; returns its frame and stamp."""
        frame, stamp_ns = self.simulator.frame(self._sent), START_NS + self._sent * PERIOD
        self._sent += 1
        for topic, message in simulated_messages(self.simulator, frame, stamp_ns):
            if topic in self.pubs:
                self.pubs[topic].publish(message)
        boxes = [Box3D(np.array([0.5, 0.1, 3.0]), np.array([0.5, 1.7, 0.5]), tuple(person.box_px), 0.75, (False,) * 4)
                 for person in frame.people]
        if with_boxes:
            header = Header(stamp=time_from(stamp_ns), frame_id=frame_id_of(''))
            self.pubs[BOXES2D].publish(boxes2d_to_msg(np.array([box.rect_px for box in boxes]), header))
            self.pubs[BOXES3D].publish(boxes3d_to_msg(boxes, header, self.simulator.camera))
        return frame, stamp_ns

    def check_stored(self, folder, sent, number):
        """Assert that a measurement contains what was sent."""
        session, (sent_frame, stamp_ns) = read_session(folder), sent
        frame = session.frames[number]
        assert (session.camera, session.frame_id, frame.stamp_ns) == (self.simulator.camera, frame_id_of(''), stamp_ns)
        np.testing.assert_array_equal(read_color(frame, session.camera), sent_frame.color)
        np.testing.assert_array_equal(read_depth(frame, session).values, sent_frame.depth_mm)
        assert frame.boxes_px == tuple(tuple(person.box_px) for person in sent_frame.people)
        np.testing.assert_allclose([detection.estimate_m for detection in frame.detections],
                                   [[0.5, 0.1, 3.0]] * len(sent_frame.people), atol=1e-5)


def capture():
    rospy.wait_for_service('viewer_node/capture', timeout=20)
    return rospy.ServiceProxy('viewer_node/capture', Trigger)()


def captured(folder):
    """Capture until the sent messages have arrived, which only the response shows."""
    count = len(entries(folder))
    wait_until(lambda: capture().success, 'a measurement')
    assert len(entries(folder)) == count + 1


def entries(folder):
    """The measurements in a session, which may not exist yet."""
    return read_session(folder).frames if os.path.exists(os.path.join(folder, 'frames.json')) else ()


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    return str(tmp_path_factory.mktemp('measurements') / 'a session')


@pytest.fixture(scope='module')
def rig(folder):
    with launched('viewer.launch', 'session:=' + folder, 'window:=false', 'label:=A1'):
        assert not capture().success
        yield Rig()


def test_without_images_nothing_is_stored(rig, folder):
    rig.pubs[COLOR].publish(Image())  # rejected
    assert not capture().success and entries(folder) == ()


def test_captures_are_appended_and_an_image_is_stored_once(rig, folder):
    first = rig.send()
    captured(folder)
    rospy.set_param('viewer_node/label', 'B2')
    second = rig.send()
    captured(folder)
    assert not capture().success
    for number, sent in enumerate((first, second)):
        rig.check_stored(folder, sent, number)
    assert [frame.label for frame in entries(folder)] == ['A1', 'B2']


def test_images_without_boxes_are_stored_after_a_warning(rig, folder):
    count = len(entries(folder))
    for _image in range(12):
        rig.send(with_boxes=False)
    wait_until(lambda: 'no 3D boxes received on /ros_3d_bb/bb_3d' in capture().message, 'a rejection')
    assert len(entries(folder)) == count
    _frame, last_ns = rig.send(with_boxes=False)
    wait_until(lambda: capture().success and entries(folder)[-1].stamp_ns == last_ns, 'images alone')
    assert entries(folder)[-1].detections == ()


def test_without_a_display_the_error_names_the_option():
    process = subprocess.Popen(['rosrun', 'ros_3d_bb', 'viewer_node', '__name:=blind'],
                               env=dict(os.environ, DISPLAY=':9876', WAYLAND_DISPLAY=''), stderr=subprocess.PIPE)
    output = process.communicate()[1].decode()
    assert process.returncode == 1 and '~window:=false' in output and 'Traceback' not in output


def press_key(key):
    wait_until(lambda: press(TITLE, key), 'the window')


@pytest.fixture
def window(rig, monkeypatch, tmp_path):
    """Start the node with a window; returns its process and session."""
    monkeypatch.setenv('DISPLAY', '')  # restored afterwards
    screen, folder = start_screen(), str(tmp_path / 'session')
    with running(['rosrun', 'ros_3d_bb', 'viewer_node', '__name:=window', '_session:=' + folder,
                  '_label:=by hand']) as process:
        wait_until(lambda: all(pub.get_num_connections() >= 2 for pub in rig.pubs.values()), 'the connections')
        rospy.wait_for_service('window/capture', timeout=20)
        yield process, folder
    screen.kill()


def test_keys_store_pause_and_quit(rig, window):
    process, folder = window
    sent = rig.send()

    def stored():
        press_key('s')
        rospy.sleep(0.3)
        return entries(folder)
    wait_until(stored, 'a measurement')
    rig.check_stored(folder, sent, 0)
    assert entries(folder)[0].label == 'by hand' and len(entries(folder)) == 1
    for key in ('l', 'Shift_L', 'b', 'Left', '7', 'Num_Lock', 'KP_Enter'):  # only b and 7 are characters
        press_key(key)
        rospy.sleep(0.3)
    assert rospy.get_param('window/label') == 'b7'
    press_key('d')
    wait_until(lambda: not entries(folder), 'the deletion')
    with Recorder('/rosout', Log, False) as log:
        press_key('p')
        wait_until(lambda: any('the service /detector/enable does not respond' in message.msg
                               for message in log.messages), 'a warning about the missing detector')
    calls = []
    service = rospy.Service('detector/enable', SetBool,
                            lambda request: SetBoolResponse(calls.append(request.data) is None, 'done'))
    for presses in (1, 2, 3):
        press_key('p')
        wait_until(lambda: len(calls) == presses, 'the call of the detector')
    # It can close before press returns.
    wait_until(lambda: press(TITLE, 'q') or process.poll() is not None, 'the window')
    assert process.wait(timeout=20) == 0
    assert calls == [False, True, False, True]  # the detector is resumed at the end
    service.shutdown()
