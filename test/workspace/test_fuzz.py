"""A few seconds of `./run fuzz`, and regression tests of what it found."""
import genpy
import numpy as np
import pytest
from std_msgs.msg import Header

from fuzz.hostile import good_messages, transforms
from fuzz.nodes import TARGETS, fuzz_node
from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC as COLOR, DEPTH_TOPIC as DEPTH, INFO_TOPICS
from ros_3d_bb.conversions.perception_msgs import BOXES_TOPIC as BOXES
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import BoundingBox3DArray
from ros_3d_bb.nodes.bbox3d_node import Bbox3dNode
from ros_3d_bb.nodes.tracker_node import TrackerNode
from ros_3d_bb.visualization import image_overlay
from support.masterless import masterless

INFO = INFO_TOPICS[0]


@pytest.mark.parametrize('name', sorted(TARGETS))
def test_nodes_process_valid_messages_after_invalid_ones(name):
    sent, _cpu_s = fuzz_node(name, 7, 400)
    assert sent >= 400


@pytest.mark.parametrize('topic', ['/tf', '/tf_static'])
def test_transforms_with_stamps_that_tf2_cannot_represent_are_ignored(topic):
    """They raise an uncaught C++ exception in tf2, which terminates the process."""
    with masterless({'tf_timeout': 0.0}) as connections:
        TrackerNode()
        for secs in (2 ** 32 - 1, 2 ** 31, 100):
            connections.send(topic, transforms(secs * NS))
        connections.send('ros_3d_bb/bb_3d', BoundingBox3DArray(header=Header(stamp=genpy.Time(100), frame_id='camera')))
        assert connections.publishers['ros_3d_bb/tracks'].count == 1


def test_edges_far_outside_the_image_are_clipped(monkeypatch):
    """OpenCV needs a tenth of a second for an edge of 2^31 pixels."""
    corners = []
    monkeypatch.setattr('cv2.rectangle', lambda _image, *given: corners.extend(given[0] + given[1]))
    image_overlay.draw_boxes(np.zeros((48, 64, 3), np.uint8),
                             np.array([[-2 ** 31, 5, 2 ** 31 - 1, 20], [3, 4, 9, 1e300]]), ['', ''])
    assert corners == [-4, 5, 68, 20, 3, 4, 9, 52]


def test_boxes_are_processed_even_if_the_colour_image_is_invalid():
    """Two arrays of boxes wait for one depth image."""
    with masterless() as connections:
        Bbox3dNode()
        for stamp_ns, order in ((10 ** 12, (INFO, DEPTH, BOXES)), (2 * 10 ** 12, (INFO, COLOR, BOXES, BOXES, DEPTH))):
            messages = good_messages(stamp_ns)
            messages[COLOR].step = 1
            for topic in order:
                connections.send(topic, messages[topic])
        assert connections.publishers['ros_3d_bb/bb_3d'].count == 3
