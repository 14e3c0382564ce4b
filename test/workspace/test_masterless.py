"""Nodes and process_bag publish the same messages for the same bag, whose images may be compressed."""
import json
from typing import NamedTuple

import numpy as np
import pytest

from ros_3d_bb.bags.bag_pipeline import process_bag
from ros_3d_bb.bags.process_bag import main
from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, DEPTH_TOPIC
from ros_3d_bb.conversions.perception_msgs import BOXES3D_TOPIC, BOXES_TOPIC, TRACKS_TOPIC
from ros_3d_bb.core.params import Param, parameters
from ros_3d_bb.detection.boxes import Detections
from ros_3d_bb.detection.detector import Detector
from ros_3d_bb.nodes.bbox3d_node import Bbox3dNode
from ros_3d_bb.nodes.detector_node import DetectorNode
from ros_3d_bb.nodes.people_node import PeopleNode
from ros_3d_bb.nodes.tracker_node import TrackerNode
from ros_3d_bb.pipeline.detectors import DETECTORS, Row
from ros_3d_bb.pipeline.people_pipeline import Settings
from support.bags import changed_bag, messages_in, scene_bag
from support.code_blocks import blocks_in
from support.commands import run
from support.compressed import compressed
from support.masterless import masterless, published


@parameters('Detector middle')
class MiddleParams(NamedTuple):
    """Parameters of a detector."""

    width: float = Param(0.5, 'Width of the box, as a share of the image.', live=(0, 1))


class Middle(Detector):
    """A person in the middle of each frame."""

    def detect(self, frame):
        half = self._own[0].width * frame.camera.width / 2
        box = [frame.camera.width / 2 - half, 0, frame.camera.width / 2 + half, frame.camera.height]
        return Detections(np.array([box]), np.ones(1), np.zeros(1, int))


def example():
    """The detector in CONTRIBUTING.md."""
    block, names = next(block for block in blocks_in('CONTRIBUTING.md') if 'MiddleDetector(' in block.text), {}
    exec(block.text, names)
    return names['MiddleDetector']


IMAGES = 8
SCENE = {'duration': IMAGES / 10, 'rate': 10.0, 'people': [{'start': [3.0, 0.5], 'moves': [{'to': [3.0, -1.0]}]}]}


CODECS = {'plain': {}, 'compressed': {COLOR_TOPIC: 'jpeg', DEPTH_TOPIC: 'compressedDepth'}}
NAMES = {COLOR_TOPIC: COLOR_TOPIC + '/compressed', DEPTH_TOPIC: DEPTH_TOPIC + '/compressedDepth'}


@pytest.fixture(scope='module', params=sorted(CODECS))
def bags(request, tmp_path_factory):
    folder, codecs = tmp_path_factory.mktemp('bags'), CODECS[request.param]
    names = NAMES if codecs else {}

    def with_codec(topic, message, time):
        codec, name = codecs.get(topic[1:]), names.get(topic[1:], topic[1:])
        return '/' + name, compressed(message, codec) if codec else message, time
    changed_bag(scene_bag(folder / 'plain.bag', SCENE), folder / 'in.bag', with_codec)
    process_bag(str(folder / 'in.bag'), str(folder / 'out.bag'), Settings(detector='depth', names=names))
    return str(folder / 'in.bag'), str(folder / 'out.bag')


@pytest.mark.parametrize('bags, node_class, input_bag, params, topics', [
    ('plain', DetectorNode, 0, {'detector': 'depth'}, ['yolo_bounding_box']),
    ('plain', Bbox3dNode, 1, {}, ['ros_3d_bb/bb_3d']),
    ('plain', TrackerNode, 1, {'tf_timeout': 0.0}, ['ros_3d_bb/tracks', 'visualization_marker_array']),
    ('compressed', PeopleNode, 0, {'detector_node': {'detector': 'depth'}}, [
        'yolo_bounding_box', 'ros_3d_bb/bb_3d', 'ros_3d_bb/tracks'])], indirect=['bags'])
def test_process_bag_writes_the_messages_that_the_nodes_publish(bags, node_class, input_bag, params, topics):
    found = published(node_class, bags[input_bag], params, topics)
    for topic in topics:
        expected = messages_in(bags[1], '/' + topic)['/' + topic]
        assert len(expected) == IMAGES
        assert [str(message) for message in found[topic]] == [str(message) for message in expected]


@pytest.mark.parametrize('bags', ['plain'], indirect=True)
@pytest.mark.parametrize('row, params', [(Row(example()), {}), (Row(Middle, (MiddleParams,), True), {'width': 0.2})])
def test_a_detector_in_the_registry_runs_in_bags_and_nodes(bags, tmp_path, monkeypatch, row, params):
    monkeypatch.setitem(DETECTORS, 'middle', row)
    (tmp_path / 'params.yaml').write_text(json.dumps(params))
    status, printed = run(main, bags[0], tmp_path / 'out.bag', '--detector', 'middle', '--detector-params',
                          tmp_path / 'params.yaml')
    assert not status, printed
    topics = [BOXES_TOPIC, BOXES3D_TOPIC, TRACKS_TOPIC]
    found = published(PeopleNode, bags[0], {'detector_node': dict(params, detector='middle')}, topics)
    expected = messages_in(tmp_path / 'out.bag')
    assert len(found[BOXES_TOPIC]) == IMAGES and found[BOXES_TOPIC][0].data == (256, 0, 384, 480)
    for topic in topics:
        assert list(map(str, found[topic])) == list(map(str, expected['/' + topic]))


@pytest.mark.parametrize('node_class, stored', [(PeopleNode, {'detector_node': {'detector': 'dept'}}),
                                                (DetectorNode, {'detector': 'dept'})])
def test_an_unknown_detector_is_an_error_that_names_the_known_ones(node_class, stored):
    with masterless(stored), pytest.raises(ValueError, match="'dept'; did you mean depth.*depth, yolov5"):
        node_class()
