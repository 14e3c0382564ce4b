"""Invalid messages to real nodes, without a master: `./run fuzz` for a few seconds, and recovery at once."""
import genpy
import numpy as np
import pytest
from sensor_msgs.msg import CompressedImage
from std_msgs.msg import Header

from fuzz import hostile
from fuzz.hostile import good_messages, transforms
from fuzz.nodes import TARGETS, _quiet, fuzz_node, send_image
from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC as COLOR, DEPTH_TOPIC as DEPTH, INFO_TOPICS
from ros_3d_bb.conversions.perception_msgs import BOXES3D_TOPIC, BOXES_TOPIC as BOXES, boxes2d_from_msg, time_from
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


START_NS, PERIOD_NS = 1000 * NS, NS // 30
HOUR_NS = 3600 * NS
# Values of fields. The messages of one image share their header, unless one gets another header.
STAMPS = [{'header': Header(stamp=time_from(stamp_ns), frame_id='camera')}
          for stamp_ns in (0, START_NS + HOUR_NS, START_NS - 900 * NS)]
IMAGES = STAMPS + [{'step': 1}, {'format': '16UC1; compressedDepth'}]
CAMERAS = STAMPS + [{'K': [0.0] * 9}, {'K': [90.0] + [0.0] * 3 + [90.0] + [0.0] * 4}, {'width': 32, 'height': 24}]
BOXES2D = [{'data': data} for data in ([26, 8, 38], [38, 44, 26, 8], [-2 ** 31, -2 ** 31, 2 ** 31 - 1, 2 ** 31 - 1])]
BOXES2D += [{'label': 'boxes;stamp=%d.000000000;frame=camera' % stamp_s} for stamp_s in (0, 4600)]
BOXES3D = STAMPS + [{'header': Header(stamp=time_from(START_NS), frame_id='nowhere')}, {'boxes': []}]
RGBD_NODES = 'bbox3d_node', 'depth_detector_node', 'tracker_node', 'viewer_node'
CASES = [('bbox3d_node', BOXES, change) for change in BOXES2D]
CASES += [(node, BOXES3D_TOPIC, change) for node in ('tracker_node', 'viewer_node') for change in BOXES3D]
CASES += [(node, DEPTH, change) for node in RGBD_NODES for change in IMAGES]
CASES += [(node, INFO, change) for node in RGBD_NODES for change in CAMERAS]
CASES += [(node, COLOR, change) for node in ('yolov5_node', 'depth_detector_node', 'viewer_node')
          for change in IMAGES]


def changed(message, change):
    """A message with other values; a compressed one, if they have a format."""
    if 'format' in change:
        return CompressedImage(message.header, change['format'], bytes(100))
    for name, value in change.items():
        setattr(message.layout.dim[0] if name == 'label' else message, name, value)
    return message


def newest_ns(target, node, connections):
    """Stamp of the image of the newest result of a node."""
    if not target.output:
        return node._snapshots.newest.stamp_ns
    newest = connections.publishers[target.output].newest
    return newest.header.stamp.to_nsec() if hasattr(newest, 'header') else boxes2d_from_msg(newest).stamp_ns


@pytest.mark.parametrize('name, topic, change', CASES)
def test_the_next_valid_message_is_processed_at_once(name, topic, change):
    """One message of the sixth image is changed."""
    target = TARGETS[name]
    with masterless(target.params) as connections, _quiet():
        node = target.make(None)
        for number in range(1, 8):
            stamp_ns = START_NS + number * PERIOD_NS
            messages = hostile.good_messages(stamp_ns)
            if number == 6:
                messages[topic] = changed(messages[topic], change)
            send_image(connections, stamp_ns, messages)
            assert number not in (5, 7) or newest_ns(target, node, connections) == stamp_ns
