"""depth_detector_node on simulated images, with colour, depth, camera_info and tf from a master."""
import numpy as np
import pytest
import rospy
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Int32MultiArray
from tf2_msgs.msg import TFMessage

from ros_3d_bb.conversions.perception_msgs import boxes2d_from_msg
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.detection.boxes import iou
from ros_3d_bb_lab.simulation.ros.scenario_to_bag import simulated_messages
from ros_3d_bb_lab.simulation.scenario import scenario_from
from ros_3d_bb_lab.simulation.simulator import Simulator
from support.ros import Recorder, diagnostics_of, publisher

START_NS = 1000 * NS
PEOPLE = [{'start': [4.0, 0.8], 'facing': 3.1, 'height': 1.8}, {'start': [5.0, -0.9], 'facing': 1.6, 'height': 1.7}]
COLOR, DEPTH, INFO = 'camera/color/image_raw', 'camera/aligned_depth_to_color/image_raw', 'camera/color/camera_info'


class Rig(object):
    """Publishers of a simulated robot, and the output of the node."""

    def __init__(self):
        self._pubs = {COLOR: publisher(COLOR, Image), DEPTH: publisher(DEPTH, Image),
                      INFO: publisher(INFO, CameraInfo), 'tf': publisher('/tf', TFMessage)}
        self._sent = 0
        self.output = Recorder('yolo_bounding_box', Int32MultiArray)

    def send(self, leave_out=(), frame_id=None, **scenario):
        """Send the next image, by default in the frame of the camera. Returns its stamp and the true boxes."""
        simulator = Simulator(scenario_from(dict({'rate': 10.0, 'people': PEOPLE}, **scenario)))
        frame = simulator.frame(self._sent)
        stamp_ns = START_NS + self._sent * NS // 10
        self._sent += 1
        for topic, message in simulated_messages(simulator, frame, stamp_ns):
            if frame_id and topic != 'tf':
                message.header.frame_id = frame_id
            if topic in self._pubs and topic not in leave_out:
                self._pubs[topic].publish(message)
        return stamp_ns, [person.box_px for person in frame.people]


@pytest.fixture(scope='module')
def rig():
    rospy.init_node('test_depth_detector_node')
    return Rig()


@pytest.fixture
def output(rig):
    return rig.output.emptied()


def assert_people(message, stamp_ns, true_boxes):
    found = boxes2d_from_msg(message)
    boxes = found.boxes.astype(float)
    assert found.stamp_ns == stamp_ns and len(boxes) == len(true_boxes)
    assert all(iou(np.array(true_box, float), boxes).max() > 0.5 for true_box in true_boxes)
    assert set(found.labels) == {'person'} and (found.scores > 0).all()


def test_nothing_is_published_while_no_floor_is_known(rig, output):
    """Neither from tf nor from a depth image: an empty array would mean that there are no people."""
    rig.send(leave_out=['tf'], frame_id='another_camera', people=[], robot={'pitch': -0.9})
    assert output.stays_at(0)
    assert diagnostics_of('depth_detector_node')[2]['images without floor'] == 1


def test_people_are_detected_with_stamp_and_frame_of_the_image(rig, output):
    with Recorder('yolo_result_out', Image) as images:
        for count in (1, 2):
            sent = rig.send()
            message = output.wait_for(count)[-1]
            assert_people(message, *sent)
            assert boxes2d_from_msg(message).frame_id == 'camera_color_optical_frame'
            assert images.wait_for(count)[-1].header.stamp.to_nsec() == sent[0]


def test_without_a_transform_the_floor_is_fitted_to_the_depth_image(rig, output):
    """The camera is in a frame that tf does not know."""
    sent = rig.send(frame_id='another_camera')
    assert_people(output.wait_for(1)[0], *sent)
    assert diagnostics_of('depth_detector_node')[2]['tilt of the camera unknown'] == 1
