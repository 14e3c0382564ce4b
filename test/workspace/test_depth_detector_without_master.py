"""depth_detector_node without a master, on simulated images: with the floor of tf, of the image, and without one."""
import numpy as np
import pytest

from ros_3d_bb.conversions.perception_msgs import BOXES_TOPIC, boxes2d_from_msg
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.detection.boxes import iou
from ros_3d_bb.detection.depth.person_clusters import DepthPeopleParams
from ros_3d_bb.nodes.depth_detector_node import DepthDetectorNode
from ros_3d_bb.pipeline.detection_stage import DepthDetectorParams
from ros_3d_bb_lab.simulation.ros.scenario_to_bag import simulated_messages
from ros_3d_bb_lab.simulation.scenario import scenario_from
from ros_3d_bb_lab.simulation.simulator import Simulator
from support.masterless import masterless

STAMP_NS = 1000 * NS
PEOPLE = [{'start': [4.0, 0.8], 'facing': 3.1, 'height': 1.8}, {'start': [5.0, -0.9], 'facing': 1.6, 'height': 1.7}]


def answer(frame_id='camera_color_optical_frame', changed=DepthPeopleParams(), **scenario):
    """The boxes and the annotated image of one image, the counts of the node, and the true boxes."""
    simulator = Simulator(scenario_from(dict({'rate': 10.0, 'people': PEOPLE}, **scenario)))
    frame = simulator.frame(0)
    with masterless() as connections:
        node = DepthDetectorNode()
        node._reconfigure(DepthDetectorParams(), changed)
        for topic, message in simulated_messages(simulator, frame, STAMP_NS):
            topic = '/tf' if topic == 'tf' else topic
            if topic != '/tf':
                message.header.frame_id = frame_id
            if topic in connections.subscribers:
                connections.send(topic, message)
        outputs = [connections.publishers[topic].newest for topic in (BOXES_TOPIC, 'yolo_result_out')]
    return outputs + [node._diagnostics.counts, [person.box_px for person in frame.people]]


@pytest.mark.parametrize('frame_id', ['camera_color_optical_frame', 'unknown_to_tf'])
def test_people_are_detected_with_stamp_and_frame_of_the_image(frame_id):
    """Without a transform, the floor is fitted to the depth image."""
    message, drawn, counts, true_boxes = answer(frame_id)
    found = boxes2d_from_msg(message)
    assert (found.stamp_ns, found.frame_id) == (STAMP_NS, frame_id) and drawn.header.stamp.to_nsec() == STAMP_NS
    assert len(found.boxes) == len(true_boxes)
    assert all(iou(np.array(box, float), found.boxes.astype(float)).max() > 0.5 for box in true_boxes)
    assert set(found.labels) == {'person'} and (found.scores > 0).all()
    assert ('tilt of the camera unknown' in counts) == (frame_id == 'unknown_to_tf')


def test_a_changed_range_applies_from_the_next_image_on():
    """One of the people is 4 m away and one 5 m."""
    assert len(boxes2d_from_msg(answer(changed=DepthPeopleParams(max_depth=4.5))[0]).boxes) == 1


def test_nothing_is_published_while_no_floor_is_known():
    """Neither from tf nor from a depth image: an empty array would mean that there are no people."""
    message, _drawn, counts, _true_boxes = answer('unknown_to_tf', people=[], robot={'pitch': -0.9})
    assert message is None and counts['images without floor'] == 1
