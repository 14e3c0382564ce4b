"""What the harness without a master is for: nodes and process_bag give the same on the same bag."""
import pytest
import rosbag

from ros_3d_bb.bags.bag_pipeline import process_bag
from ros_3d_bb.bags.bag_writer import write_bag
from ros_3d_bb.nodes.bbox3d_node import Bbox3dNode
from ros_3d_bb.nodes.depth_detector_node import DepthDetectorNode
from ros_3d_bb.nodes.tracker_node import TrackerNode
from ros_3d_bb.pipeline.offline_pipeline import Settings
from ros_3d_bb_lab.simulation.ros.scenario_to_bag import scenario_images
from ros_3d_bb_lab.simulation.scenario import scenario_from
from support.masterless import masterless, on_the_wire

SCENE = {'duration': 1.5, 'rate': 10.0, 'people': [{'start': [3.0, 0.5], 'moves': [{'to': [3.0, -1.0]}]}]}
RESULTS = 'yolo_bounding_box', 'ros_3d_bb/bb_3d', 'ros_3d_bb/tracks', 'visualization_marker_array'


@pytest.fixture(scope='module')
def bags(tmp_path_factory):
    """A bag of a scene, and what process_bag makes of it."""
    folder = tmp_path_factory.mktemp('bags')
    write_bag(scenario_images(scenario_from(SCENE)), str(folder / 'in.bag'))
    process_bag(str(folder / 'in.bag'), str(folder / 'out.bag'), Settings(detector='depth'))
    return str(folder / 'in.bag'), str(folder / 'out.bag')


def published(node_class, bag_path, params=()):
    """{topic: messages} that a node publishes on the messages of a bag."""
    kept = {}
    with masterless(params) as connections, rosbag.Bag(bag_path) as bag:
        node_class()
        for topic, message, _time in bag.read_messages():
            before = {name: publisher.count for name, publisher in connections.publishers.items()}
            if topic in connections.subscribers:
                connections.send(topic, message)
            if topic[1:] in connections.subscribers:
                connections.send(topic[1:], on_the_wire(message))
            for name, publisher in connections.publishers.items():
                if publisher.count > before[name]:
                    kept.setdefault(name, []).append(publisher.newest)
    return kept


@pytest.mark.parametrize('node_class,params', [(DepthDetectorNode, {}), (Bbox3dNode, {}),
                                               (TrackerNode, {'tf_timeout': 0.0})])
def test_process_bag_gives_what_the_nodes_publish(bags, node_class, params):
    """Each node gets the inputs that process_bag found; every message is the same, field by field."""
    found = published(node_class, bags[0] if node_class is DepthDetectorNode else bags[1], params)
    with rosbag.Bag(bags[1]) as bag:
        for topic in set(RESULTS) & set(found):
            expected = [message for _topic, message, _time in bag.read_messages('/' + topic)]
            assert len(expected) == 15
            assert [str(message) for message in found[topic]] == [str(message) for message in expected]
    assert set(RESULTS) & set(found)
