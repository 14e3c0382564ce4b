"""depth_detector_node on simulated images. Needs a master: colour, depth, camera_info and tf have to meet."""
import numpy as np
import pytest
import rospy
from dynamic_reconfigure.client import Client
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Int32MultiArray
from std_srvs.srv import SetBool
from tf2_msgs.msg import TFMessage

from ros_3d_bb.conversions.perception_msgs import boxes2d_from_msg
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.detection.boxes import iou
from ros_3d_bb_lab.simulation.ros.simulator_msgs import simulated_messages
from ros_3d_bb_lab.simulation.scenario import scenario_from
from ros_3d_bb_lab.simulation.simulator import Simulator
from support.ros import TIMEOUT_S, Recorder, diagnostics_of, publisher

START_NS = 1000 * NS
PEOPLE = [{'start': [4.0, 0.8], 'facing': 3.1, 'height': 1.8}, {'start': [5.0, -0.9], 'facing': 1.6, 'height': 1.7}]
COLOR, DEPTH, INFO = 'camera/color/image_raw', 'camera/aligned_depth_to_color/image_raw', 'camera/color/camera_info'


class Rig(object):
    """A simulated robot, whose messages are sent as a test wants them."""

    def __init__(self):
        self.simulator = Simulator(scenario_from({'rate': 10.0, 'people': PEOPLE}))
        self._pubs = {COLOR: publisher(COLOR, Image), DEPTH: publisher(DEPTH, Image),
                      INFO: publisher(INFO, CameraInfo), 'tf': publisher('/tf', TFMessage)}
        self._sent = 0

    def send(self, leave_out=(), frame_id=None):
        """Send the next image, in another frame where given; returns its stamp and the true boxes."""
        frame = self.simulator.frame(self._sent)
        stamp_ns = START_NS + self._sent * NS // 10
        self._sent += 1
        for topic, message in simulated_messages(self.simulator, frame, stamp_ns):
            if frame_id and topic != 'tf':
                message.header.frame_id = frame_id
            if topic in self._pubs and topic not in leave_out:
                self._pubs[topic].publish(message)
        return stamp_ns, [person.box_px for person in frame.people]


@pytest.fixture(scope='module')
def rig():
    rospy.init_node('test_depth_detector_node')
    return Rig()


@pytest.fixture(scope='module')
def recorder(rig):
    with Recorder('yolo_bounding_box', Int32MultiArray) as recorder:
        yield recorder


@pytest.fixture
def output(recorder):
    return recorder.emptied()


def is_found(message, true_boxes):
    boxes = boxes2d_from_msg(message).boxes.astype(float)
    return len(boxes) == len(true_boxes) and all(
        iou(np.array(true_box, float), boxes).max() > 0.5 for true_box in true_boxes)


def test_an_image_without_any_floor_is_not_answered(rig, output):
    """Neither from tf nor in the depth image, nor seen before: an empty array would say that nobody is there."""
    known, rig.simulator = rig.simulator, Simulator(scenario_from({'rate': 10.0, 'robot': {'pitch': 0.9}}))
    rig.send(frame_id='another_camera')
    rig.simulator = known
    assert output.stays_at(0)
    assert diagnostics_of('depth_detector_node')[2]['images without floor'] == 1


def test_people_are_found_and_carry_the_stamp_of_their_image(rig, output):
    sent = [rig.send()]
    output.wait_for(1)
    sent.append(rig.send())
    messages = output.wait_for(2)
    for message, (stamp_ns, true_boxes) in zip(messages, sent):
        found = boxes2d_from_msg(message)
        assert (found.stamp_ns, found.frame_id) == (stamp_ns, 'camera_color_optical_frame')
        assert is_found(message, true_boxes)


def test_without_transform_the_floor_is_looked_for_in_the_image(rig, output):
    """The camera is in a frame that tf does not know."""
    _stamp, true_boxes = rig.send(frame_id='another_camera')
    assert is_found(output.wait_for(1)[0], true_boxes)
    assert diagnostics_of('depth_detector_node')[2]['images without transform'] == 2


def test_an_image_without_depth_is_not_searched_and_the_next_one_is(rig, output):
    lost_ns, _boxes = rig.send(leave_out=[DEPTH])
    stamp_ns, true_boxes = rig.send()
    message, = output.wait_for(1)
    assert boxes2d_from_msg(message).stamp_ns == stamp_ns != lost_ns and is_found(message, true_boxes)
    assert output.stays_at(1)


def test_the_service_pauses_and_resumes(rig, output):
    enable = rospy.ServiceProxy('depth_detector_node/enable', SetBool)
    enable(False)
    rig.send()
    assert output.stays_at(0)
    enable(True)
    rig.send()
    output.wait_for(1)


def test_the_annotated_image_has_the_stamp_of_its_own(rig, output):
    with Recorder('yolo_result_out', Image) as pictures:
        stamp_ns, _boxes = rig.send()
        assert pictures.wait_for(1)[0].header.stamp.to_nsec() == stamp_ns


def test_a_changed_range_works_from_the_next_image_on(rig, output):
    """One of the people is 4 m away and one 5 m."""
    client = Client('depth_detector_node', timeout=TIMEOUT_S)
    counts = []
    for max_depth in (6.5, 4.5, 6.5):
        client.update_configuration({'max_depth': max_depth})
        rig.send()
        counts.append(len(boxes2d_from_msg(output.wait_for(len(counts) + 1)[-1]).boxes))
    client.close()
    assert counts == [2, 1, 2]
