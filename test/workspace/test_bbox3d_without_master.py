"""bbox3d_node without a master: 3D boxes, 2D boxes without a stamp, and debug images."""
import numpy as np
import pytest
from sensor_msgs.msg import Image
from std_msgs.msg import Int32MultiArray

from fuzz.hostile import good_messages
from fuzz.nodes import send_image
from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, DEPTH_TOPIC, INFO_TOPICS
from ros_3d_bb.conversions.image_msgs import imgmsg_to_rgb
from ros_3d_bb.conversions.perception_msgs import BOXES3D_TOPIC, BOXES_TOPIC, time_from
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.nodes.bbox3d_node import Bbox3dNode
from ros_3d_bb.pipeline.estimation_stage import Bbox3dParams
from ros_3d_bb.visualization.image_overlay import VALID_COLOR
from support.masterless import masterless
from support.ros import depth_message

START_NS = 1000 * NS


@pytest.fixture
def connections():
    """A node that takes the depth of the person as it is."""
    with masterless({'estimator': 'median'}) as made:
        made.node = Bbox3dNode()
        yield made


def test_boxes_become_3d_in_the_frame_and_at_the_stamp_of_the_image(connections):
    send_image(connections, START_NS)
    message = connections.publishers[BOXES3D_TOPIC].newest
    assert (message.header.stamp, message.header.frame_id) == (time_from(START_NS), 'camera')
    box, = message.boxes
    center, size = box.center.position, box.size
    assert center.z == pytest.approx(2.0) and abs(center.x) < 0.04 and abs(center.y) < 0.1
    assert (size.x, size.y, size.z) == pytest.approx((12 / 60 * 2.0, 36 / 60 * 2.0, 12 / 60 * 2.0))
    assert box.center.orientation.w == 1.0 and min(box.position_covariance[::4]) >= 0.01  # without an error model
    assert (box.roi.x_offset, box.roi.y_offset, box.roi.width, box.roi.height) == (26, 8, 12, 36)
    assert box.support == 1.0 and box.truncated_edges == box.BOTTOM


def test_boxes_without_a_stamp_get_the_image_that_arrived_before_them(connections, monkeypatch):
    """Of two images 0.4 s apart, the one 0.05 s (~assumed_delay) before."""
    monkeypatch.setattr('ros_3d_bb.nodes.bbox3d_node.arrival_clock_ns', lambda: connections.now.to_nsec())
    monkeypatch.setattr('ros_3d_bb.nodes.common.rgbd_inputs.arrival_clock_ns', lambda: connections.now.to_nsec())
    for stamp_ns, depth_mm in (START_NS, 1500), (START_NS + 2 * NS // 5, 2000):
        connections.now = time_from(stamp_ns)
        connections.send(INFO_TOPICS[0], good_messages(stamp_ns)[INFO_TOPICS[0]])
        connections.send(DEPTH_TOPIC, depth_message(stamp_ns, depth_mm))
    connections.now = time_from(stamp_ns + NS // 20)
    connections.send(BOXES_TOPIC, Int32MultiArray(data=[20, 10, 44, 38]))
    message = connections.publishers[BOXES3D_TOPIC].newest
    assert message.header.stamp == time_from(stamp_ns) and message.boxes[0].center.position.z == pytest.approx(2.0)


def test_a_changed_estimator_is_used_from_the_next_image(connections):
    connections.node._reconfigure(Bbox3dParams(estimator='foreground'))
    send_image(connections, START_NS)
    assert 2.05 < connections.publishers[BOXES3D_TOPIC].newest.boxes[0].center.position.z < 2.15  # the axis


def test_debug_images_are_published_while_they_have_subscribers(connections):
    images = {name: connections.publishers['ros_3d_bb/' + name] for name in ('color', 'raw', 'depth')}
    for number in range(3):  # colour is subscribed with the first boxes
        send_image(connections, START_NS + number * NS // 30)
        connections.send(COLOR_TOPIC, Image())  # without a stamp
    assert (imgmsg_to_rgb(images['color'].newest) == VALID_COLOR).all(axis=2).any()
    assert np.unique(imgmsg_to_rgb(images['raw'].newest)).tolist() == [90]
    assert images['depth'].newest.encoding == 'mono8'
    for publisher in images.values():
        publisher.connections = 0
    send_image(connections, START_NS + NS)
    assert connections.subscribers[COLOR_TOPIC].unregister.called
