"""Nodes and process_bag publish the same messages for the same bag, whose images may be compressed."""
import pytest
from sensor_msgs.msg import CompressedImage

from ros_3d_bb.bags.bag_pipeline import process_bag
from ros_3d_bb.bags.bag_writer import write_bag
from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, DEPTH_TOPIC
from ros_3d_bb.nodes.bbox3d_node import Bbox3dNode
from ros_3d_bb.nodes.depth_detector_node import DepthDetectorNode
from ros_3d_bb.nodes.people_node import PeopleNode
from ros_3d_bb.nodes.tracker_node import TrackerNode
from ros_3d_bb.pipeline.people_pipeline import Settings
from ros_3d_bb_lab.simulation.ros.scenario_to_bag import scenario_images
from ros_3d_bb_lab.simulation.scenario import scenario_from
from support.bags import messages_in
from support.compressed import compressed_fields, rewritten
from support.masterless import published

SCENE = {'duration': 1.5, 'rate': 10.0, 'people': [{'start': [3.0, 0.5], 'moves': [{'to': [3.0, -1.0]}]}]}


CODECS = {'plain': {}, 'compressed': {COLOR_TOPIC: 'jpeg', DEPTH_TOPIC: 'compressedDepth rvl'}}


@pytest.fixture(scope='module', params=sorted(CODECS))
def bags(request, tmp_path_factory):
    """A bag of a scene, and the output of process_bag."""
    folder = tmp_path_factory.mktemp('bags')
    write_bag(scenario_images(scenario_from(SCENE)), str(folder / 'plain.bag'))
    names = rewritten(folder / 'plain.bag', folder / 'in.bag', {
        topic: lambda message, codec=codec: CompressedImage(**compressed_fields(message, codec))
        for topic, codec in CODECS[request.param].items()})
    process_bag(str(folder / 'in.bag'), str(folder / 'out.bag'), Settings(detector='depth', names=names))
    return str(folder / 'in.bag'), str(folder / 'out.bag')


@pytest.mark.parametrize('node_class, input_bag, params, topics', [
    (DepthDetectorNode, 0, {}, ['yolo_bounding_box']), (Bbox3dNode, 1, {}, ['ros_3d_bb/bb_3d']),
    (TrackerNode, 1, {'tf_timeout': 0.0}, ['ros_3d_bb/tracks', 'visualization_marker_array']),
    (PeopleNode, 0, {'detector': 'depth'}, ['yolo_bounding_box', 'ros_3d_bb/bb_3d', 'ros_3d_bb/tracks'])])
def test_process_bag_writes_the_messages_that_the_nodes_publish(bags, node_class, input_bag, params, topics):
    found = published(node_class, bags[input_bag], params, topics)
    for topic in topics:
        expected = messages_in(bags[1], '/' + topic)['/' + topic]
        assert len(expected) == 15
        assert [str(message) for message in found[topic]] == [str(message) for message in expected]
